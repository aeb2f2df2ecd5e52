from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import FragmentSettings
from vision.fragments.edges import GreyImage
from vision.fragments.optical_flow import Flow, _confirmed, mahalanobis, pyramid
from vision.fragments.optical_flow import track as track_in

SETTINGS = FragmentSettings()
NARROW = FragmentSettings(forward_backward_sigmas=3.0, forward_backward_px=4.0)


def pattern(seed: int) -> GreyImage:
    rng = np.random.default_rng(seed)
    noise = rng.integers(0, 256, (180, 240)).astype(np.float32)
    smooth = np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.0))
    return np.asarray((smooth - smooth.min()) * (215.0 / np.ptp(smooth)) + 20.0, np.uint8)


def shifted(image: GreyImage, right: float, down: float) -> GreyImage:
    matrix = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
    return np.asarray(
        cv2.warpAffine(image, matrix, (240, 180), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT),
        np.uint8,
    )


def points() -> NDArray[np.float32]:
    u, v = np.meshgrid(np.arange(40, 201, 20), np.arange(40, 141, 20))
    return np.stack((u.ravel(), v.ravel()), axis=1).astype(np.float32)


def steady(count: int) -> NDArray[np.float32]:
    """Held to 0.2 px in every direction."""
    return np.tile(np.array([0.04, 0.0, 0.04], np.float32), (count, 1))


def new(count: int) -> NDArray[np.float32]:
    """The last error of ends that were never expected anywhere."""
    return np.full(count, np.inf, np.float32)


def track(
    before: GreyImage,
    now: GreyImage,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    covariance: NDArray[np.float32],
    settings: FragmentSettings,
    last_error_px: NDArray[np.float32] | None = None,
) -> Flow:
    images = pyramid(before, settings), pyramid(now, settings)
    last = new(len(pixels)) if last_error_px is None else last_error_px
    return track_in(*images, pixels, guess, covariance, last, settings)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.4, -0.3), (3.3, -1.7), (9.5, 6.25)])
def test_a_known_shift_is_recovered_to_a_tenth_of_a_pixel(shift: tuple[float, float]) -> None:
    before, start = pattern(1), points()
    flow = track(before, shifted(before, *shift), start, start, steady(len(start)), SETTINGS)
    assert flow.found.mean() >= 0.95
    np.testing.assert_allclose(
        (flow.pixels - start)[flow.found], np.tile(shift, (flow.found.sum(), 1)), atol=0.1
    )


@pytest.mark.parametrize("shift", [(3.3, -1.7), (9.5, 6.25)])
def test_a_shift_of_the_whole_image_is_found_where_expectations_were_right_so_far(
    shift: tuple[float, float],
) -> None:
    before, start = pattern(1), points()
    right = np.zeros(len(start), np.float32)
    flow = track(before, shifted(before, *shift), start, start, steady(len(start)), SETTINGS, right)
    assert flow.found.mean() >= 0.95
    np.testing.assert_allclose(
        (flow.pixels - start)[flow.found], np.tile(shift, (flow.found.sum(), 1)), atol=0.1
    )
    # It is common to all ends, so it is not an error of any of them.
    assert (flow.error_px[flow.found] < 0.2).all()


@pytest.mark.parametrize("left_out", [1, 7, 13])
def test_end_with_a_wrong_expectation_is_searched_coarse_to_fine(left_out: int) -> None:
    before, start = pattern(1), points()
    guess, last = start.copy(), np.zeros(len(start), np.float32)
    guess[left_out] -= (9.5, 0.0)
    for error_px, found in ((0.0, False), (0.9, False), (1.1, True), (np.inf, True)):
        last[left_out] = error_px
        flow = track(before, before, start, guess, steady(len(start)), SETTINGS, last)
        there = flow.found[left_out] and np.abs(flow.pixels[left_out] - start[left_out]).max() < 0.2
        assert there == found, error_px
        assert np.delete(flow.found, left_out).all()
    assert flow.error_px[left_out] == pytest.approx(9.5, abs=0.3)


def test_with_few_points_all_are_searched_coarse_to_fine() -> None:
    before, start = pattern(1), points()[:4]
    right = np.zeros(len(start), np.float32)
    guess = start + np.array([[9.5, 0.0], [0.0, 9.5], [-9.5, 0.0], [0.0, -9.5]], np.float32)
    flow = track(before, before, start, guess, steady(len(start)), SETTINGS, right)
    np.testing.assert_allclose(flow.pixels, start, atol=0.5)


def test_a_good_guess_reaches_farther_than_the_pyramid_alone() -> None:
    before, start = pattern(1), points()
    start = start[start[:, 0] <= 160]
    now = shifted(before, 60.0, 0.0)
    guess = start + np.array([59.0, 0.5], np.float32)
    flow = track(before, now, start, guess, steady(len(start)), SETTINGS)
    assert flow.found.mean() >= 0.9
    assert np.abs((flow.pixels - start)[flow.found] - [60.0, 0.0]).max() <= 0.1


