"""`treadwatch replay`: run perception and decision on a recording, and print a summary."""

from __future__ import annotations

import math
import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path as FilePath

import numpy as np

from config.app import ReplayConfig, load_replay
from config.camera import OdometryChoice
from config.loader import ConfigError
from controller.base.ego_speed import EgoSpeed
from controller.build import open_replay, straight_ahead
from controller.decision.decide import DecisionMaker
from controller.decision.decision import Decision
from controller.decision.situation import Situation
from controller.errors import UserError
from controller.own_parts import require_own_parts_in_view
from controller.path.path import STRAIGHT_AHEAD_M, OnPath, Path
from controller.perceive import Look
from controller.record.observations import STANDARD_OUTPUT
from controller.record.recorder import RecordingOptions, open_recorder, require_two_files
from controller.record.tally import ConditionTally, ObstacleTally, TimingTally
from controller.replay.build import build_replay_decision, build_replay_perceiver, replay_video_settings
from controller.terminal.console import Console
from hal.cameras.bag_topics import WantedTopics
from hal.cameras.gyro_track import GyroTrack
from hal.cameras.pose_track import PoseTrack
from hal.cameras.recording import frames_of
from hal.clocks import NS_PER_S
from hal.geometry import mount_of
from hal.types import CameraMount, Intrinsics, PlanarPose

# The robot is at the origin in every frame: there is one decision a frame, at the time of that frame.
_STANDING = PlanarPose(0.0, 0.0, 0.0)
# Outputs of an earlier replay in the recording's folder, which may be overwritten.
_OUTPUTS = frozenset({".jsonl", ".json", ".webm", ".mp4", ".avi"})


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """The command line of `treadwatch replay`."""

    recording: FilePath
    odometry: OdometryChoice
    config_path: FilePath
    observations: FilePath | None = None
    video: FilePath | None = None
    quiet: bool = False
    topics: WantedTopics = field(default_factory=WantedTopics)
    use_gyro: bool = True


@dataclass
class ReplayTally:
    """What is counted in a replay. without_pose: frames for which there is no odometry."""

    timing: TimingTally = field(default_factory=TimingTally)
    frames: int = 0
    without_pose: int = 0
    first_ns: int = 0
    last_ns: int = 0
    seen: ObstacleTally = field(default_factory=ObstacleTally)
    camera: ConditionTally = field(default_factory=ConditionTally)
    actions: Counter[str] = field(default_factory=Counter)

    def take(self, look: Look, decision: Decision) -> None:
        """Account for one frame."""
        self.timing.add(look.timing_ms)
        self.first_ns = look.scene.captured_ns if self.frames == 0 else self.first_ns
        self.last_ns = look.scene.captured_ns
        self.frames += 1
        self.without_pose += look.camera_pose is None
        for obstacle in look.scene.obstacles:
            self.seen.add(obstacle.id, obstacle.moving, float(obstacle.position_m[2]))
        self.camera.add(look.scene.health)
        self.actions[decision.action.value] += 1


def run_replay(options: ReplayOptions) -> None:
    """Put every frame through detect, track and decide. Raises ConfigError, HalError, UserError."""
    config = load_replay(options.config_path)
    _refuse_overwriting(options)
    console = Console(options.quiet, aside=options.observations == STANDARD_OUTPUT)
    source, odometry = open_replay(options.recording, options.odometry, options.topics, options.use_gyro)
    mount = recorded_mount(config, source.mount)
    _require_own_parts(options, config, mount, source.intrinsics)
    perceiver = build_replay_perceiver(config, mount, odometry, time.perf_counter_ns)
    decide = build_replay_decision(config, mount, source.fps)
    path = straight_ahead(config.robot)
    speed = EgoSpeed(mount)
    tally = ReplayTally()
    recording = RecordingOptions(options.observations, options.video)
    with ExitStack() as devices:
        devices.enter_context(source)
        recorder = devices.enter_context(
            open_recorder(recording, replay_video_settings(config, mount, source.fps))
        )
        for frame in frames_of(source):
            look = perceiver.look(frame)
            v_mps = speed.step(look.scene.ego_motion)
            decision = _decide(decide, path, look, v_mps)
            tally.take(look, decision)
            recorder.record(look, decision, measured_mps=v_mps, path_ahead_m=STRAIGHT_AHEAD_M)
            console.progress(tally.frames / source.frame_count, f"frame {tally.frames}/{source.frame_count}")
            console.decision((tally.last_ns - tally.first_ns) / NS_PER_S, decision, v_mps)
    prior = _prior(odometry, source.gyro, tally)
    skipped = [str(skip) for skip in source.skipped]
    notes = (*source.notes, *_mount_notes(options, config, source.mount))
    console.summary(_summary(options, tally, prior, skipped, notes))


