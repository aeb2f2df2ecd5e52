"""The nearest unexplained surface on the path, also after it has left the view because the robot drives on.

A surface that sinks below the view, rises above it or passes beside it is still there, so it is held. A long
wall beside the corridor leaves the view little by little: its nearest visible point recedes as fast as the
robot drives. What vanishes while the robot stands has gone away; a sill that sank below the view before the
robot came to rest has not. A surface that is seen as before, but belongs to a body now, has not left the view
and is not held. Beside something that moves it may be a part of that, and is not held at rest. If it was only
ever seen there, and beside the swept width, it is not held at all: it has moved on with what it is a part of.
controller/decision/sight.py notes the nearest surface once a scene.
"""

from __future__ import annotations

import math
from collections import deque

from hal.clocks import NS_PER_S
from hal.records import record

SAME_SURFACE_M = 0.3  # how much farther along the path points of one surface may be
# The median of this many scenes counts: one outlier must not brake; three frames are a tenth of a second.
_FRAMES = 5
# A surface that recedes by more than this has left the view; less is depth noise.
_RECEDES_M = 0.05
# A surface that was the nearest for so long, with nothing that moves beside it, is held at rest, too. Strips
# of walkers whom no obstacle explains any more, at the edge of the view, last for 0.15 s; what stands on the
# path is seen for seconds.
_LASTS_NS = NS_PER_S // 2
_LONGEST_NS = NS_PER_S // 10  # between two scenes, of the time that counts


@record(frozen=True, slots=True)
class Nearest:
    """The nearest unexplained surface of one scene.

    s_m: along the path; inf: there is none.
    beside_mover: something moves beside it.
    in_swept_width: the robot would touch it; otherwise it would only come too close to it.
    """

    s_m: float
    beside_mover: bool = False
    in_swept_width: bool = True


class _Place:
    """About where the nearest surface is, and how it has been seen since it is there."""

    def __init__(self) -> None:
        self._s_m, self._still_ns, self._before_ns = math.inf, 0, 0
        self._passes = False

    def note(self, steady_s_m: float, nearest: Nearest, captured_ns: int) -> None:
        """steady_s_m: median of the last scenes."""
        passes = nearest.beside_mover and not nearest.in_swept_width
        if abs(steady_s_m - self._s_m) > SAME_SURFACE_M:
            self._s_m, self._still_ns, self._passes = steady_s_m, 0, passes
        elif not nearest.beside_mover:
            self._still_ns += min(captured_ns - self._before_ns, _LONGEST_NS)
        if self._is_at(nearest.s_m):
            self._passes &= passes
        self._before_ns = captured_ns

    def lasts(self, s_m: float) -> bool:
        """Whether one at s_m was the nearest, and about there, for some time without a mover beside it."""
        return self._is_at(s_m) and self._still_ns >= _LASTS_NS

    def passes(self, s_m: float) -> bool:
        """Whether one at s_m was only ever seen beside the swept width, and with a mover beside it."""
        return self._is_at(s_m) and self._passes

    def _is_at(self, s_m: float) -> bool:
        return abs(s_m - self._s_m) <= SAME_SURFACE_M


class HeldSurface:
    """Call note() once a scene. All are path coordinates in metres; inf: none.

    s_m: of the nearest surface, filtered over some scenes, or held.
    """

    def __init__(self) -> None:
        self.s_m = math.inf
        self._nearest: deque[float] = deque(maxlen=_FRAMES)
        self._closest_s_m = math.inf
        self._driving_s_m = self._lasting_s_m = math.inf  # held while the robot drives; held at rest, too
        self._place = _Place()
        self._seen_at_rest = False

    def note(
        self,
        nearest: Nearest,
        s_m: float,
        blind_s_m: float,
        captured_ns: int,
        standing: bool,
        explained_s_m: float = math.inf,
    ) -> None:
        """Take in the nearest surface of one scene.

        s_m: of the robot. blind_s_m: up to here surfaces may leave the view because the robot drives on.
        standing: the robot was at rest. explained_s_m: of the surface that is seen across the same way, but
        belongs to a body; inf: none.
        """
        self._nearest.append(nearest.s_m)
        steady = sorted(self._nearest)[len(self._nearest) // 2]
        receded = steady > self._closest_s_m + _RECEDES_M and self._closest_s_m < blind_s_m
        gone = abs(explained_s_m - self._closest_s_m) <= SAME_SURFACE_M
        gone |= receded and self._place.passes(self._closest_s_m)
        if standing:
            self._driving_s_m = math.inf
            self._forget_what_has_gone(steady)
        elif receded and not gone:
            self._driving_s_m = min(self._driving_s_m, self._closest_s_m)
            if self._place.lasts(self._closest_s_m):
                self._lasting_s_m = min(self._lasting_s_m, self._closest_s_m)
        self._seen_at_rest &= standing
        self._forget_what_is_behind(s_m)
        self._place.note(steady, nearest, captured_ns)
        keeps = not standing and not gone and s_m < self._closest_s_m < blind_s_m
        self._closest_s_m = min(steady, self._closest_s_m) if keeps else steady
        self.s_m = min(steady, self._driving_s_m, self._lasting_s_m)

    def _forget_what_has_gone(self, steady_s_m: float) -> None:
        """Drop a lasting surface that was seen about its place during this standstill and is seen no more."""
        seen = steady_s_m <= self._lasting_s_m + SAME_SURFACE_M
        if self._seen_at_rest and not seen:
            self._lasting_s_m = math.inf
        self._seen_at_rest = seen

    def _forget_what_is_behind(self, s_m: float) -> None:
        if self._driving_s_m < s_m:
            self._driving_s_m = math.inf
        if self._lasting_s_m < s_m:
            self._lasting_s_m = math.inf
