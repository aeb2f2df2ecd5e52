"""The motion of the evaluation's robot, the odometry that it measures, and its camera mount."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hal.clocks import NS_PER_S
from hal.geometry import advance_pose, camera_in_floor
from hal.types import CameraMount, PlanarPose, Pose

_STEP_S = 0.005  # step of the integration
MOUNT = CameraMount(forward_m=0.45, left_m=0.0, height_m=0.60, pitch_rad=math.radians(4.0))


@dataclass(frozen=True, slots=True)
class Knot:
    """Speed and yaw rate at a time: linear between knots, constant before the first and after the last."""

    t_s: float
    v_mps: float
    w_radps: float = 0.0


@dataclass(frozen=True, slots=True)
class OdometryError:
    """Errors of dead reckoning, because tracks slip.

    It measures distance_ratio x the true distance and yaw_ratio x the true rotation, plus a constant drift.
    """

    distance_ratio: float = 1.01
    yaw_ratio: float = 1.02
    drift_radps: float = 0.003


SLIPPING = OdometryError(distance_ratio=1.03, yaw_ratio=1.10, drift_radps=0.02)


class ScriptedDrive:
    """The true course over the floor and the course that odometry measures, as pure functions of time."""

    def __init__(self, knots: tuple[Knot, ...], duration_s: float, error: OdometryError) -> None:
        self._times = np.array([knot.t_s for knot in knots])
        self._v = np.array([knot.v_mps for knot in knots])
        self._w = np.array([knot.w_radps for knot in knots])
        self._error = error
        steps = math.ceil(duration_s / _STEP_S) + 1
        origin = PlanarPose(0.0, 0.0, 0.0)
        self._true = [origin]
        self._odometry = [origin]
        for step in range(steps):
            v_mps, w_radps = self.twist((step + 0.5) * _STEP_S)
            self._true.append(advance_pose(self._true[-1], v_mps, w_radps, _STEP_S))
            self._odometry.append(
                advance_pose(self._odometry[-1], *self._measured_twist(v_mps, w_radps), _STEP_S)
            )

    def twist(self, t_s: float) -> tuple[float, float]:
        """True speed in m/s and yaw rate in rad/s."""
        return float(np.interp(t_s, self._times, self._v)), float(np.interp(t_s, self._times, self._w))

    def pose(self, t_s: float) -> PlanarPose:
        """The robot's true pose."""
        return self._interpolate(self._true, t_s, self.twist(t_s))

    def odometry(self, t_s: float) -> PlanarPose:
        """The robot's pose by odometry."""
        return self._interpolate(self._odometry, t_s, self._measured_twist(*self.twist(t_s)))

    def odometry_camera(self, stamp_ns: int) -> Pose:
        """The camera's pose by dead reckoning, which does not contain the vibration."""
        return camera_in_floor(self.odometry(stamp_ns / NS_PER_S), MOUNT)

    def _measured_twist(self, v_mps: float, w_radps: float) -> tuple[float, float]:
        error = self._error
        return v_mps * error.distance_ratio, w_radps * error.yaw_ratio + error.drift_radps

    @staticmethod
    def _interpolate(poses: list[PlanarPose], t_s: float, twist: tuple[float, float]) -> PlanarPose:
        index = min(int(t_s / _STEP_S), len(poses) - 1)
        return advance_pose(poses[index], *twist, t_s - index * _STEP_S)
