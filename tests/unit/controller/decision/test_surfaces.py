"""Which points of the free space belong to which bodies, and how far each band was seen through."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.perception import DepthNoise
from controller.decision.surfaces import bands_at, seen_of, surfaces_of
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import box
from vision.scene import FreeSpace

HERE, MOUNT = PlanarPose(0.0, 0.0, 0.0), CameraMount(0.5, 0.0, 0.6, 0.0)


def ahead(nearest_m: list[float], known_m: list[float]) -> FreeSpace:
    """Bands straight ahead, one beside the other."""
    count = len(nearest_m)
    return FreeSpace(
        np.linspace(0.0, 0.01 * (count - 1), count), 0.005, np.array(nearest_m), np.array(known_m)
    )


@pytest.mark.parametrize(
    ("forward_m", "behind_m", "own"), [(5.0, 0.9, True), (5.0, 1.0, False), (1.0, 0.4, False)]
)
def test_behind_a_body_depth_may_be_off_by_its_noise(forward_m: float, behind_m: float, own: bool) -> None:
    """0.3 m, and 3.5 sigmas of 0.0075 z^2: 0.96 m 5 m away, 0.33 m 1 m away."""
    one = box(0.5 + forward_m - behind_m, 0.0, half_view_m=0.0, half_across_m=0.2)
    assert surfaces_of(ahead([forward_m], [forward_m]), HERE, MOUNT).of(one)[0, 0] == own


def test_the_noise_is_that_of_the_camera() -> None:
    """3.5 sigmas of 0.002 z^2 and 0.3 m are 0.475 m 5 m away."""
    seen = surfaces_of(ahead([5.0], [5.0]), HERE, MOUNT, DepthNoise(quadratic_per_m=0.002))
    for behind_m, own in ((0.47, True), (0.48, False)):
        one = box(5.5 - behind_m, 0.0, half_view_m=0.0, half_across_m=0.2)
        assert seen.of(one)[0, 0] == own


def test_a_band_was_seen_to_its_surface_or_over_free_floor_or_not_at_all() -> None:
    seen = surfaces_of(ahead([3.0, math.inf, math.inf], [2.5, 4.0, 0.0]), HERE, MOUNT)
    assert seen.seen_m.tolist() == [3.0, 4.0, 0.0]
    assert seen.bands.tolist() == [0]
    np.testing.assert_allclose(seen.points_m, [[3.5, 0.0]])


def test_a_surface_stands_in_its_own_band_wherever_the_robot_does() -> None:
    """To the right of the view is a number too many, to the left of it one below zero."""
    free = ahead([3.0, math.inf, 2.0, 5.0], [10.0] * 4)
    pose, mount = PlanarPose(1.0, -2.0, 2.5), CameraMount(0.5, 0.2, 0.6, 0.0)
    surfaces = surfaces_of(free, pose, mount)
    forward_m, band = bands_at(free, pose, mount, *surfaces.points_m.T)
    np.testing.assert_allclose(forward_m, surfaces.forward_m)
    assert band.tolist() == surfaces.bands.tolist() == [0, 2, 3]
    right = np.array([math.sin(pose.heading_rad), -math.cos(pose.heading_rad)])
    _, to_the_right = bands_at(free, pose, mount, *(surfaces.points_m + right).T)
    _, to_the_left = bands_at(free, pose, mount, *(surfaces.points_m - right).T)
    assert (to_the_right >= 4).all()
    assert (to_the_left < 0).all()


def rows(*at: tuple[float, float]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(2, R, 1) points so far ahead and to the right of the camera."""
    ahead_m, right_m = np.array(at).T
    return np.stack((0.5 + ahead_m, -right_m))[:, :, None]


def test_floor_was_seen_up_to_the_free_end_of_its_band() -> None:
    """Bands 0.01 wide around bearings of 0, 0.01 and 0.02; the last one is not known at all."""
    free = ahead([math.inf, math.inf, math.inf], [4.0, 2.0, math.nan])
    points = rows((3.9, 0.0), (3.95, 0.0), (3.9, 0.039), (1.9, 0.019), (1.9, 0.038), (1.9, 0.1), (1.9, -0.1))
    seen = seen_of(free, HERE, MOUNT, points, 0.1, 0.0, np.zeros(3, np.bool_))
    assert seen.tolist() == [1, 0, 0, 1, 0, 0, 0]
    # What is too near was not seen, nor what is behind the camera.
    near = rows((1.0, 0.0), (1.01, 0.0), (-1.0, 0.0))
    assert seen_of(free, HERE, MOUNT, near, 0.1, 1.0, np.zeros(3, np.bool_)).tolist() == [0, 1, 0]


def test_behind_a_surface_that_limits_the_speed_itself_floor_is_as_good_as_seen() -> None:
    free = ahead([3.0, 3.0], [2.9, 2.9])
    points = rows((2.85, 0.0), (2.9, 0.0), (6.0, 0.0), (6.0, 0.06))
    assert seen_of(free, HERE, MOUNT, points, 0.1, 0.0, np.array([True, False])).tolist() == [0, 1, 1, 0]


def test_a_row_counts_each_of_its_points() -> None:
    lanes = np.stack((np.full((1, 3), 2.5), np.array([[0.0, -0.02, -5.0]])))
    free = ahead([math.inf, math.inf], [4.0, 4.0])
    assert seen_of(free, HERE, MOUNT, lanes, 0.1, 0.0, np.zeros(2, np.bool_)).tolist() == [2]
