"""Who sets off as he leaves the view: judged standing still, but he approached when he was seen last.

A verdict takes some frames, and a body that has left the view gives no more of them. Most people who ever
walked into the robot's side had set off like that. controller/decision/known_bodies.py asks once a scene.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import MIN_TRACKED_S, Bodies
from controller.decision.unseen_motion import (
    APPROACH_MIN_MPS,
    APPROACH_MIN_SIGMAS,
    MIN_MOVER_HALF_WIDTH_M,
    leftward_variance,
)
from controller.decision.velocity_filter import missing_to_walking
from controller.decision.view_edges import CurrentView, out_of_view
from hal.compiled import compiled
from hal.directions import along_and_left
from hal.types import Flags, FloatArray

IntArray = NDArray[np.int64]

# Lower thresholds for what is as tall as a person: few racks and crates are, so noise slows the robot rarely.
_PERSON_MIN_SIGMAS, _PERSON_MIN_MPS = 2.5, 0.15
_PERSON_FROM_M, _PERSON_TO_M = 1.2, 2.2
# A body as tall as a person that approached up to this time before it was last seen has set off: one more
# measurement, of what the edge of the view leaves of it, does not prove the opposite.
_LATELY_NS = 200_000_000


class LeavingMovers:
    """Keeps which bodies have lately approached, and how wide each was ever seen.

    Call marked() once a scene.
    """

    def __init__(self) -> None:
        # Of bodies that are judged standing but clearly approached: by id, when last, and how fast.
        self._approached: dict[int, tuple[int, FloatArray]] = {}
        self._widest_of, self._widest_half_m = np.zeros(0, np.int64), np.zeros(0)

    def marked(self, seen: Bodies, view: CurrentView) -> Bodies:
        """The seen bodies, of which some that are judged standing are made moving.

        These are the ones that approached the robot's axis when last seen or just before, which perception
        now only predicts (unseen_s > 0), and whose place is out of view. They set off with that velocity.
        """
        if not len(seen):
            self._widest_of, self._approached = seen.ids, {}
            return seen
        # The edge of the view cuts bodies off, so the present width says little.
        self._widest_half_m = _widest(seen.ids, seen.half_across_m, self._widest_of, self._widest_half_m)
        self._widest_of = seen.ids
        unseen, approaches = _unseen_or_approaching(seen, self._widest_half_m, view)
        if not self._approached and not np.count_nonzero(approaches):
            return seen
        self._approached = self._lately_approached(seen, unseen, approaches)
        ids = seen.ids.tolist()
        approached = np.array([one in self._approached for one in ids], np.bool_)
        leaves = unseen & approached & out_of_view(seen, view)
        if not np.count_nonzero(leaves):
            return seen
        velocity = seen.velocity_mps.copy()
        velocity[leaves] = [self._approached[ids[k]][1] for k in np.flatnonzero(leaves).tolist()]
        innovation = np.where(leaves[:, None], missing_to_walking(velocity), seen.innovation_mps)
        moving = seen.moving | leaves
        return replace(seen, velocity_mps=velocity, innovation_mps=innovation, moving=moving)

    def _lately_approached(
        self, seen: Bodies, unseen: Flags, approaches: Flags
    ) -> dict[int, tuple[int, FloatArray]]:
        """Which bodies that are judged standing have lately approached: when last, and how fast.

        unseen, approaches (N,): see _unseen_or_approaching().
        """
        now_ns, lately = seen.captured_ns, {}
        stands_tall = ~seen.moving & _as_tall_as_a_person(seen)
        for k, track_id in enumerate(seen.ids.tolist()):
            before = self._approached.get(track_id)
            if approaches[k]:
                lately[track_id] = now_ns, seen.measured_mps[k]
            elif before is not None and (unseen[k] or (stands_tall[k] and now_ns - before[0] <= _LATELY_NS)):
                lately[track_id] = before
        return lately


def _as_tall_as_a_person(bodies: Bodies) -> Flags:
    """(N,) which bodies are."""
    return np.asarray((bodies.top_m >= _PERSON_FROM_M) & (bodies.top_m <= _PERSON_TO_M))


@compiled(Bodies, "float64[:]", CurrentView)
def _unseen_or_approaching(
    bodies: Bodies, widest_half_m: FloatArray, view: CurrentView
) -> tuple[Flags, Flags]:
    """Two masks (N,) of the bodies judged standing: not seen in this scene; and seen, but approaching.

    Approaching: the measured velocity towards the robot's axis (the line straight ahead of it) exceeds
    the noise; of a body as tall as a person, less suffices. A body is in neither mask if it was tracked for
    MIN_TRACKED_S or less, or was never wider than MIN_MOVER_HALF_WIDTH_M. widest_half_m (N,): half of the
    greatest width that each was seen with.
    """
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    unseen, approaches = np.zeros(len(bodies.moving), np.bool_), np.zeros(len(bodies.moving), np.bool_)
    for k in range(len(unseen)):
        # tracked_s and not age_s: the velocity of a new track was hardly measured, however long something
        # has stood there.
        hardly_tracked = bodies.tracked_s[k] <= MIN_TRACKED_S
        if bodies.moving[k] or hardly_tracked or widest_half_m[k] <= MIN_MOVER_HALF_WIDTH_M:
            continue
        unseen[k] = bodies.unseen_s[k] > 0.0
        _, left_m = along_and_left(bodies.xy_m[k, 0] - view.x_m, bodies.xy_m[k, 1] - view.y_m, cos, sin)
        vx, vy = bodies.measured_mps[k]
        _, leftward_mps = along_and_left(vx, vy, cos, sin)
        variance = leftward_variance(bodies.covariance[k], cos, sin)
        sigmas, least_mps = APPROACH_MIN_SIGMAS, APPROACH_MIN_MPS
        if _PERSON_FROM_M <= bodies.top_m[k] <= _PERSON_TO_M:
            sigmas, least_mps = _PERSON_MIN_SIGMAS, _PERSON_MIN_MPS
        clear_mps = max(sigmas * math.sqrt(variance), least_mps)
        approaches[k] = not unseen[k] and -np.sign(left_m) * leftward_mps > clear_mps
    return unseen, approaches


@compiled("int64[:], float64[:], int64[:], float64[:]")
def _widest(ids: IntArray, half_m: FloatArray, before_ids: IntArray, before_half_m: FloatArray) -> FloatArray:
    """(N,) half of the greatest width with which each of ids (N,) was ever seen.

    half_m (N,): the half widths now. before_half_m (M,): the greatest ones before, of before_ids (M,).
    """
    greatest = half_m.copy()
    for k in range(len(ids)):
        for m in range(len(before_ids)):
            if ids[k] == before_ids[m]:
                greatest[k] = max(greatest[k], before_half_m[m])
    return greatest
