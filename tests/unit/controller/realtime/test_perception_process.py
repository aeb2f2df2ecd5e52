import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.perceive import Perceiver
from controller.realtime.channel import Channel, PeerGone, channel_sockets
from controller.realtime.messages import Farewell, StepMessage
from controller.realtime.perception_process import RemoteBody, perceive_forever
from controller.record.recorder import RecordingOptions
from hal.types import CameraMount, PlanarPose
from tests.support.runner_doubles import control_step
from tests.support.scenes import chassis_state

MS = 1_000_000
MOUNT = CameraMount(0.45, 0.0, 0.6, 0.0)
START = PlanarPose(2.0, 3.0, math.pi / 2)


@pytest.fixture
def ends() -> Iterator[tuple[RemoteBody, Channel]]:
    here, there = channel_sockets()
    with here, there:
        yield RemoteBody(Channel(here), MOUNT, START), Channel(there)


def step_at(now_ms: int, x_m: float, v_mps: float, true_pose: PlanarPose | None = None) -> StepMessage:
    """The robot at x_m on the path as it believes, 10 m further by its odometry."""
    state = chassis_state(now_ms * MS, v_mps=v_mps, pose=PlanarPose(x_m + 10.0, 0.0, 0.0))
    step = control_step(now_ms * MS, None)
    return StepMessage(dataclasses.replace(step, pose=PlanarPose(x_m, 0.0, 0.0), chassis=state), true_pose)


def test_before_the_first_step_nothing_is_known(ends: tuple[RemoteBody, Channel]) -> None:
    body, _ = ends
    assert body.body_pose(0) is None
    assert body.camera_pose(0) is None


def test_between_two_steps_the_pose_is_interpolated(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    control.send(step_at(0, 1.0, 1.0))
    control.send(step_at(20, 1.02, 1.0))
    pose = body.body_pose(10 * MS)
    assert pose is not None
    assert pose.x_m == pytest.approx(1.01)


def test_after_the_newest_step_it_is_carried_on_with_the_twist(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    control.send(step_at(0, 1.0, 1.5))
    pose = body.body_pose(100 * MS)
    assert pose is not None
    assert pose.x_m == pytest.approx(1.15)
    camera = body.camera_pose(100 * MS)
    assert camera is not None
    assert camera.translation_m == pytest.approx([11.0 + 0.15 + 0.45, 0.0, 0.6])


def test_a_simulated_camera_sees_from_where_the_world_has_the_robot(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    assert body.true_pose(0) is None
    control.send(step_at(0, 1.0, 1.5, PlanarPose(7.0, 8.0, 0.0)))
    control.send(step_at(20, 1.02, 1.5, PlanarPose(7.0, 8.2, 0.0)))
    between, after = body.true_pose(10 * MS), body.true_pose(120 * MS)
    assert between is not None
    assert (between.x_m, between.y_m) == pytest.approx((7.0, 8.1))
    assert after is not None
    assert (after.x_m, after.y_m) == pytest.approx((7.15, 8.2))


def test_or_from_where_a_base_outside_of_this_program_reports_to_be(
    ends: tuple[RemoteBody, Channel],
) -> None:
    """By its odometry, which begins anywhere, from where the path begins; not from where it is believed."""
    body, control = ends
    control.send(step_at(0, math.nan, 1.0))
    control.send(step_at(10, 1.0, 1.0))
    control.send(step_at(20, 1.5, 1.0))
    pose = body.true_pose(20 * MS)
    assert pose is not None
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((2.0, 3.5, math.pi / 2))


def test_odometry_counts_at_the_stamp_of_the_base(
    ends: tuple[RemoteBody, Channel],
) -> None:
    """A slow step asks it long after it has begun."""
    body, control = ends
    for now_ms, x_m in ((0, 1.0), (20, 1.04)):
        message = step_at(now_ms, x_m, 1.0)
        chassis = dataclasses.replace(message.control.chassis, stamp_ns=(now_ms + 20) * MS)
        control.send(
            dataclasses.replace(message, control=dataclasses.replace(message.control, chassis=chassis))
        )
    for at_ms, x_m in ((30, 1.02), (50, 1.05)):
        camera, true = body.camera_pose(at_ms * MS), body.true_pose(at_ms * MS)
        assert camera is not None
        assert true is not None
        assert camera.translation_m[0] == pytest.approx(10.0 + x_m + MOUNT.forward_m)
        assert true.y_m == pytest.approx(START.y_m + x_m - 1.0)


def test_pose_is_unknown_without_odometry_of_the_base(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    for now_ms in range(0, 100, 20):
        control.send(step_at(now_ms, 1.0 if now_ms < 40 else math.nan, 0.0))
    assert body.body_pose(15 * MS) == PlanarPose(1.0, 0.0, 0.0)
    for stamp_ms in (30, 80, 90):
        assert body.body_pose(stamp_ms * MS) is None
        assert body.camera_pose(stamp_ms * MS) is None


def test_pose_is_not_extrapolated_for_ever(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    control.send(step_at(0, 1.0, 1.5))
    assert body.body_pose(251 * MS) is None
    assert body.camera_pose(251 * MS) is None


def test_a_twist_that_is_not_known_is_not_taken_as_standing(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    control.send(step_at(0, 1.0, math.nan))
    assert body.body_pose(10 * MS) is None


def test_every_step_is_handed_on_once(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    control.send(step_at(0, 1.0, 1.0))
    control.send(step_at(20, 1.0, 1.0))
    assert [step.now_ns // MS for step in body.take_steps()] == [0, 20]
    assert body.take_steps() == []


def test_a_control_process_that_is_gone_is_noticed(ends: tuple[RemoteBody, Channel]) -> None:
    body, control = ends
    control.close()
    with pytest.raises(PeerGone):
        body.listen()


def test_a_recording_that_cannot_be_written_is_told_to_the_control_process(tmp_path: Path) -> None:
    config_path = CONFIG_DIR / "sim-realtime.yaml"
    here, there = channel_sockets()
    with here, there:
        recording = RecordingOptions(observations=tmp_path / "none" / "out.jsonl")
        perceive_forever(load_app(config_path), there, 0, recording)
        told = Channel(here).receive()
    assert isinstance(told, Farewell)
    assert "observations cannot be written there" in told.reason


def test_unforeseen_error_is_told_to_the_control_process_and_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def look(*_: object) -> None:
        raise cv2.error("OpenCV(4.12.0)\n imgproc: (-215) !empty()\n")

    monkeypatch.setattr(Perceiver, "look", look)
    config_path = CONFIG_DIR / "sim-realtime.yaml"
    here, there = channel_sockets()
    with here, there:
        Channel(here).send(step_at(0, 0.0, 0.0, PlanarPose(0.0, 0.0, 0.0)))
        with pytest.raises(cv2.error):
            perceive_forever(load_app(config_path), there, 0, RecordingOptions())
        told = Channel(here).receive()
    assert told == Farewell("perception failed: error: OpenCV(4.12.0) imgproc: (-215) !empty()")
