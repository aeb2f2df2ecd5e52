from __future__ import annotations

import numpy as np
import pytest

from hal.types import ColourImage, Intrinsics
from sim.rendering.colour_noise import ColourSensor, expected_sigma

K = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)


def even(grey: int) -> ColourImage:
    return np.full((K.height, K.width, 3), grey, np.uint8)


@pytest.mark.parametrize("grey", [20, 100, 200])
def test_read_and_shot_noise(grey: int) -> None:
    sensor = ColourSensor(K, seed=1)
    images = np.stack([sensor.expose(even(grey), frame) for frame in range(12)]).astype(np.float64)
    assert images.mean() == pytest.approx(grey, abs=0.05)
    # Rounding to bytes adds a twelfth of a step squared.
    assert images.std() == pytest.approx(np.hypot(expected_sigma(grey), 1 / np.sqrt(12)), rel=0.06)


def test_expected_sigma_by_hand() -> None:
    assert expected_sigma(0.0) == pytest.approx(1.0)
    assert expected_sigma(150.0) == pytest.approx(2.0)  # sqrt(1 + 0.02 * 150)


def test_black_and_white_stay_within_bytes() -> None:
    sensor = ColourSensor(K, seed=1)
    assert sensor.expose(even(0), 0).max() < 8
    assert sensor.expose(even(255), 0).min() > 240


def test_same_seed_and_frame_give_the_same_bytes_and_leave_the_picture_alone() -> None:
    one, two = ColourSensor(K, seed=1), ColourSensor(K, seed=1)
    clean = even(128)
    one.expose(clean, 0)
    assert one.expose(clean, 5).tobytes() == two.expose(even(128), 5).tobytes()
    assert one.expose(clean, 5).tobytes() != one.expose(clean, 6).tobytes()
    assert (clean == 128).all()
