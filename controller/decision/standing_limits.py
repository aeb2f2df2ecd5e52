"""Speed limits for bodies that stand in the corridor: stop before each, where it can still be seen to leave.

controller/decision/speed_limits.py calls StandingLimits in each control step. Bodies are placed along the
path once a scene; controller/decision/outline.py tells how far beside the corridor they are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.decision.bodies import Bodies
from controller.decision.corridor import BEYOND_RANGE_M, Corridor, Placed, place
from controller.decision.lateral_margin import LateralMargin
from controller.decision.limits import (
    ALONGSIDE_M,
    STANDING_MPS,
    Gap,
    Limit,
    Motion,
    standing_text,
    stop_before,
)
from controller.decision.outline import outline_of
from controller.decision.view_edges import visible_from_m
from controller.decision.world_model import WorldModel
from hal.compiled import compiled
from hal.records import record
from hal.types import Flags, FloatArray

# Beside the robot (its front is past the near side) only a body this far inside the corridor counts.
_INSIDE_BODY_M = 0.05
# While the robot drives, what has not been seen for so long does not count as clear of the lateral margin.
_UNMEASURED_S = 0.3
# Outlines are kept of bodies this far beside the lateral margin: later, when only a part is in view, the box
# of such a body may reach into the corridor.
_BESIDE_M = 0.5
# Greatest distance at which the robot stands off something that hangs and would rise above the view.
_MAX_HANGING_STOP_M = 3.0
_NOW = np.zeros(1)


@record(frozen=True, slots=True)
class _Near:
    """A body that may stand in the corridor.

    track_id: its id.
    block_from_s_m, block_to_s_m, clearance_m: see corridor.Placed.
    age_s, unseen_s: since it was first and last seen.
    stop_m: distance from it at which the robot stands.
    """

    track_id: int
    block_from_s_m: float
    block_to_s_m: float
    clearance_m: float
    age_s: float
    unseen_s: float
    stop_m: float


class StandingLimits:
    """Limits for standing bodies.

    beside: which bodies beside the corridor are in the way; shared with MovingLimits. Standing bodies are
    placed once a scene, not once a step.
    """

    def __init__(self, config: DecisionConfig, limits: Limits, beside: LateralMargin) -> None:
        self._config, self._limits = config, limits
        self._comfort, self._emergency = braking.comfort(limits), braking.emergency(limits)
        self._beside = beside
        self._taken_from: Bodies | None = None
        self._near: list[_Near] = []
        self._corridor: Corridor | None = None
        self._outlines_m: dict[int, float] = {}

    def limits(self, known: WorldModel, s_m: float, motion: Motion, now_s: float) -> list[Limit]:
        """The limits for a robot at s_m."""
        if known.bodies is not self._taken_from or known.corridor is not self._corridor:
            self._take_in(known, s_m)
        margins, beside = self._config.margins, self._beside
        found = []
        for near in self._near:
            if near.block_to_s_m <= s_m:
                continue
            track_id, gap_m = near.track_id, near.block_from_s_m - s_m
            measured = motion.v_mps <= STANDING_MPS or near.unseen_s <= _UNMEASURED_S
            beside.note_clearance(track_id, near.clearance_m, measured, now_s)
            # Once the front has passed its near side, only a body that the robot would really touch counts.
            needed_m = -_INSIDE_BODY_M if gap_m < -ALONGSIDE_M else beside.needed_m(track_id)
            if near.clearance_m > needed_m:
                beside.goes_out((track_id,))
                continue
            gap = Gap(gap_m, obstacle_id=track_id, unseen_s=near.unseen_s)
            if self._may_wait(gap, motion, near.age_s):
                continue
            beside.comes_in((track_id,))
            what = standing_text(near.clearance_m, beside.farthest_m)
            found.append(
                stop_before(gap, motion, self._comfort, near.stop_m, margins.least_m, "static", what)
            )
        return found

    def _take_in(self, known: WorldModel, s_m: float) -> None:
        """Place the standing bodies of a new scene, or along a new path, and drop those too far aside.

        Outlines that were measured along another path are not used.
        """
        before = self._outlines_m if known.corridor is self._corridor else {}
        self._taken_from, self._corridor = known.bodies, known.corridor
        self._near, self._outlines_m = [], {}
        bodies = known.bodies
        if np.count_nonzero(bodies.moving) == len(bodies):
            return
        placed = place(bodies, known.corridor, _NOW, s_m, self._config.sight.range_m + BEYOND_RANGE_M)
        clearance_m = self._clearances(known, placed, s_m, before)
        near = _stands_within(bodies.moving, clearance_m, -math.inf, self._beside.farthest_m)
        self._beside.goes_out(bodies.ids[~(near | bodies.moving)].tolist())
        rows = near.nonzero()[0]
        if len(rows):
            stop_m = self._stands_off_m(known, bodies, placed)
            fields = _columns(rows, bodies, placed, clearance_m, stop_m).tolist()
            track_ids = bodies.ids[rows].tolist()
            self._near = [_Near(one, *others) for one, others in zip(track_ids, fields, strict=True)]
        self._beside.keep_times_of(near.track_id for near in self._near)

    def _clearances(
        self, known: WorldModel, placed: Placed, s_m: float, before: dict[int, float]
    ) -> FloatArray:
        """(N,) free floor between the bodies and the corridor; notes the outlines that it measures.

        In bends it comes from each body's outline when it was last seen whole, unless a part that is nearer
        to the corridor is seen now. On a straight path the box fits, but mixed pixels at its edges make it
        some centimetres too wide: there the outline counts only for boxes that do not reach into the corridor
        itself. before: by id, these clearances up to the last scene.
        """
        clearance_m = placed.clearance_m[:, 0].copy()
        margins, straight = self._config.margins, known.corridor.straight
        least_m, most_m = (0.0, margins.graze_m) if straight else (-math.inf, _BESIDE_M)
        beside = _stands_within(known.bodies.moving, clearance_m, least_m, margins.lateral_m + most_m)
        if np.count_nonzero(beside):
            beside &= placed.block_to_s_m[:, 0] > s_m
        if not np.count_nonzero(beside):
            return clearance_m
        bodies, depth_m = known.bodies.select(beside), self._config.prediction.body_depth_m
        own = known.surfaces.of(bodies)
        for k, row in enumerate(beside.nonzero()[0].tolist()):
            stretch_m = s_m - ALONGSIDE_M, float(placed.block_to_s_m[row, 0]) + known.corridor.front_m
            outline = outline_of(bodies, k, own[:, k], known.surfaces, known.corridor, stretch_m, depth_m)
            track_id = int(bodies.ids[k])
            whole_m = outline.clearance_m if outline.whole else before.get(track_id, -math.inf)
            self._outlines_m[track_id] = whole_m
            clearance_m[row] = max(clearance_m[row], min(whole_m, outline.clearance_m))
        return clearance_m

    def _stands_off_m(self, known: WorldModel, bodies: Bodies, placed: Placed) -> FloatArray:
        """(N,) distance at which to stand before each body, so that it is still in view and seen to leave.

        Never less than the configured stop_m, even if a camera that looks down steeply would see it nearer.
        """
        view, stop_m = known.view, self._config.margins.stop_m
        visible_m = visible_from_m(bodies, placed.d_m[:, 0], view)
        front_m = known.corridor.front_m - view.forward_m
        return _stop_distances(
            visible_m, bodies.bottom_m, view.height_m, front_m, stop_m, max(view.near_m, stop_m)
        )

    def _may_wait(self, gap: Gap, motion: Motion, age_s: float) -> bool:
        """Whether a young obstacle may first be confirmed.

        That is so while an emergency stop after confirm_s would still be in time, even if the obstacle came
        at the greatest obstacle speed V_omax.
        """
        if age_s >= self._config.prediction.confirm_s:
            return False
        needed = braking.required_distance(
            motion.v_mps,
            motion.a_mps2,
            self._limits.max_obstacle_speed_mps,
            motion.latency_s + self._config.prediction.confirm_s,
            self._emergency,
            self._config.margins.stop_m,
        )
        return needed <= gap.distance_m


@compiled("boolean[:], float64[:], float64, float64")
def _stands_within(moving: Flags, clearance_m: FloatArray, above_m: float, up_to_m: float) -> Flags:
    """(N,) which bodies stand, with a clearance above above_m and up to up_to_m."""
    within = np.empty(len(moving), np.bool_)
    for k in range(len(moving)):
        within[k] = not moving[k] and above_m < clearance_m[k] <= up_to_m
    return within


@compiled("int64[:]", Bodies, Placed, "float64[:], float64[:]")
def _columns(
    rows: NDArray[np.intp], bodies: Bodies, placed: Placed, clearance_m: FloatArray, stop_m: FloatArray
) -> FloatArray:
    """(R, 6) the fields of _Near except track_id, for the bodies rows (R,)."""
    near = np.empty((len(rows), 6))
    for i in range(len(rows)):
        k = rows[i]
        near[i, :2] = placed.block_from_s_m[k, 0], placed.block_to_s_m[k, 0]
        near[i, 2:] = clearance_m[k], bodies.age_s[k], bodies.unseen_s[k], stop_m[k]
    return near


@compiled("float64[:], float64[:], float64, float64, float64, float64")
def _stop_distances(
    visible_m: FloatArray, bottom_m: FloatArray, height_m: float, front_m: float, stop_m: float, max_m: float
) -> FloatArray:
    """(N,) distance of the robot's front from a body at which the body is visible_m (N,) ahead of the camera.

    At least stop_m. At most max_m, or _MAX_HANGING_STOP_M, if that is more, for a body that hangs above the
    camera.
    """
    off = np.empty(len(visible_m))
    for k in range(len(visible_m)):
        hangs = bottom_m[k] > height_m
        off[k] = min(max(visible_m[k] - front_m, stop_m), max(max_m, _MAX_HANGING_STOP_M if hangs else 0.0))
    return off
