"""Composition of a replay: perception, decision and the settings of a video, for a recording.

The recording itself is opened by open_replay in controller/build.py, which names the concrete devices.
"""

from __future__ import annotations

from collections.abc import Callable

from config.app import ReplayConfig
from controller.build import REPLAY_FPS, limit_vision_threads
from controller.decision.decide import DecisionMaker
from controller.perceive import Perceiver
from controller.record.recorder import VideoSettings
from hal.api import OdometrySource
from hal.types import CameraMount, PlanarPose
from vision.perception import Perception

_LEAST_FPS = 0.5
_ORIGIN = PlanarPose(0.0, 0.0, 0.0)


def build_replay_perceiver(
    config: ReplayConfig,
    mount: CameraMount | None,
    odometry: OdometrySource | None,
    stopwatch_ns: Callable[[], int],
) -> Perceiver:
    """Perception for a recording; the robot is at the origin in every frame."""
    limit_vision_threads()
    body = config.robot.body
    perception = Perception(
        config.perception, mount, body.height_m, body.clearance_m, config.camera.own_parts
    )
    return Perceiver(perception, odometry, lambda _stamp_ns: _ORIGIN, stopwatch_ns)


def build_replay_decision(
    config: ReplayConfig, mount: CameraMount | None, fps: float | None
) -> DecisionMaker:
    """The decision for each frame; an unknown mounting is assumed to be level, at the robot's front.

    fps: of the recording; None if not known.
    """
    front_m = config.robot.body.front_m
    level = CameraMount(front_m, 0.0, config.robot.camera_mount.height_m, 0.0)
    noise = config.perception.depth_noise
    return DecisionMaker(config.decision, config.robot, mount or level, 1.0 / _replay_fps(fps), noise)


def _replay_fps(fps: float | None) -> float:
    return REPLAY_FPS if fps is None else max(fps, _LEAST_FPS)


def replay_video_settings(
    config: ReplayConfig, mount: CameraMount | None, fps: float | None
) -> VideoSettings:
    """What a replay's video shows around the observations. fps: of the recording; None if not known."""
    return VideoSettings(
        mount=mount,
        body=config.robot.body if mount is not None else None,
        corridor_half_width_m=config.robot.body.width_m / 2.0 + config.decision.margins.lateral_m,
        # Two decimal places: video containers count time in whole fractions of a second.
        fps=round(_replay_fps(fps), 2),
        top_speed_mps=config.robot.limits.max_speed_mps,
        range_m=config.perception.max_depth_m,
        own_parts=config.camera.own_parts,
    )
