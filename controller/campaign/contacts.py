"""How near a drive came to everything, and what it touched."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.campaign.drive import DriveLog
from controller.campaign.stage import Stage
from hal.types import FloatArray
from sim.planar import separation

# Between two control steps two bodies come no closer to each other than this.
_BETWEEN_STEPS_M = 0.15
_SUBSTEPS = 4


@dataclass(frozen=True, slots=True)
class Contact:
    """When and with whom it began, and how fast the robot was."""

    t_s: float
    body: int
    v_mps: float


class Clearance:
    """Distances between the robot and all bodies at its height, over the whole drive."""

    def __init__(self, stage: Stage, log: DriveLog) -> None:
        self._stage, self._log = stage, log
        self._times = np.array(log.times_s)
        self._poses = log.pose_array()
        self.least_m = math.inf
        self._contacts: list[Contact] = []
        for body in np.flatnonzero(stage.in_height).tolist():
            self._look_at(body)

    def contacts(self) -> list[Contact]:
        """In the order of time."""
        return sorted(self._contacts, key=lambda one: one.t_s)

    def _look_at(self, body: int) -> None:
        times, poses = self._times, self._poses
        gap = self._gap(body, times, poses, _BETWEEN_STEPS_M)
        close = gap < _BETWEEN_STEPS_M
        if close.any():
            # Look between the steps as well where something could happen there.
            times, poses = self._between(close)
            gap = np.append(gap, self._gap(body, times, poses, math.inf))
            self._note(body, times, gap[-len(times) :])
        self.least_m = min(self.least_m, float(gap.min(initial=math.inf)))

    def _gap(self, body: int, times: FloatArray, poses: FloatArray, exact_below_m: float) -> FloatArray:
        """(T,) distance; that of circles where they are further apart than what matters."""
        robot = self._stage.robot.body
        polygons = self._stage.world.over(times, body)
        middle = polygons.mean(axis=1)
        radius = np.sqrt(((polygons - middle[:, None]) ** 2).sum(axis=2).max(axis=1))
        reach = math.hypot(max(robot.front_m, robot.rear_m), 0.5 * robot.width_m)
        gap = np.hypot(middle[:, 0] - poses[:, 0], middle[:, 1] - poses[:, 1]) - radius - reach
        exact = np.flatnonzero(gap < max(min(self.least_m, 2.0), min(exact_below_m, 2.0)))
        if len(exact):
            gap[exact] = separation(self._stage.robots(poses[exact]), polygons[exact])
        distance: FloatArray = gap
        return distance

    def _between(self, close: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        wide = close.copy()
        wide[:-1] |= close[1:]
        wide[1:] |= close[:-1]
        index = np.flatnonzero(wide[:-1] & wide[1:])
        share = np.arange(_SUBSTEPS) / _SUBSTEPS
        dt = self._times[index + 1] - self._times[index]
        times = (self._times[index, None] + share * dt[:, None]).ravel()
        step = self._poses[index + 1] - self._poses[index]
        poses = (self._poses[index, None] + share[:, None] * step[:, None]).reshape(-1, 3)
        return times, poses

    def _note(self, body: int, times: FloatArray, gap: FloatArray) -> None:
        """A contact counts when it begins; it is another one after half a second apart."""
        speeds = np.interp(times, self._times, np.array(self._log.v_mps))
        touching = np.flatnonzero(gap <= 0.0)
        last_s = -math.inf
        for k in touching.tolist():
            fresh = times[k] > last_s + 0.5
            last_s = float(times[k])
            if fresh:
                self._contacts.append(Contact(last_s, body, float(speeds[k])))