def test_forward_and_backward_reject_a_point_whose_texture_is_gone() -> None:
    before, start = pattern(1), points()
    now = shifted(before, 1.5, 0.5).copy()
    now[60:120, 80:160] = pattern(2)[60:120, 80:160]
    flow = track(before, now, start, start, steady(len(start)), SETTINGS)
    replaced = (np.abs(start - [120, 90]) < [28, 18]).all(axis=1)
    kept = (np.abs(start - [120, 90]) > [56, 46]).any(axis=1)
    assert np.count_nonzero(replaced) >= 4
    assert np.count_nonzero(flow.found & replaced) <= 1
    assert flow.found[kept].mean() >= 0.95


def test_points_that_leave_the_image_are_lost() -> None:
    before = pattern(1)
    start = np.array([[236.0, 90.0], [120.0, 90.0]], np.float32)
    now = shifted(before, 6.0, 0.0)
    guess = start + np.array([6.0, 0.0], np.float32)
    assert track(before, now, start, guess, steady(2), SETTINGS).found.tolist() == [False, True]


def test_a_plain_area_has_no_flow() -> None:
    plain = np.full((180, 240), 128, np.uint8)
    start = points()
    assert not track(plain, plain, start, start, steady(len(start)), SETTINGS).found.any()


def test_searching_level_by_level_finds_what_opencv_finds_on_all_of_them() -> None:
    before, start = pattern(1), points()
    now, window = shifted(before, 9.5, 6.25), SETTINGS.lk_window_px
    whole, _, _ = cv2.calcOpticalFlowPyrLK(
        before,
        now,
        start,
        start.copy(),
        winSize=(window, window),
        maxLevel=SETTINGS.lk_levels,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.02),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        minEigThreshold=1e-5,
    )
    # So sure of every end that what is expected of it has no weight.
    flow = track(before, now, start, start, 1e-9 * steady(len(start)), SETTINGS)
    np.testing.assert_allclose(flow.pixels, np.asarray(whole), atol=1e-3)


@pytest.mark.parametrize(("size", "levels"), [((480, 640), 4), ((45, 200), 3), ((22, 200), 1)])
def test_a_pyramid_ends_where_an_image_would_be_smaller_than_the_window(
    size: tuple[int, int], levels: int
) -> None:
    assert len(pyramid(np.zeros(size, np.uint8), SETTINGS)) == levels


def test_tracking_no_points_finds_none() -> None:
    none = np.empty((0, 2), np.float32)
    flow = track(pattern(1), pattern(1), none, none, np.empty((0, 3), np.float32), SETTINGS)
    assert flow.pixels.shape == (0, 2)
    assert flow.found.shape == flow.error_px.shape == (0,)


def test_an_end_may_slide_along_its_edge_but_not_across() -> None:
    # Variance 4 along u and 0.04 along v: 1 px there and back is half a sigma along and 5 sigmas across.
    covariance = np.array([[4.0, 0.0, 0.04]] * 2, np.float32)
    miss = np.array([[1.0, 0.0], [0.0, 1.0]], np.float32)
    np.testing.assert_allclose(mahalanobis(miss, covariance), [0.25, 25.0], rtol=1e-5)


@pytest.mark.parametrize(
    ("place", "miss", "good"),
    [
        ((2.0, 2.0), (0.0, 0.0), True),
        ((97.0, 57.0), (0.0, 0.0), True),
        ((1.99, 30.0), (0.0, 0.0), False),
        ((30.0, 57.01), (0.0, 0.0), False),
        # Three sigmas of 2 px along u, but no more than 4 px; three of 0.5 px along v.
        ((30.0, 30.0), (3.9, 0.0), True),
        ((30.0, 30.0), (4.1, 0.0), False),
        ((30.0, 30.0), (0.0, 1.4), True),
        ((30.0, 30.0), (0.0, -1.6), False),
        ((30.0, 30.0), (float("nan"), 0.0), False),
    ],
)
def test_end_is_confirmed_if_the_backward_search_returns_to_it(
    place: tuple[float, float], miss: tuple[float, float], good: bool
) -> None:
    there, off = np.array([place], np.float32), np.array([miss], np.float32)
    covariance = np.array([[4.0, 0.0, 0.25]], np.float32)
    end, _, confirmed = _confirmed(there, there, off, covariance, NARROW, 60, 100)
    np.testing.assert_array_equal(end, there)
    assert confirmed.tolist() == [good]


def test_an_end_is_where_it_is_expected_along_its_edge_and_where_it_is_found_across_it() -> None:
    """Variances 12 and 0 px^2 of the search against 4 of the expectation: a quarter and all of the way."""
    there, expected = np.array([[38.0, 38.0]], np.float32), np.array([[30.0, 30.0]], np.float32)
    covariance, none = np.array([[12.0, 0.0, 0.0]], np.float32), np.zeros((1, 2), np.float32)
    end, error_px, _ = _confirmed(there, expected, none, covariance, NARROW, 60, 100)
    np.testing.assert_allclose(end, [[32.0, 38.0]], rtol=1e-6)
    np.testing.assert_allclose(error_px, [8.0], rtol=1e-6)
