"""Speed limits by the camera itself: how far it sees, and whether it works."""

from __future__ import annotations

from config.decision import DecisionConfig, SightConfig
from config.robot import Robot
from controller import braking
from controller.decision.decision import Reason
from controller.decision.limits import Limit, allowed_text
from controller.decision.world_model import WorldModel
from hal.types import CameraMount
from vision.scene import CameraCondition


class CameraLimits:
    """Limits by the camera of one robot.

    latency_s: from a decision until it acts.
    """

    def __init__(self, config: DecisionConfig, robot: Robot, mount: CameraMount, latency_s: float) -> None:
        self._sight, self._least_m = config.sight, config.margins.least_m
        limits = robot.limits
        self._brake = braking.emergency(limits) if config.emergency_caps_range else braking.comfort(limits)
        self._obstacle_mps = limits.max_obstacle_speed_mps
        self._sees_m = config.sight.range_m + mount.forward_m - robot.body.front_m
        self._latency_s = latency_s

    def limits(self, known: WorldModel) -> list[Limit]:
        """The limits by range and condition; by condition alone if the camera has failed."""
        by_condition = condition_limit(known, self._sight)
        if by_condition is None:
            return [self._range_limit(known.age_s)]
        return [by_condition] if known.fault else [self._range_limit(known.age_s), by_condition]

    def range_mps(self, age_s: float) -> float:
        """The speed that the range allows: stand before an obstacle arrives from beyond it at V_omax.

        age_s: age of the newest scene.
        """
        return braking.speed_for_distance(
            self._sees_m,
            self._brake,
            latency_s=self._latency_s + age_s,
            closing_mps=self._obstacle_mps,
            margin_m=self._least_m,
        )

    def _range_limit(self, age_s: float) -> Limit:
        sees_m, speed = self._sees_m, self.range_mps(age_s)
        return Limit(
            speed, lambda: Reason("range", f"the camera sees {sees_m:.1f} m ahead: {allowed_text(speed)}")
        )


def condition_limit(known: WorldModel, sight: SightConfig) -> Limit | None:
    """The limit by a degraded, frozen or lost camera, wherever the robot goes; None: it works."""
    if known.fault:
        # Brake hard if bodies were moving when the camera failed, or if it failed so long ago that somebody
        # may have come since.
        urgent = bool(known.bodies.moving.any()) or known.since_s > sight.blind_s
        reason = Reason("camera", f"{known.fault}: stop")
        return Limit(0.0, lambda: reason, urgent=urgent)
    if known.health.condition is not CameraCondition.DEGRADED:
        return None
    sentence = f"the camera is degraded ({known.health.reason}): {allowed_text(sight.degraded_mps)}"
    return Limit(sight.degraded_mps, lambda: Reason("camera", sentence))
