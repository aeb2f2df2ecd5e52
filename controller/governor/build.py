"""Makes the governor's parts from the configuration; controller/build.py makes all others."""

from __future__ import annotations

from config.app import AppConfig
from config.governor import GovernorConfig
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.build import build_path
from controller.governor.governor import SpeedGovernor
from controller.governor.loop import Commands, GovernorLoop
from hal.api import Chassis
from hal.geometry import mount_of


def build_governor(config: AppConfig) -> SpeedGovernor:
    """A governor on its own, to be called with scenes and odometry."""
    return SpeedGovernor(
        config.governor or GovernorConfig(),
        config.decision,
        config.robot,
        mount_of(config.robot),
        1.0 / config.runner.control_rate_hz,
        config.perception.depth_noise,
    )


def build_governor_loop(config: AppConfig, chassis: Chassis, commands: Commands) -> GovernorLoop:
    """A governor's control loop. chassis: opened elsewhere. Raises ConfigError, PathError."""
    start = build_path(config).start
    response = ResponseMonitor(config.decision.chassis_delay_s, config.robot.limits.max_speed_mps)
    localiser = Localiser(start, mount_of(config.robot))
    return GovernorLoop(build_governor(config), commands, localiser, chassis, response)
