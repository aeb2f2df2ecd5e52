"""What every FrameSource promises, asked of each: recordings, the simulated camera, a RealSense.

A new camera is not done before it stands here.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from config.camera import (
    RealsenseCameraConfig,
    SimulatedCameraConfig,
)
from config.path import LineSpec, PathSpec
from config.scenario import Scenario
from hal.api import Clock, FrameSource
from hal.cameras.bag_replay import BagReplay
from hal.cameras.paced_recording import PacedRecording
from hal.cameras.realsense import RealsenseCamera
from hal.cameras.tum_replay import TumReplay
from hal.clocks import SimulatedClock
from hal.errors import DeviceRefused, EndOfStream, FrameTimeout
from hal.types import CameraMount, Intrinsics, PlanarPose, RgbdFrame
from sim.rendering.camera import SimulatedCamera
from sim.world import World
from tests.support.bags import small_bag
from tests.support.fake_realsense import FakeRealsense
from tests.support.fake_realsense_frames import framesets
from tests.support.recordings import DESK_RPY, write_recording

FRAMES = 5
LONG_S, SHORT_S = 1.0, 0.001


@dataclass(frozen=True, slots=True)
class Case:
    """A source that has FRAMES frames to give or more, and the clock that they are due on."""

    source: FrameSource
    clock: Clock


def small_recording(folder: Path) -> Case:
    return Case(TumReplay(write_recording(folder, FRAMES)), SimulatedClock())


def small_recording_without_thread(folder: Path) -> Case:
    return Case(TumReplay(write_recording(folder, FRAMES), read_ahead=0), SimulatedClock())


def small_ros_bag(folder: Path) -> Case:
    return Case(BagReplay(small_bag(folder, count=FRAMES)), SimulatedClock())


def real_recording(folder: Path) -> Case:
    return Case(TumReplay(DESK_RPY), SimulatedClock())


def realsense(folder: Path) -> Case:
    clock = SimulatedClock()
    vendor = FakeRealsense(clock, list(framesets(0, FRAMES + 5)))
    return Case(RealsenseCamera(RealsenseCameraConfig(), clock, vendor), clock)


def paced_recording(folder: Path) -> Case:
    clock = SimulatedClock()
    return Case(PacedRecording(TumReplay(write_recording(folder, FRAMES + 5)), clock), clock)


def simulated(folder: Path) -> Case:
    clock = SimulatedClock()
    config = SimulatedCameraConfig(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
    mount = CameraMount(0.45, 0.0, 0.6, 0.07)
    source = SimulatedCamera(World(HALL), config, mount, clock, lambda stamp_ns: PlanarPose(0.0, 0.0, 0.0))
    return Case(source, clock)


HALL = Scenario(name="hall", path=PathSpec(segments=(LineSpec(kind="line", length_m=10.0),)))
LIVE = [
    realsense,
    simulated,
    paced_recording,
]
ENDING = [small_recording, small_recording_without_thread, small_ros_bag]
SOURCES = [*LIVE, *ENDING, real_recording]


def make(request: pytest.FixtureRequest, folder: Path) -> Case:
    made: Case = request.param(folder)
    return made


@pytest.fixture(params=SOURCES, ids=lambda source: source.__name__)
def case(request: pytest.FixtureRequest, tmp_path: Path) -> Case:
    return make(request, tmp_path)


@pytest.fixture(params=LIVE, ids=lambda source: source.__name__)
def live(request: pytest.FixtureRequest, tmp_path: Path) -> Case:
    """Is late when asked too early."""
    return make(request, tmp_path)


@pytest.fixture(params=ENDING, ids=lambda source: source.__name__)
def ending(request: pytest.FixtureRequest, tmp_path: Path) -> Case:
    """Has exactly FRAMES frames, all of the past."""
    return make(request, tmp_path)


def read_frames(case: Case) -> list[RgbdFrame]:
    return [case.source.read(LONG_S) for _ in range(FRAMES)]


def test_images_have_the_shapes_and_types_of_the_boundary(case: Case) -> None:
    with case.source:
        for frame in read_frames(case):
            size = (frame.intrinsics.height, frame.intrinsics.width)
            assert frame.colour.shape == (*size, 3)
            assert frame.colour.dtype == np.uint8
            assert frame.depth.shape == size
            assert frame.depth.dtype == np.uint16


def test_images_can_be_handed_to_opencv_and_written_to(case: Case) -> None:
    with case.source:
        frame = case.source.read(LONG_S)
        for image in (frame.colour, frame.depth):
            assert image.flags.c_contiguous
            assert image.flags.writeable


def test_frames_do_not_share_memory(case: Case) -> None:
    with case.source:
        frames = read_frames(case)
    for a, b in pairwise(frames):
        assert not np.shares_memory(a.colour, b.colour)
        assert not np.shares_memory(a.depth, b.depth)


def test_every_frame_has_the_intrinsics_of_the_source(case: Case) -> None:
    with case.source:
        assert isinstance(case.source.intrinsics, Intrinsics)
        assert all(frame.intrinsics == case.source.intrinsics for frame in read_frames(case))
        assert all(value > 0 for value in dataclasses.astuple(case.source.intrinsics))


def test_sequence_and_capture_time_increase(case: Case) -> None:
    with case.source:
        frames = read_frames(case)
    assert all(b.sequence > a.sequence for a, b in pairwise(frames))
    assert all(b.captured_ns > a.captured_ns for a, b in pairwise(frames))
    assert all(isinstance(frame.captured_ns, int) for frame in frames)


def test_the_device_time_runs_as_the_capture_time(case: Case) -> None:
    with case.source:
        frames = read_frames(case)
    for a, b in pairwise(frames):
        assert b.device_s - a.device_s == pytest.approx(1e-9 * (b.captured_ns - a.captured_ns), abs=1e-3)


def test_the_depth_scale_is_that_of_a_uint16_in_metres(case: Case) -> None:
    with case.source:
        frame = case.source.read(LONG_S)
    assert 1e-5 < frame.depth_scale_m < 0.01
    assert frame.depth.any()


def test_a_frame_of_the_future_is_never_given(live: Case) -> None:
    with live.source:
        for frame in read_frames(live):
            assert frame.captured_ns <= live.clock.now_ns()


def test_too_early_is_a_timeout_after_the_time_given_and_loses_no_frame(live: Case) -> None:
    with live.source:
        first = live.source.read(LONG_S)
        before_ns = live.clock.now_ns()
        with pytest.raises(FrameTimeout):
            live.source.read(SHORT_S)
        assert live.clock.now_ns() - before_ns == round(SHORT_S * 1e9)
        assert live.source.read(LONG_S).sequence == first.sequence + 1


def test_slow_reader_gets_the_newest_frame_and_no_queue(live: Case) -> None:
    with live.source:
        frames = [live.source.read(LONG_S) for _ in range(2)]
        delay_ns = live.clock.now_ns() - frames[1].captured_ns
        period_ns = frames[1].captured_ns - frames[0].captured_ns
        live.clock.sleep_until_ns(live.clock.now_ns() + 7 * period_ns // 2)
        late = live.source.read(LONG_S)
        assert live.clock.now_ns() - late.captured_ns <= delay_ns + period_ns
        assert late.sequence >= frames[1].sequence + 3, "the gap shows what was left out"


def test_closed_source_refuses_reads_until_it_is_opened_again(case: Case) -> None:
    with case.source:
        case.source.read(LONG_S)
    with pytest.raises(DeviceRefused):
        case.source.read(LONG_S)


def test_a_recording_gives_its_frames_whatever_the_timeout_and_then_ends(ending: Case) -> None:
    with ending.source:
        for _ in range(FRAMES):
            ending.source.read(0.0)
        for _ in range(2):
            with pytest.raises(EndOfStream):
                ending.source.read(LONG_S)


def test_leaving_twice_is_safe_and_an_error_inside_is_not_swallowed(case: Case) -> None:
    with pytest.raises(ZeroDivisionError), case.source:
        raise ZeroDivisionError
    case.source.__exit__(None, None, None)
    case.source.__exit__(None, None, None)
