from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vision.fragments import lucas_kanade
from vision.fragments.edges import GreyImage

SIDE = 11


def search(
    before: GreyImage,
    now: GreyImage,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    scale: float,
    side: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Search for all points."""
    return lucas_kanade.search(before, now, pixels, guess, np.ones(len(pixels), np.bool_), scale, side)


def pattern(seed: int, height: int = 180, width: int = 240) -> GreyImage:
    rng = np.random.default_rng(seed)
    noise = rng.integers(0, 256, (height, width)).astype(np.float32)
    smooth = np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.0))
    return np.asarray((smooth - smooth.min()) * (215.0 / np.ptp(smooth)) + 20.0, np.uint8)


def moved(image: GreyImage, right: float, down: float) -> GreyImage:
    matrix = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
    size = image.shape[1], image.shape[0]
    return np.asarray(
        cv2.warpAffine(image, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101),
        np.uint8,
    )


def by_opencv(
    before: GreyImage, now: GreyImage, pixels: NDArray[np.float32], guess: NDArray[np.float32], side: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        before,
        now,
        pixels,
        guess.copy(),
        winSize=(side, side),
        maxLevel=0,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.02),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        minEigThreshold=1e-5,
    )
    return np.asarray(there, np.float32), np.asarray(status, np.uint8)[:, 0].astype(np.bool_)


def inner_points(seed: int, count: int, margin_px: float) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    return rng.uniform(margin_px, np.array([240, 180]) - margin_px, (count, 2)).astype(np.float32)


@pytest.mark.parametrize("side", [5, 11, 14, 21, 41])
def test_points_agree_with_those_of_opencv(side: int) -> None:
    before, pixels = pattern(1), inner_points(2, 200, 30.0)
    now = moved(before, 0.8, -0.6)
    guess = pixels + np.array([0.3, 0.2], np.float32)
    expected, expected_found = by_opencv(before, now, pixels, guess, side)
    there, found = search(before, now, pixels, guess, 1.0, side)
    np.testing.assert_array_equal(found, expected_found)
    off_px = np.hypot(*(there - expected)[found].T)
    assert found.mean() > 0.95
    assert np.median(off_px) < 0.003
    assert np.quantile(off_px, 0.98) < 0.02  # the step at which both end


def test_points_are_nearer_to_the_truth_than_those_of_opencv() -> None:
    """OpenCV rounds the grey levels between pixels."""
    before, pixels = pattern(3), inner_points(4, 300, 20.0)
    now, truth = moved(before, 0.31, 0.17), np.array([0.31, 0.17], np.float32)
    there, _ = search(before, now, pixels, pixels, 1.0, SIDE)
    expected, _ = by_opencv(before, now, pixels, pixels, SIDE)
    error, opencv_error = np.abs(there - pixels - truth), np.abs(expected - pixels - truth)
    assert np.median(error) <= 1.01 * np.median(opencv_error)


@pytest.mark.parametrize(
    "corner",
    [(1.0, 1.0), (238.5, 1.5), (0.5, 178.5), (238.0, 178.0), (120.0, 0.0), (0.0, 90.0), (239.0, 90.0)],
)
def test_a_window_across_the_border_rests_on_what_is_in_the_image(corner: tuple[float, float]) -> None:
    before = pattern(5)
    pixels = np.array([corner], np.float32)
    there, found = search(before, moved(before, 0.4, 0.3), pixels, pixels, 1.0, SIDE)
    assert found.all()
    np.testing.assert_allclose(there - pixels, [[0.4, 0.3]], atol=0.15)


def test_points_of_a_pyramid_are_in_pixels_of_the_whole_image() -> None:
    before = pattern(6)
    pixels = inner_points(7, 50, 30.0)
    whole = search(before, moved(before, 0.5, 0.5), pixels, pixels, 1.0, SIDE)
    scaled = search(before, moved(before, 0.5, 0.5), 4.0 * pixels, pixels, 0.25, SIDE)
    np.testing.assert_array_equal(whole[0], scaled[0])
    np.testing.assert_array_equal(whole[1], scaled[1])


@pytest.mark.parametrize("place", [(-30.0, 90.0), (300.0, 90.0), (120.0, -30.0), (120.0, 220.0)])
def test_point_outside_the_image_is_not_found(place: tuple[float, float]) -> None:
    image, outside, inside = pattern(8), np.array([place], np.float32), np.array([[120.0, 90.0]], np.float32)
    assert search(image, image, outside, inside, 1.0, SIDE)[1].tolist() == [False]
    assert search(image, image, inside, outside, 1.0, SIDE)[1].tolist() == [False]


def test_neither_a_plain_area_nor_nothing_at_all_is_found() -> None:
    plain, pixels = np.full((60, 80), 90, np.uint8), np.array([[40.0, 30.0]], np.float32)
    there, found = search(plain, plain, pixels, pixels, 1.0, SIDE)
    assert found.tolist() == [False]
    np.testing.assert_array_equal(there, pixels)
    none = np.empty((0, 2), np.float32)
    assert search(plain, plain, none, none, 1.0, SIDE)[0].shape == (0, 2)


def test_points_that_are_not_chosen_stay_at_their_guess() -> None:
    before, pixels = pattern(10), inner_points(11, 4, 30.0)
    now, chosen = moved(before, 0.5, 0.5), np.array([True, False, True, False])
    everyone, _ = search(before, now, pixels, pixels, 1.0, SIDE)
    there, found = lucas_kanade.search(before, now, pixels, pixels, chosen, 1.0, SIDE)
    np.testing.assert_array_equal(found, chosen)
    np.testing.assert_array_equal(there, np.where(chosen[:, None], everyone, pixels))


def test_a_straight_edge_is_found_across_it() -> None:
    """Along the edge the end stays at its guess."""
    image = np.zeros((60, 80), np.uint8)
    image[:, 40:] = 200
    blurred = np.asarray(cv2.GaussianBlur(image, (0, 0), 1.5), np.uint8)
    noise = np.random.default_rng(9).integers(0, 3, image.shape).astype(np.uint8)
    before = blurred + noise
    pixels, guess = np.array([[40.0, 30.0]], np.float32), np.array([[41.0, 30.0]], np.float32)
    there, found = search(before, before, pixels, guess, 1.0, SIDE)
    assert found.tolist() == [True]
    assert abs(float(there[0, 0]) - 40.0) < 0.02


def test_the_sums_of_the_largest_window_do_not_overflow() -> None:
    """Stripes of black and white, whose gradient is as large as it can be: upright ones above level ones."""
    stripes = np.tile(np.array([0, 0, 255, 255], np.uint8), (96, 24))
    before = np.concatenate((stripes[:48], stripes.T[48:]))
    pixels = np.array([[48.0, 48.0]], np.float32)
    there, found = search(before, before, pixels, pixels + np.float32(0.4), 1.0, 41)
    assert found.tolist() == [True]
    np.testing.assert_allclose(there, pixels, atol=0.02)
