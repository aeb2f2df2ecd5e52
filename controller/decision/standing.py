"""What stands in the corridor -> speed limits: stop before it, where it can still be seen to leave."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, Placed, place
from controller.decision.knowledge import Knowledge
from controller.decision.limits import ALONGSIDE_M, Gap, Limit, Motion, stop_before
from controller.decision.outline import outline_of
from controller.decision.view_edges import visible_from_m
from hal.compiled import compiled
from hal.records import record
from hal.types import CameraMount, FloatArray

_INSIDE_BODY_M = 0.05
# What stands so near beside the way may come to graze it when only a part of it is in view.
_BESIDE_M = 0.5
# What hangs and rises above the view is stood off so far at most.
_MOST_OFF_M = 3.0
_NOW = np.zeros(1)


@record(frozen=True, slots=True)
class _Near:
    """What may stand in the corridor; lo_m, hi_m, clear_m: see corridor.Placed. stop_m: where to stand before
    it."""

    number: int
    lo_m: float
    hi_m: float
    clear_m: float
    age_s: float
    stop_m: float


class StandingLimits:
    """inside: ids of who counts as in the corridor; shared with whoever watches the moving ones, because
    bodies start and stop. Standing bodies are placed once a scene, not once a step."""

    def __init__(self, config: DecisionConfig, limits: Limits, mount: CameraMount, inside: set[int]) -> None:
        self._config, self._limits, self._mount = config, limits, mount
        self._comfort, self._emergency = braking.comfort(limits), braking.emergency(limits)
        self._inside = inside
        self._of: Bodies | None = None
        self._near: list[_Near] = []
        self._corridor: Corridor | None = None
        self._outlines_m: dict[int, float] = {}

    def limits(self, known: Knowledge, s_m: float, motion: Motion) -> list[Limit]:
        """For the robot at s_m."""
        if known.bodies is not self._of or known.corridor is not self._corridor:
            self._take_in(known, s_m)
        margins = self._config.margins
        found = []
        for near in self._near:
            if near.hi_m <= s_m:
                continue
            number, gap_m = near.number, near.lo_m - s_m
            beside_m = margins.lateral_m + (margins.graze_m if number in self._inside else 0.0)
            if gap_m < -ALONGSIDE_M:
                # The front has passed it already: only what the body would really touch counts.
                beside_m = -_INSIDE_BODY_M
            if near.clear_m > beside_m:
                self._inside.discard(number)
                continue
            gap = Gap(gap_m, obstacle_id=number)
            if self._may_wait(gap, motion, near.age_s):
                continue
            self._inside.add(number)
            what = "stands on the path"
            found.append(
                stop_before(gap, motion, self._comfort, near.stop_m, margins.least_m, "static", what)
            )
        return found

    def _take_in(self, known: Knowledge, s_m: float) -> None:
        """Place what stands in a new scene, or beside a new path, and leave out what is too far aside to
        matter. Outlines that were seen along another path say nothing here."""
        before = self._outlines_m if known.corridor is self._corridor else {}
        self._of, self._corridor = known.bodies, known.corridor
        self._near, self._outlines_m = [], {}
        bodies = known.bodies
        if np.count_nonzero(bodies.moving) == len(bodies):
            return
        sight, margins = self._config.sight, self._config.margins
        placed = place(bodies, known.corridor, _NOW, s_m, sight.range_m + 2.0)
        clear_m = self._clear(known, placed, s_m, before)
        near = clear_m <= margins.lateral_m + margins.graze_m
        if self._inside:
            self._inside.difference_update(bodies.ids[~(near | bodies.moving)].tolist())
        rows = (near & ~bodies.moving).nonzero()[0]
        if len(rows):
            stop_m = self._standing_off(known, bodies, placed)
            near_ones = _columns(rows, placed.lo_m, placed.hi_m, clear_m, bodies.age_s, stop_m)
            numbers = bodies.ids[rows].tolist()
            self._near = [_Near(number, *of) for number, of in zip(numbers, near_ones.tolist(), strict=True)]

    def _clear(self, known: Knowledge, placed: Placed, s_m: float, before: dict[int, float]) -> FloatArray:
        """(N,) free floor beside the swept corridor; in bends, by the outlines when they were last seen
        whole, by number before this scene, as long as nothing nearer is seen of them."""
        if known.corridor.straight:
            return placed.clear_m[:, 0]
        clear_m = placed.clear_m[:, 0].copy()
        standing, near_m = ~known.bodies.moving, self._config.margins.lateral_m + _BESIDE_M
        beside = standing & (clear_m <= near_m) & (placed.hi_m[:, 0] > s_m)
        bodies, depth_m = known.bodies.select(beside), self._config.prediction.body_depth_m
        own = known.surfaces.of(bodies)
        for k, row in enumerate(beside.nonzero()[0].tolist()):
            stretch_m = s_m - ALONGSIDE_M, float(placed.hi_m[row, 0]) + known.corridor.front_m
            outline = outline_of(bodies, k, own[:, k], known.surfaces, known.corridor, stretch_m, depth_m)
            number = int(bodies.ids[k])
            whole_m = outline.clear_m if outline.whole else before.get(number, -math.inf)
            self._outlines_m[number] = whole_m
            clear_m[row] = max(clear_m[row], min(whole_m, outline.clear_m))
        return clear_m

    def _standing_off(self, known: Knowledge, bodies: Bodies, placed: Placed) -> FloatArray:
        """(N,) where to stand before a body: so that it is still seen, and seen to leave; never nearer than
        stop_m, which a camera that looks down steeply would allow."""
        visible_m = visible_from_m(
            bodies, placed.d_m[:, 0], known.edge_tan, known.near_m, self._mount.height_m, known.up_tan
        )
        front_m = known.corridor.front_m - self._mount.forward_m
        stop_m = self._config.margins.stop_m
        return _standing_off(
            visible_m, bodies.bottom_m, self._mount.height_m, front_m, stop_m, max(known.near_m, stop_m)
        )

    def _may_wait(self, gap: Gap, motion: Motion, age_s: float) -> bool:
        """A young obstacle may be confirmed first while an emergency stop fits even if it came at V_o."""
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


@compiled("int64[:], float64[:, :], float64[:, :], float64[:], float64[:], float64[:]")
def _columns(
    rows: NDArray[np.intp],
    lo_m: FloatArray,
    hi_m: FloatArray,
    clear_m: FloatArray,
    age_s: FloatArray,
    stop_m: FloatArray,
) -> FloatArray:
    """(R, 5) what _Near says of rows (R,), but for the number."""
    near = np.empty((len(rows), 5))
    for i in range(len(rows)):
        k = rows[i]
        near[i] = lo_m[k, 0], hi_m[k, 0], clear_m[k], age_s[k], stop_m[k]
    return near


@compiled("float64[:], float64[:], float64, float64, float64, float64")
def _standing_off(
    visible_m: FloatArray, bottom_m: FloatArray, height_m: float, front_m: float, stop_m: float, most_m: float
) -> FloatArray:
    """(N,) so far before a body, at least stop_m, that it is visible_m (N,) before the camera, but no farther
    than most_m, or what hangs is stood off at most."""
    off = np.empty(len(visible_m))
    for k in range(len(visible_m)):
        hangs = bottom_m[k] > height_m
        off[k] = min(max(visible_m[k] - front_m, stop_m), max(most_m, _MOST_OFF_M if hangs else 0.0))
    return off