def _prior(odometry: PoseTrack | None, gyro: GyroTrack | None, tally: ReplayTally) -> str:
    """What is known of the camera's motion besides the images, for the summary."""
    prior = "none: the camera's motion is estimated from images and depth alone"
    if odometry is not None:
        prior = f"{odometry.name}: {len(odometry)} poses" + _not_of_all(tally.without_pose, tally.frames)
    elif gyro is not None:
        prior = "none"
    if gyro is not None:
        prior += f"; {gyro.name}: {len(gyro)} readings of a gyro" + _not_of_all(gyro.missed, tally.frames)
    return prior


def _not_of_all(without: int, frames: int) -> str:
    return f"; of the time of {without} of {frames} frames there is none" if without else ""


def _refuse_overwriting(options: ReplayOptions) -> None:
    """Raise UserError if an output is the recording, a file of it, or the other output."""
    given = (options.observations, options.video)
    outputs = [path for path in given if path is not None and path != STANDARD_OUTPUT]
    require_two_files(options.observations, options.video)
    recording = os.path.realpath(options.recording)
    for path in outputs:
        real = os.path.realpath(path)
        inside = real.startswith(recording + os.sep) and path.suffix not in _OUTPUTS
        if os.path.exists(real) and (real == recording or inside):
            raise UserError(f"{path}: is part of the recording; name another file for the output")


def recorded_mount(config: ReplayConfig, recorded: CameraMount | None) -> CameraMount | None:
    """The recording's own mounting; else the robot's if that may be assumed; else None."""
    if recorded is not None or not config.assume_mount:
        return recorded
    return mount_of(config.robot)


def _require_own_parts(
    options: ReplayOptions, config: ReplayConfig, mount: CameraMount | None, camera: Intrinsics
) -> None:
    """Raise ConfigError if the own parts cannot be cut out of the images of this recording."""
    parts = config.camera.own_parts
    if not parts:
        return
    if mount is None:
        raise ConfigError(
            f"{options.config_path}: camera.own_parts needs the camera's mounting, to know where it sees "
            "them; set assume_mount: true, or give the recording's camera_height_m"
        )
    require_own_parts_in_view(options.config_path, parts, mount, camera)


def _decide(decide: DecisionMaker, path: Path, look: Look, v_mps: float) -> Decision:
    """The decision for a robot at the start of a straight path that drives v_mps."""
    on_path = OnPath(0.0, 0.0, 0.0)
    return decide.step(Situation(look.scene, path, _STANDING, on_path, v_mps, 0.0, look.scene.captured_ns))


def _counts(tally: ReplayTally) -> str:
    return ", ".join(f"{count} {action}" for action, count in sorted(tally.actions.items()))


def _mount_notes(options: ReplayOptions, config: ReplayConfig, recorded: CameraMount | None) -> Iterator[str]:
    """Notes on the mounting, where the recording has none, or another one than the configuration."""
    given = config.robot.camera_mount
    if recorded is None:
        yield _assumed(options, config)
        return
    if "camera_mount" not in config.robot.model_fields_set:
        return
    if not np.allclose(
        (recorded.height_m, recorded.pitch_rad), (given.height_m, given.pitch_rad), atol=0.002
    ):
        yield (
            f"the camera is where the recording says, {recorded.height_m:.2f} m high and tipped by "
            f"{math.degrees(recorded.pitch_rad):.1f} degrees, not where {options.config_path} does: "
            f"{given.height_m:.2f} m, {math.degrees(given.pitch_rad):.1f} degrees"
        )


def _assumed(options: ReplayOptions, config: ReplayConfig) -> str:
    if not config.assume_mount:
        return "the recording does not give the camera's mounting: the floor is found in the depth"
    given = config.robot.camera_mount
    return (
        f"the recording does not give the camera's mounting: it is that of {options.config_path}, "
        f"{given.height_m:.2f} m high and tipped by {math.degrees(given.pitch_rad):.1f} degrees"
    )


def _summary(
    options: ReplayOptions, tally: ReplayTally, odometry: str, skipped: list[str], notes: tuple[str, ...]
) -> list[tuple[str, str]]:
    duration_s = (tally.last_ns - tally.first_ns) / NS_PER_S
    rows = [
        (
            "recording",
            f"{options.recording}: {tally.frames} frames, {duration_s:.2f} s; {len(skipped)} skipped",
        ),
        ("odometry", odometry),
        ("obstacles", tally.seen.line()),
        ("decisions", f"{_counts(tally)}; for a robot that drives straight ahead"),
        ("camera", tally.camera.line()),
        ("perception", tally.timing.line()),
    ]
    rows.extend(("skipped", text) for text in skipped)
    rows.extend(("note", text) for text in notes)
    return rows
