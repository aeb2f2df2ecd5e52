"""A recording in place of a camera: its frames at their times, on the clock of the run."""

from __future__ import annotations

from pathlib import Path

import pytest

from hal.cameras.bag_replay import BagReplay
from hal.cameras.paced_recording import PacedRecording
from hal.cameras.recording import Recording
from hal.cameras.tum_replay import TumReplay
from hal.clocks import NS_PER_S, SimulatedClock
from hal.errors import EndOfStream, FrameTimeout
from tests.support.bags import small_bag
from tests.support.recordings import PERIOD_NS, write_recording


@pytest.fixture
def clock() -> SimulatedClock:
    clock = SimulatedClock()
    clock.sleep_until_ns(500 * NS_PER_S)
    return clock


@pytest.fixture
def camera(tmp_path: Path, clock: SimulatedClock) -> PacedRecording:
    return PacedRecording(TumReplay(write_recording(tmp_path, 3)), clock)


def test_frames_come_at_their_pace_and_bear_the_time_of_this_clock(
    camera: PacedRecording, clock: SimulatedClock
) -> None:
    with camera:
        times = []
        for _ in range(3):
            frame = camera.read(1.0)
            assert frame.captured_ns == clock.now_ns()
            times.append(frame.captured_ns)
        with pytest.raises(EndOfStream):
            camera.read(1.0)
    assert times == [500 * NS_PER_S + number * PERIOD_NS for number in range(3)]


def test_late_reader_gets_the_frame_with_its_capture_time(
    camera: PacedRecording, clock: SimulatedClock
) -> None:
    with camera:
        first = camera.read(1.0)
        clock.sleep_until_ns(first.captured_ns + PERIOD_NS + 1)
        late = camera.read(1.0)
    assert late.captured_ns == first.captured_ns + PERIOD_NS


@pytest.mark.parametrize("kind", ["folder", "folder without reading ahead", "bag"])
def test_slow_reader_gets_the_newest_frame(kind: str, tmp_path: Path, clock: SimulatedClock) -> None:
    """Else every frame would be older than the one before, and the robot would stand for ever."""
    recording: Recording
    if kind == "bag":
        recording = BagReplay(small_bag(tmp_path, count=12))
    else:
        recording = TumReplay(write_recording(tmp_path, 12), read_ahead=2 if kind == "folder" else 0)
    with PacedRecording(recording, clock) as camera:
        seen = []
        for _ in range(5):
            frame = camera.read(1.0)
            assert clock.now_ns() - frame.captured_ns < PERIOD_NS
            seen.append(frame.sequence)
            clock.sleep_until_ns(clock.now_ns() + 13 * PERIOD_NS // 5)
        assert seen == [0, 2, 5, 7, 10]
        assert camera.read(1.0).sequence == 11
        with pytest.raises(EndOfStream):
            camera.read(1.0)


def test_a_timeout_loses_no_frame(camera: PacedRecording, clock: SimulatedClock) -> None:
    with camera:
        first = camera.read(1.0)
        with pytest.raises(FrameTimeout, match=r"no frame within 0.01 s"):
            camera.read(0.01)
        assert clock.now_ns() == first.captured_ns + 10_000_000
        assert camera.read(1.0).sequence == first.sequence + 1


def test_entering_again_plays_it_from_the_beginning(camera: PacedRecording, clock: SimulatedClock) -> None:
    for _ in range(2):
        with camera:
            assert camera.read(1.0).captured_ns == clock.now_ns()
            assert camera.read(1.0).sequence == 1
