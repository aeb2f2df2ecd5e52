"""The perception process of the real-time runner: camera, detect, track, recording.

It sends scenes to the control process (controller/realtime/runner.py) and gets its control steps.
"""

from __future__ import annotations

import math
import socket
import time
from contextlib import suppress
from functools import partial

from config.app import AppConfig, RealtimeRunner
from controller.base.localise import PoseHistory
from controller.build import build_path, build_perceiver, open_camera, video_settings
from controller.control import ControlStep
from controller.errors import UserError, describe
from controller.realtime.channel import Channel, PeerGone
from controller.realtime.messages import STREAM_ENDED, CutOff, Farewell, SceneMessage, StepMessage
from controller.record.recorder import RecordingOptions, RunRecorder, open_recorder
from controller.terminal.outlet import say
from hal.clocks import NS_PER_S, MonotonicClock
from hal.errors import EndOfStream, FrameTimeout, HalError
from hal.geometry import advance_pose, body_in_floor, camera_in_floor, mount_of, planar
from hal.types import CameraMount, PlanarPose, Pose

# A pose after the newest control step is extrapolated with the last twist for at most this long.
REACH_S = 0.25


class RemoteBody:
    """The robot's motion by the messages of the control process (hal.api.OdometrySource).

    start: the robot's first pose in the path's frame.
    """

    def __init__(self, channel: Channel, mount: CameraMount, start: PlanarPose) -> None:
        self._channel = channel
        self._mount = mount
        self._start = body_in_floor(start)
        self._from_odometry: Pose | None = None
        self._true = PoseHistory(reach_s=0.0)
        self._newest_true, self._newest_true_ns = start, 0
        self._fused = PoseHistory(reach_s=0.0)
        self._odometry = PoseHistory(reach_s=0.0)
        self._newest: ControlStep | None = None
        self._unread: list[ControlStep] = []

    def listen(self) -> None:
        """Take in every control step that has arrived. Raises PeerGone."""
        while (message := self._channel.receive()) is not None:
            assert isinstance(message, StepMessage), f"control sent {type(message).__name__}"
            step = self._newest = message.control
            self._unread.append(step)
            self._fused.append(step.now_ns, step.pose)
            # The base is asked later than the step begins: by as much as the step has taken.
            self._odometry.append(step.chassis.stamp_ns, step.chassis.pose)
            true_pose, true_ns = message.true_pose, step.now_ns
            if true_pose is None:
                true_pose, true_ns = self._by_odometry(step.chassis.pose), step.chassis.stamp_ns
            if true_pose is not None:
                self._newest_true, self._newest_true_ns = true_pose, true_ns
                self._true.append(true_ns, true_pose)

    def take_steps(self) -> list[ControlStep]:
        """The control steps that have arrived since the last call."""
        self.listen()
        steps, self._unread = self._unread, []
        return steps

    def body_pose(self, stamp_ns: int) -> PlanarPose | None:
        """The robot's estimated pose in the path's frame; None if it is not known."""
        self.listen()
        known = self._fused.at(stamp_ns)
        if known is None and self._newest is not None:
            return self._carried_on(self._newest.pose, self._newest.now_ns, stamp_ns)
        return known

    def true_pose(self, stamp_ns: int) -> PlanarPose | None:
        """The robot's true pose in the path's frame, for a simulated camera; None if it is not known.

        It comes from the simulated world or, with a base outside this program, from the base's odometry. It
        is never the robot's own estimate, because that depends on what the camera sees.
        """
        self.listen()
        known = self._true.at(stamp_ns)
        if known is None and self._newest is not None:
            return self._carried_on(self._newest_true, self._newest_true_ns, stamp_ns)
        return known

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """The camera's pose by the chassis' dead reckoning; None if it is not known."""
        self.listen()
        known = self._odometry.at(stamp_ns)
        if known is None and self._newest is not None:
            state = self._newest.chassis
            known = self._carried_on(state.pose, state.stamp_ns, stamp_ns)
        return None if known is None else camera_in_floor(known, self._mount)

    def _by_odometry(self, odometry: PlanarPose) -> PlanarPose | None:
        """Odometry to the path's frame; its first pose is at the start. None while the base reports none."""
        if not odometry.finite:
            return None
        if self._from_odometry is None:
            self._from_odometry = self._start @ body_in_floor(odometry).inverse()
        return planar(self._from_odometry @ body_in_floor(odometry))

    def _carried_on(self, pose: PlanarPose, from_ns: int, stamp_ns: int) -> PlanarPose | None:
        """pose at from_ns, extrapolated to stamp_ns by the newest twist; None if too far or unknown."""
        assert self._newest is not None
        ahead_ns = stamp_ns - from_ns
        state = self._newest.chassis
        twist_known = math.isfinite(state.v_mps + state.w_radps)
        if not 0 <= ahead_ns <= REACH_S * NS_PER_S or not (twist_known and pose.finite):
            return None
        return advance_pose(pose, state.v_mps, state.w_radps, ahead_ns / NS_PER_S)


def perceive_forever(
    config: AppConfig, end: socket.socket, start_ns: int, recording: RecordingOptions
) -> None:
    """Entry point of the process. Returns when the camera ends or the control process is gone.

    An unforeseen error is told to the control process, and raised.
    start_ns: time zero of a simulated world.
    """
    channel = Channel(end)
    try:
        _look_until_the_end(config, channel, start_ns, recording)
    except PeerGone:
        return
    except EndOfStream:
        _say_farewell(channel, STREAM_ENDED)
    except HalError as error:
        _say_farewell(channel, f"camera: {error}")
    except UserError as error:
        # An output cannot be opened. The control process reports this as the reason of the stop.
        _say_farewell(channel, str(error))
    except Exception as error:
        # Without a farewell the stop would have no reason but that this process is gone.
        _say_farewell(channel, f"perception failed: {describe(error)}")
        raise


def _look_until_the_end(
    config: AppConfig, channel: Channel, start_ns: int, recording: RecordingOptions
) -> None:
    assert isinstance(config.runner, RealtimeRunner)
    timeout_s = config.runner.frame_timeout_s
    path = build_path(config)
    body = RemoteBody(channel, mount_of(config.robot), path.start)
    with (
        open_camera(config, MonotonicClock(), body.true_pose, start_ns) as camera,
        open_recorder(recording, video_settings(config), partial(_say_cut_off, channel)) as recorder,
    ):
        perceiver = build_perceiver(config, body, body.body_pose, time.perf_counter_ns)
        run_recorder = RunRecorder(recorder, path)
        try:
            while True:
                # Without a frame the newest scene ages and the robot stops; the camera may come back.
                with suppress(FrameTimeout):
                    look = perceiver.look(camera.read(timeout_s))
                    channel.send(SceneMessage(look.scene, look.timing_ms))
                    run_recorder.add_look(look)
                for step in body.take_steps():
                    run_recorder.add_step(step)
        except (PeerGone, EndOfStream):
            run_recorder.finish()
            raise


def _say_farewell(channel: Channel, reason: str) -> None:
    try:
        channel.send(Farewell(reason))
    except PeerGone:
        return


def _say_cut_off(channel: Channel, reason: str) -> None:
    """The control process tells the user; where it cannot, this one does."""
    with suppress(PeerGone):
        if channel.send(CutOff(reason)):
            return
    say(f"treadwatch: {reason}", to_stderr=True)
