"""The gyro's samples between two exposures, as they come with frames that arrive later."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.types import GyroSamples
from tests.support.painted import FRAME_NS, MOUNT, QVGA, box, drive, floor, record, vector, wall
from vision.camera.gyro import GyroMemory
from vision.camera.lens import vector_from_rotation
from vision.detector import Detector
from vision.ego_motion import motion_memory
from vision.ego_motion.motion_prior import with_gyro

MS = 1_000_000
FRAME_MS = 33


def samples(times_ms: range, rate_radps: Callable[[float], float]) -> GyroSamples:
    """About x; rate_radps: of the time in seconds."""
    rates = [[rate_radps(t * 1e-3), 0.0, 0.0] for t in times_ms]
    return GyroSamples(np.array([t * MS for t in times_ms], np.int64), np.array(rates).reshape(-1, 3))


def shaking(t_s: float) -> float:
    """6 Hz, half a degree."""
    return math.radians(0.5) * 2.0 * math.pi * 6.0 * math.cos(2.0 * math.pi * 6.0 * t_s)


def shaken_rad(t_s: float) -> float:
    return math.radians(0.5) * math.sin(2.0 * math.pi * 6.0 * t_s)


def test_samples_that_came_with_the_frame_before_count() -> None:
    """Frame k was exposed at 33 k ms and arrives 30 ms later."""
    memory, told = GyroMemory(), []
    for k in range(1, 20):
        arrivals = range(5 * (((k - 1) * FRAME_MS + 30) // 5 + 1), k * FRAME_MS + 31, 5)
        memory.add(samples(arrivals, shaking))
        told.append(memory.turn_rad((k - 1) * FRAME_MS * MS, k * FRAME_MS * MS))
        memory.forget(k * FRAME_MS * MS)
    assert told[0] is None  # nothing is known from before the first samples
    for k, turn in enumerate(told[1:], start=2):
        assert turn is not None
        true_rad = shaken_rad(k * FRAME_MS * 1e-3) - shaken_rad((k - 1) * FRAME_MS * 1e-3)
        assert turn[0] == pytest.approx(true_rad, abs=0.02 * 0.033 / 10)
        np.testing.assert_array_equal(turn[1:], 0.0)


def test_gyro_samples_are_kept_over_skipped_frames() -> None:
    memory = GyroMemory()
    for begin_ms in range(0, 400, 100):
        memory.add(samples(range(begin_ms, begin_ms + 100, 5), lambda t_s: 0.5))
    turn = memory.turn_rad(0, 390 * MS)
    assert turn is not None
    assert turn[0] == pytest.approx(0.5 * 0.39)


def test_a_rate_that_changes_is_integrated_from_the_one_time_to_the_other() -> None:
    memory = GyroMemory()
    memory.add(samples(range(0, 100, 10), lambda t_s: 2.0 * t_s))
    turn = memory.turn_rad(23 * MS, 57 * MS)
    assert turn is not None
    assert turn[0] == pytest.approx(0.057**2 - 0.023**2)


@pytest.mark.parametrize(
    ("times_ms", "known"),
    [
        (range(0), False),
        (range(0, 120, 5), True),
        (range(50, 120, 5), False),
        (range(25, 101, 5), True),
        (range(0, 60, 5), False),
        (range(0, 120, 40), False),
        (range(-50, 0, 5), False),
        (range(101, 140, 5), False),
    ],
    ids=["none", "all", "late half", "most", "early half", "too rare", "before", "after"],
)
def test_only_samples_of_most_of_the_time_stand_for_it(times_ms: range, known: bool) -> None:
    memory = GyroMemory()
    memory.add(samples(times_ms, lambda t_s: 1.0))
    turn = memory.turn_rad(0, 100 * MS)
    assert (turn is not None) == known
    if turn is not None:
        assert turn[0] == pytest.approx(0.1)


def test_gyro_samples_that_are_not_finite_count_as_missing() -> None:
    memory = GyroMemory()
    memory.add(samples(range(0, 105, 5), lambda t_s: math.nan if 0.02 < t_s < 0.07 else 1.0))
    assert memory.turn_rad(0, 100 * MS) is None
    assert memory.turn_rad(70 * MS, 100 * MS) is not None


def test_a_stamp_that_is_wrong_holds_nothing_up() -> None:
    memory = GyroMemory()
    memory.add(samples(range(0, 50, 5), lambda t_s: 1.0))
    memory.add(samples(range(900_000, 900_001), lambda t_s: 1.0))
    memory.add(samples(range(50, 110, 5), lambda t_s: 1.0))
    turn = memory.turn_rad(0, 100 * MS)
    assert turn is not None
    assert turn[0] == pytest.approx(0.1)


def test_no_more_is_kept_than_some_seconds_of_it() -> None:
    memory = GyroMemory()
    for second in range(60):
        memory.add(samples(range(1000 * second, 1000 * (second + 1), 1), lambda t_s: 1.0))
    assert memory.turn_rad(59_000 * MS, 59_900 * MS) is not None
    assert memory.turn_rad(50_000 * MS, 51_000 * MS) is None


def test_the_detector_knows_its_turn_from_samples_that_came_too_early(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also over a black frame: those that came with it count for the next one that is followed."""
    told: list[float] = []

    def noted(*args: object) -> object:
        prior = with_gyro(*args)  # type: ignore[arg-type]  # whatever it is called with
        told.append(float(vector_from_rotation(prior.motion.rotation)[0]))
        return prior

    monkeypatch.setattr(motion_memory, "with_gyro", noted)
    crate = box(vector(3.5, 0.5, 0.0), vector(0.4, 0.6, 1.2), 10)
    frames, eyes = (
        record(floor() + wall() + crate, drive(), 6, QVGA).frames,
        Detector(PerceptionConfig(), MOUNT),
    )
    start_ms = frames[0].captured_ns // MS
    for k, frame in enumerate(frames):
        begin = start_ms + round((k - 1) * FRAME_NS / MS) + 30
        gyro = samples(range(begin, begin + 33, 3), lambda t_s: 0.3)
        shown = replace(frame, colour=np.zeros_like(frame.colour)) if k == 3 else frame
        eyes.step(replace(shown, gyro=gyro), None)
    # Frames 1, 2, 4 (after two intervals) and 5.
    dt_s = FRAME_NS * 1e-9
    np.testing.assert_allclose(told, [0.3 * dt_s, 0.3 * dt_s, 0.6 * dt_s, 0.3 * dt_s], rtol=1e-3)
