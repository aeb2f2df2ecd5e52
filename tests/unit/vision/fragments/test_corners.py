"""Corners on a body, and fragments made of pairs of them."""

from __future__ import annotations

import numpy as np

from hal.types import DepthImage
from vision.fragments.corners import Points, corners_within, in_pairs
from vision.fragments.edges import GreyImage

BODY_MM, WALL_MM = 3000, 6000


def dotted(*spots: tuple[int, int]) -> GreyImage:
    """A grey image with small bright squares around spots (column, row)."""
    grey = np.full((120, 80), 60, np.uint8)
    for u, v in spots:
        grey[v - 2 : v + 3, u - 2 : u + 3] = 200
    return grey


def depth_with_body() -> DepthImage:
    """Raw depth: a body between the columns 20 and 60, a wall beside it."""
    depth = np.full((120, 80), WALL_MM, np.uint16)
    depth[:, 20:60] = BODY_MM
    return depth


def near(points: Points, spot: tuple[int, int]) -> bool:
    return bool((np.hypot(*(points - np.array(spot, np.float32)).T) < 6.0).any())


def test_only_corners_on_the_body_are_found() -> None:
    points = corners_within(dotted((40, 30), (40, 80), (10, 50)), depth_with_body(), 2500.0, 3500.0)
    assert near(points, (40, 30))
    assert near(points, (40, 80))
    assert not near(points, (10, 50))


def test_a_corner_at_the_outline_of_the_body_is_not_used() -> None:
    points = corners_within(dotted((40, 30), (22, 80)), depth_with_body(), 2500.0, 3500.0)
    assert near(points, (40, 30))
    assert not near(points, (22, 80))


def test_pixels_without_depth_are_not_on_the_body() -> None:
    depth = depth_with_body()
    depth[:60] = 0
    points = corners_within(dotted((40, 30), (40, 90)), depth, -500.0, 3500.0)
    assert near(points, (40, 90))
    assert not near(points, (40, 30))


def test_a_plain_body_has_no_corner() -> None:
    assert corners_within(dotted(), depth_with_body(), 2500.0, 3500.0).shape == (0, 2)


def test_pairs_are_neighbours_in_height_and_each_point_is_used_once() -> None:
    points = np.array([[5.0, 90.0], [7.0, 10.0], [6.0, 50.0], [8.0, 20.0], [9.0, 99.0]], np.float32)
    expected = [[[7.0, 10.0], [8.0, 20.0]], [[6.0, 50.0], [5.0, 90.0]]]
    assert in_pairs(points).tolist() == expected
    assert in_pairs(points[:1]).shape == (0, 2, 2)
