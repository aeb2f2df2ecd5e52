"""Vehicles that stand or creep after they have moved: as they turn, their ends may swing towards the robot.

A car that has backed out across the way, or a fork lift, turns where it is. Its middle does not move, so
nothing tells the turn beforehand, and the end that was beside the robot's way comes nearer by more than the
robot keeps free. While it turns, perception may lose it, and see it again as other tracks: what begins where
it was is taken for a part of it. controller/decision/known_bodies.py asks once a scene.
"""

from __future__ import annotations

import math
from operator import attrgetter

import numpy as np

from controller.decision.bodies import Bodies
from controller.decision.view_edges import CurrentView, ahead_and_left, reaches_side_edge
from hal.clocks import NS_PER_S
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import Flags, FloatArray, Integers, Matrix, Vector

# Of half its length, as seen from the side. A rectangle turns within the circle through its corners: one of
# 2.4 x 1.15 m comes nearer by 0.63 of half its length, one of 4.3 x 1.8 m by 0.66.
_SWING_SHARE = 0.63
# Half the length of the shortest vehicle that counts. One of 1.2 x 0.8 m comes nearer by 0.32 m, less than
# the robot keeps free. Two people side by side are as wide as that.
_LEAST_HALF_M = 0.65
# Of a vehicle that a side edge of the view cuts, half may be seen: half its length is the width that is seen,
# but not more than that of a vehicle in a hall. What is narrower than the first of these is a person. What is
# wider by the last than it ever was while both of its ends were seen, is larger than that.
_CUT_LEAST_HALF_M, _CUT_HALF_M, _WIDER_M = 0.4, 1.2, 0.1
# A faster one goes where it is seen to go, and has to slow down before it turns on the spot.
_SLOW_MPS = 0.6
_FOR_SURE_NS = NS_PER_S  # something static that is taken for a mover is so for some frames only
_MOVED_NS = 5 * NS_PER_S  # who has stood for so long is not in the middle of a turn
_WIDTH_KEPT_NS = 3 * NS_PER_S  # half a turn takes as long; in its middle a vehicle is seen end on
_NEVER_NS = -(2**62)


@record(frozen=True, slots=True, eq=False)
class _Tracks:
    """What is known of N tracks, (N,) each: those of the last scene, then vehicles that have been lost since.

    xy_m: (N, 2) where it was last seen.
    set_off_ns: since when it has been moving; the time of the scene while it stands.
    moved_ns: when it was last in a motion that had lasted for some time.
    seen_half_m, wide_ns: its greatest half width lately, and when that was seen.
    whole_half_m: the greatest with which it was ever seen inside the view; 0: never.
    half_m: half its length: seen_half_m, or more where the view cuts it.
    """

    ids: Integers
    xy_m: Matrix
    set_off_ns: Integers
    moved_ns: Integers
    seen_half_m: Vector
    wide_ns: Integers
    whole_half_m: Vector
    half_m: Vector

    def followed_by(self, other: _Tracks, rows: Integers) -> _Tracks:
        """These tracks, followed by the rows of others."""
        if not len(rows):
            return self
        pairs = zip(_arrays_of(self), _arrays_of(other), strict=True)
        return _Tracks(*(np.concatenate((mine, its[rows])) for mine, its in pairs))


_arrays_of = attrgetter(*_Tracks.__slots__)


class TurningVehicles:
    """Notes which tracks have lately moved, and how wide they were.

    swing_allowed_m: so much of a swing is within the margin that the robot keeps.
    """

    def __init__(self, swing_allowed_m: float) -> None:
        self._swing_allowed_m = swing_allowed_m
        nobody = np.zeros(0, np.int64)
        size_m = np.zeros(0)
        self._tracks = _Tracks(nobody, np.zeros((0, 2)), nobody, nobody, size_m, nobody, size_m, size_m)

    def swing_m(self, seen: Bodies, view: CurrentView) -> FloatArray:
        """(N,) by how much more than the margin allows the ends of the tracks of a scene may come nearer.

        0 for whatever is no vehicle that has moved lately and is slow now.
        """
        cut = _cut_by_view(seen, view)
        tracks = _Tracks(seen.ids, seen.xy_m, *_updated(self._tracks, seen, cut))
        swing_m = _swings(tracks, seen, self._swing_allowed_m)
        self._tracks = tracks.followed_by(self._tracks, _lost(self._tracks, seen).nonzero()[0])
        return swing_m


@inlined
def _row_of(ids: Integers, one: int) -> int:
    for row in range(len(ids)):
        if ids[row] == one:
            return row
    return -1


