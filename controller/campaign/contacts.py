"""The clearance of a drive, and its contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.campaign.drive_log import DriveLog
from controller.campaign.stage import Stage, enclosing_circles
from hal.compiled import compiled
from hal.types import FloatArray
from sim.contact import body_radius
from sim.polygons import separation

# Two bodies approach each other by less than this between two control steps.
_MAX_APPROACH_M = 0.15
_SUBSTEPS = 4  # of a control step, in which contacts are looked for: at 3 m/s the two approach by 1.5 cm
# Of the others, every tenth step is computed first: a body moves some decimetres meanwhile, so most of the
# steps between are then known to be farther away.
_STRIDE, _ROUNDING_M = 10, 1e-9
# Distances above this matter to nobody, so they are not computed exactly.
_FAR_M = 2.0
_SAME_CONTACT_S = 0.5  # touching again sooner than this is the same contact


@dataclass(frozen=True, slots=True)
class Contact:
    """When a contact began, with which body, and at which speed of the robot."""

    t_s: float
    body: int
    v_mps: float


@compiled("float64[:, :, :], int64")
def _moved_m(polygons: FloatArray, stride: int) -> FloatArray:
    """The greatest distance (T,) that a corner of polygons (T, K, 2) has moved since the last stride-th
    one."""
    moved = np.empty(len(polygons))
    for t in range(len(polygons)):
        reference, square = t // stride * stride, 0.0
        for k in range(polygons.shape[1]):
            dx = polygons[t, k, 0] - polygons[reference, k, 0]
            dy = polygons[t, k, 1] - polygons[reference, k, 1]
            square = max(square, dx * dx + dy * dy)
        moved[t] = math.sqrt(square)
    return moved


class DriveClearance:
    """Distances between the robot and all bodies at its height over the whole drive.
    min_distance_m: the smallest."""

    def __init__(self, stage: Stage, log: DriveLog) -> None:
        self._stage, self._log = stage, log
        self._times = np.array(log.times_s)
        self._poses = log.pose_array()
        # Headings are interpolated between steps, so they must not jump from half a turn to minus half a
        # turn.
        self._poses[:, 2] = np.unwrap(self._poses[:, 2])
        self.min_distance_m = math.inf
        self._contacts: list[Contact] = []
        bodies = np.flatnonzero(stage.in_height).tolist()
        bounding_gaps = {body: self._bounding_gaps(body, self._times, self._poses) for body in bodies}
        # The nearest first. Of the others, only times at which they may come even nearer are computed
        # exactly.
        for body in sorted(bodies, key=lambda body: float(bounding_gaps[body][1].min(initial=math.inf))):
            self._check_body(body, *bounding_gaps[body])

    def contacts(self) -> list[Contact]:
        """All contacts in the order of time."""
        return sorted(self._contacts, key=lambda contact: (contact.t_s, contact.body))

    def _check_body(self, body: int, polygons: FloatArray, gap: FloatArray) -> None:
        gap = self._refine_gaps(polygons, gap, self._poses, _MAX_APPROACH_M)
        close = gap < _MAX_APPROACH_M
        if close.any():
            # Look between the steps, too, where a contact is possible.
            times, poses = self._interpolate(close)
            between = self._refine_gaps(*self._bounding_gaps(body, times, poses), poses, math.inf)
            self._record_contacts(body, times, between)
            gap = np.append(gap, between)
        self.min_distance_m = min(self.min_distance_m, float(gap.min(initial=math.inf)))

    def _bounding_gaps(
        self, body: int, times: FloatArray, poses: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The body's polygons (T, K, 2), and the distances (T,) between circles around it and the robot."""
        polygons = self._stage.world.sample(times, body)
        x, y, radius = enclosing_circles(polygons).T
        reach = body_radius(self._stage.robot.body)
        return polygons, np.hypot(x - poses[:, 0], y - poses[:, 1]) - radius - reach

    def _refine_gaps(
        self, polygons: FloatArray, gap: FloatArray, poses: FloatArray, exact_below_m: float
    ) -> FloatArray:
        """Distances (T,). Where they are too large to matter, gap (the distance of the circles) is kept, or
        inf if something else is certainly nearer."""
        near = np.flatnonzero(gap < min(max(self.min_distance_m, exact_below_m), _FAR_M))
        if not len(near):
            return gap
        robots, others = self._stage.robot_polygons(poses[near]), polygons[near]
        # Every tenth step first. Until the next of these, the distance shrinks at most as corners move.
        sampled = separation(robots[::_STRIDE], others[::_STRIDE])
        moved = _moved_m(robots, _STRIDE) + _moved_m(others, _STRIDE)
        lower_bound = sampled[np.arange(len(near)) // _STRIDE] - moved
        relevant = (
            lower_bound
            < max(min(self.min_distance_m, float(sampled.min())), min(exact_below_m, _FAR_M)) + _ROUNDING_M
        )
        exact = np.flatnonzero(relevant)
        gap[near] = np.inf
        gap[near[exact]] = separation(robots[exact], others[exact])
        return gap

    def _interpolate(self, close: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        padded = close.copy()
        padded[:-1] |= close[1:]
        padded[1:] |= close[:-1]
        index = np.flatnonzero(padded[:-1] & padded[1:])
        fraction = np.arange(_SUBSTEPS) / _SUBSTEPS
        dt = self._times[index + 1] - self._times[index]
        times = (self._times[index, None] + fraction * dt[:, None]).ravel()
        step = self._poses[index + 1] - self._poses[index]
        poses = (self._poses[index, None] + fraction[:, None] * step[:, None]).reshape(-1, 3)
        return times, poses

    def _record_contacts(self, body: int, times: FloatArray, gap: FloatArray) -> None:
        """Note each contact once, when it begins."""
        speeds = np.interp(times, self._times, np.array(self._log.v_mps))
        touching = np.flatnonzero(gap <= 0.0)
        last_s = -math.inf
        for k in touching.tolist():
            is_new = times[k] > last_s + _SAME_CONTACT_S
            last_s = float(times[k])
            if is_new:
                self._contacts.append(Contact(last_s, body, float(speeds[k])))
