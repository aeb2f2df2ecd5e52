"""The perception process of the real-time runner: camera, detect, track, and what is recorded of it."""

from __future__ import annotations

import signal
import socket
import time
from collections import deque
from pathlib import Path

from config.app import AppConfig
from controller.build import build_perceiver, limit_vision_threads, open_camera
from controller.channel import Channel, PeerGone
from controller.control import ControlStep
from controller.localise import PoseHistory
from controller.perceive import Look
from controller.realtime import Farewell, SceneMessage
from controller.recorder import RecordingOptions, open_recorder
from hal.clocks import NS_PER_S, MonotonicClock
from hal.errors import EndOfStream, FrameTimeout, HalError
from hal.geometry import advance_pose, camera_in_floor
from hal.types import CameraMount, PlanarPose, Pose

# Odometry is asked for between two control steps: carried on with its last twist for at most this long.
REACH_S = 0.25


class RemoteBody:
    """The robot's motion as the control process tells it (hal.api.OdometrySource)."""

    def __init__(self, channel: Channel, mount: CameraMount) -> None:
        self._channel = channel
        self._mount = mount
        self._fused = PoseHistory(reach_s=0.0)
        self._odometry = PoseHistory(reach_s=0.0)
        self._newest: ControlStep | None = None
        self.steps: deque[ControlStep] = deque(maxlen=200)

    def listen(self) -> None:
        """Take in every control step that has arrived. Raises PeerGone."""
        while (message := self._channel.receive()) is not None:
            assert isinstance(message, ControlStep), f"control sent {type(message).__name__}"
            self._newest = message
            self.steps.append(message)
            self._fused.append(message.now_ns, message.pose)
            self._odometry.append(message.now_ns, message.chassis.pose)

    def body_pose(self, stamp_ns: int) -> PlanarPose | None:
        """The body in the path's frame."""
        self.listen()
        known = self._fused.at(stamp_ns)
        return known if known is not None else self._carried_on(stamp_ns, odometry=False)

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """The camera by the chassis' dead reckoning."""
        self.listen()
        known = self._odometry.at(stamp_ns) or self._carried_on(stamp_ns, odometry=True)
        return None if known is None else camera_in_floor(known, self._mount)

    def _carried_on(self, stamp_ns: int, odometry: bool) -> PlanarPose | None:
        newest = self._newest
        if newest is None or not 0 <= stamp_ns - newest.now_ns <= REACH_S * NS_PER_S:
            return None
        state = newest.chassis
        pose = state.pose if odometry else newest.pose
        if state.v_mps != state.v_mps or state.w_radps != state.w_radps:
            return pose
        return advance_pose(pose, state.v_mps, state.w_radps, (stamp_ns - newest.now_ns) / NS_PER_S)


def perceive_forever(
    config: AppConfig, config_path: Path, end: socket.socket, recording: RecordingOptions
) -> None:
    """Entry point of the process. Ends when the camera ends or the control process has gone."""
    # Ctrl-C reaches the whole process group; only the control process may decide what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    limit_vision_threads()
    channel = Channel(end)
    try:
        _look_until_the_end(config, config_path, channel, recording)
    except PeerGone:
        return
    except EndOfStream:
        _say_farewell(channel, "the camera's stream has ended")
    except HalError as error:
        _say_farewell(channel, f"camera: {error}")


def _look_until_the_end(
    config: AppConfig, config_path: Path, channel: Channel, recording: RecordingOptions
) -> None:
    body = RemoteBody(channel, config.robot.camera_mount.to_mount())
    clock = MonotonicClock()
    start = config.path.start.to_pose() if config.path is not None else None
    del start
    with (
        open_camera(config, config_path, clock, body.body_pose) as camera,
        open_recorder(config, config_path, recording) as recorder,
    ):
        perceiver = build_perceiver(config, body, body.body_pose, time.perf_counter_ns)
        waiting: deque[Look] = deque()
        while True:
            try:
                frame = camera.read(config.runner.frame_timeout_s)  # type: ignore[union-attr]
            except FrameTimeout:
                body.listen()  # notices that the control process has gone
                continue
            look = perceiver.look(frame)
            channel.send(SceneMessage(look.scene, look.timing_ms))
            waiting.append(look)
            while body.steps and waiting:
                step = body.steps.popleft()
                del step
            recorder.flush()


def _say_farewell(channel: Channel, reason: str) -> None:
    try:
        channel.send(Farewell(reason))
    except PeerGone:
        return