@inlined
def _may_turn(tracks: _Tracks, row: int, now_ns: int) -> bool:
    """Whether it is a vehicle that has moved lately."""
    result: bool = tracks.half_m[row] > _LEAST_HALF_M and now_ns - tracks.moved_ns[row] <= _MOVED_NS
    return result


@inlined
def _row_around(tracks: _Tracks, xy_m: FloatArray, now_ns: int) -> int:
    """The row of a vehicle that may turn and within half a length of which xy_m lies; -1: there is none."""
    for row in range(len(tracks.ids)):
        away_m = math.hypot(tracks.xy_m[row, 0] - xy_m[0], tracks.xy_m[row, 1] - xy_m[1])
        if away_m <= tracks.half_m[row] and _may_turn(tracks, row, now_ns):
            return row
    return -1


@compiled(Bodies, CurrentView)
def _cut_by_view(seen: Bodies, view: CurrentView) -> Flags:
    """(N,) which tracks may go on beyond a side edge of the view."""
    cut = np.empty(len(seen.ids), np.bool_)
    for k in range(len(cut)):
        ahead_m, left_m = ahead_and_left(seen.xy_m[k], view)
        cut[k] = reaches_side_edge(abs(left_m) + seen.half_across_m[k], ahead_m, view)
    return cut


@compiled(_Tracks, Bodies)
def _lost(tracks: _Tracks, seen: Bodies) -> Flags:
    """(N,) which of the tracks are vehicles that may turn, and are not seen."""
    lost = np.zeros(len(tracks.ids), np.bool_)
    for row in range(len(lost)):
        lost[row] = _may_turn(tracks, row, seen.captured_ns) and _row_of(seen.ids, tracks.ids[row]) < 0
    return lost


@compiled(_Tracks, Bodies, "boolean[:]")
def _updated(
    tracks: _Tracks, seen: Bodies, cut: Flags
) -> tuple[Integers, Integers, FloatArray, Integers, FloatArray, FloatArray]:
    """The fields of _Tracks from set_off_ns on, of the tracks seen; the view cuts some (N,) of them."""
    now_ns, count = seen.captured_ns, len(seen.ids)
    set_off_ns, moved_ns = np.full(count, now_ns, np.int64), np.full(count, _NEVER_NS, np.int64)
    seen_half_m, wide_ns = seen.half_across_m.copy(), np.full(count, now_ns, np.int64)
    whole_half_m, half_m = np.zeros(count), np.empty(count)
    for k in range(count):
        guess_m = 0.0
        before = _row_of(tracks.ids, seen.ids[k])
        if before < 0:
            before = _row_around(tracks, seen.xy_m[k], now_ns)
        if before >= 0:
            moved_ns[k] = tracks.moved_ns[before]
            if seen.moving[k]:
                set_off_ns[k] = tracks.set_off_ns[before]
            if (
                seen_half_m[k] < tracks.seen_half_m[before]
                and now_ns - tracks.wide_ns[before] <= _WIDTH_KEPT_NS
            ):
                seen_half_m[k], wide_ns[k] = tracks.seen_half_m[before], tracks.wide_ns[before]
            whole_half_m[k] = tracks.whole_half_m[before]
            guess_m = tracks.half_m[before] if tracks.half_m[before] > tracks.seen_half_m[before] else 0.0
        if now_ns - set_off_ns[k] >= _FOR_SURE_NS:
            moved_ns[k] = now_ns
        if not cut[k]:
            whole_half_m[k], guess_m = max(whole_half_m[k], seen.half_across_m[k]), 0.0
        elif seen.half_across_m[k] > max(_CUT_LEAST_HALF_M, whole_half_m[k] + _WIDER_M):
            guess_m = max(guess_m, min(2.0 * seen.half_across_m[k], _CUT_HALF_M))
        half_m[k] = max(seen_half_m[k], guess_m)
    return set_off_ns, moved_ns, seen_half_m, wide_ns, whole_half_m, half_m


@compiled(_Tracks, Bodies, "float64")
def _swings(tracks: _Tracks, seen: Bodies, allowed_m: float) -> FloatArray:
    """As TurningVehicles.swing_m."""
    swing_m = np.zeros(len(seen.ids))
    for k in range(len(swing_m)):
        slow = math.hypot(seen.measured_mps[k, 0], seen.measured_mps[k, 1]) < _SLOW_MPS
        if slow and _may_turn(tracks, k, seen.captured_ns):
            swing_m[k] = max(_SWING_SHARE * tracks.half_m[k] - allowed_m, 0.0)
    return swing_m
