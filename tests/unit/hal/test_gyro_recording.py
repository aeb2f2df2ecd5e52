"""The gyro in a recording: written with the frames, read with them, and shifted with them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hal.cameras.gyro_file import GYRO_FILE
from hal.cameras.gyro_track import GyroTrack
from hal.cameras.paced_recording import PacedRecording
from hal.cameras.tum_replay import TumReplay
from hal.cameras.tum_writer import TumWriter
from hal.clocks import NS_PER_S, SimulatedClock
from hal.errors import BadRecording
from hal.types import GyroSamples, RgbdFrame
from tests.support.recordings import PERIOD_NS, START_NS, read_all, small_frame, write_recording

STEP_NS = PERIOD_NS // 5


def readings(first: int, end: int) -> GyroSamples:
    """Readings first to end - 1: five a frame, the rates tell which reading it is."""
    numbers = np.arange(first, end)
    rates = np.stack((numbers, -0.5 * numbers, numbers + 0.25), axis=1)
    return GyroSamples(START_NS + STEP_NS * numbers, rates)


def with_gyro(number: int) -> RgbdFrame:
    """Frame number, with the readings that arrive after those of the frame before, two of them late."""
    first = -3 if number == 0 else 5 * number - 2
    return dataclasses.replace(small_frame(number), gyro=readings(first, 5 * number + 3))


def recording(folder: Path, count: int = 3) -> Path:
    with TumWriter(folder) as writer:
        for number in range(count):
            writer.write(with_gyro(number))
    return folder


def numbers_of(frame: RgbdFrame) -> list[float]:
    assert frame.gyro is not None
    return [float(rate) for rate in frame.gyro.rates_radps[:, 0]]


def test_what_is_recorded_comes_back_with_the_frame_that_needs_it(tmp_path: Path) -> None:
    replay = TumReplay(recording(tmp_path))
    assert replay.gyro is not None
    assert (replay.gyro.name, len(replay.gyro)) == ("gyro.txt", 16)
    for _ in range(2):  # entering again starts from the beginning
        frames = read_all(replay)
        # Up to the first reading after the exposure.
        assert [numbers_of(frame) for frame in frames] == [
            [-3, -2, -1, 0, 1],
            [2, 3, 4, 5, 6],
            [7, 8, 9, 10, 11],
        ]
    gyro = frames[1].gyro
    assert gyro is not None
    np.testing.assert_array_equal(gyro.stamps_ns, readings(2, 7).stamps_ns)
    np.testing.assert_array_equal(gyro.rates_radps, readings(2, 7).rates_radps)


def test_readings_of_a_frame_that_is_left_out_come_with_the_next_one(tmp_path: Path) -> None:
    replay = TumReplay(recording(tmp_path), read_ahead=0)
    with replay:
        replay.skip_until(START_NS + PERIOD_NS)
        assert numbers_of(replay.read(0.0)) == list(range(-3, 7))


def test_a_recording_without_gyro_and_one_whose_gyro_is_not_wanted_give_none(tmp_path: Path) -> None:
    without = TumReplay(write_recording(tmp_path / "without"))
    assert not (tmp_path / "without" / GYRO_FILE).exists()
    unwanted = TumReplay(recording(tmp_path / "with"), use_gyro=False)
    for replay in (without, unwanted):
        assert replay.gyro is None
        assert all(frame.gyro is None for frame in read_all(replay))


def test_readings_that_come_without_a_frame_are_kept(tmp_path: Path) -> None:
    with TumWriter(tmp_path) as writer:
        writer.write(with_gyro(0))
        writer.write_gyro(readings(3, 8))
        writer.write(with_gyro(2))
    frames = read_all(TumReplay(tmp_path))
    assert [numbers_of(frame) for frame in frames] == [[-3, -2, -1, 0, 1], list(range(2, 12))]


def test_readings_that_are_not_finite_are_not_written(tmp_path: Path) -> None:
    odd = readings(0, 2)
    odd.rates_radps[1, 2] = np.nan
    with TumWriter(tmp_path) as writer:
        writer.write(dataclasses.replace(small_frame(0), gyro=odd))
        writer.write_gyro(GyroSamples(odd.stamps_ns[1:], odd.rates_radps[1:]))
    assert len((tmp_path / GYRO_FILE).read_text().splitlines()) == 2  # the heading and one reading


def test_a_line_that_cannot_be_used_is_named_and_left_out(tmp_path: Path) -> None:
    recording(tmp_path)
    lines = (tmp_path / GYRO_FILE).read_text().splitlines()
    spoiled = ["1.0 0.1 0.2", "noon 0 0 0", "1.0 0.1 x 0.3", "1.0 inf 0 0", *lines[2:], lines[-1][:14]]
    (tmp_path / GYRO_FILE).write_text("\n".join(spoiled))
    replay = TumReplay(tmp_path)
    assert replay.gyro is not None
    assert len(replay.gyro) == 15
    reasons = [str(skip) for skip in replay.skipped]
    for reason, (line, why) in zip(
        reasons,
        [
            (1, "has 3 columns"),
            (2, "'noon' is not a time"),
            (3, "is not a number"),
            (4, "is not finite"),
            (20, "has 2 columns"),
        ],
        strict=True,
    ):
        assert reason.startswith(f"gyro.txt:{line}: ")
        assert why in reason


def test_a_file_without_a_usable_line_is_no_gyro(tmp_path: Path) -> None:
    recording(tmp_path)
    (tmp_path / GYRO_FILE).write_text("# nothing\n")
    assert TumReplay(tmp_path).gyro is None


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording(tmp_path)
    whole = Path.read_text

    def unreadable(path: Path, *args: str, **given: str) -> str:
        if path.name == GYRO_FILE:
            raise PermissionError(13, "Permission denied")
        return whole(path, *args, **given)

    monkeypatch.setattr(Path, "read_text", unreadable)
    with pytest.raises(BadRecording, match=r"gyro\.txt: cannot be read \(Permission denied\)"):
        TumReplay(tmp_path)


def test_frames_that_the_gyro_does_not_cover_are_counted() -> None:
    track = GyroTrack("gyro", np.array([0, 1_000_000_000]), np.zeros((2, 3)))
    for at_ns, missed in ((24_000_000, 0), (26_000_000, 1), (974_000_000, 2), (976_000_000, 2)):
        track.attach(dataclasses.replace(small_frame(0), captured_ns=at_ns))
        assert track.missed == missed
    track.rewind()
    assert track.missed == 0


def test_readings_out_of_order_are_sorted_and_of_one_time_the_first_counts() -> None:
    stamps_ns = np.array([30, 10, 20, 10])
    rates = np.arange(12.0).reshape(4, 3)
    track = GyroTrack("gyro", stamps_ns, rates)
    gyro = track.attach(dataclasses.replace(small_frame(0), captured_ns=100)).gyro
    assert gyro is not None
    assert gyro.stamps_ns.tolist() == [10, 20, 30]
    np.testing.assert_array_equal(gyro.rates_radps, rates[[1, 2, 0]])


def test_a_recording_in_place_of_a_camera_shifts_the_gyro_as_its_frames(tmp_path: Path) -> None:
    clock = SimulatedClock()
    clock.sleep_until_ns(7 * NS_PER_S)
    with PacedRecording(TumReplay(recording(tmp_path)), clock) as camera:
        for number in range(2):
            frame = camera.read(1.0)
            assert frame.captured_ns == 7 * NS_PER_S + number * PERIOD_NS
            assert frame.gyro is not None
            at = (frame.gyro.stamps_ns - frame.captured_ns) / STEP_NS
            np.testing.assert_allclose(at, frame.gyro.rates_radps[:, 0] - 5 * number, atol=1e-6)
