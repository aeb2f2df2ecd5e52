"""The silhouette of a box that is fixed to the robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.own_parts import OwnPart
from hal.box_view import box_view
from hal.types import CameraMount, Intrinsics

CAMERA = Intrinsics(160, 120, 100.0, 100.0, 79.5, 59.5)
LEVEL = CameraMount(0.2, 0.0, 0.5, 0.0)


def box(from_m: tuple[float, float, float], to_m: tuple[float, float, float]) -> OwnPart:
    return OwnPart(name="part", from_m=from_m, to_m=to_m)


def test_a_plate_across_the_view_is_seen_where_a_pinhole_puts_it() -> None:
    """1 m ahead, 0.4 m wide, from 0.1 m below the axis to 0.3 m below it."""
    view = box_view(box((1.2, -0.2, 0.2), (1.3, 0.2, 0.4)), LEVEL, CAMERA)
    rows, columns = view.seen.nonzero()
    # The upper side is seen as well: at its far edge it is 0.1 m below the axis, 1.1 m ahead.
    assert (rows.min(), rows.max()) == (math.ceil(59.5 + 10.0 / 1.1), math.floor(59.5 + 30.0))
    assert (columns.min(), columns.max()) == (60, 99)
    front = view.enter_m[80, 70:90]
    np.testing.assert_allclose(front, 1.0, rtol=1e-6)
    assert (view.axis[80, 70:90] == 0).all()
    assert (view.axis[rows.min(), 70:90] == 2).all()  # its upper side


def test_depths_are_those_of_the_near_and_the_far_side() -> None:
    view = box_view(box((0.7, -3.0, 0.0), (1.2, 3.0, 1.0)), LEVEL, CAMERA)
    middle = view.enter_m[59, 79], view.exit_m[59, 79]
    assert middle == pytest.approx((0.5, 1.0))


@pytest.mark.parametrize(
    ("from_m", "to_m"),
    [
        ((-1.0, -0.2, 0.2), (-0.1, 0.2, 0.4)),  # behind the camera
        ((1.0, 2.0, 0.2), (1.2, 2.2, 0.4)),  # to its left
        ((0.25, -0.2, 0.0), (0.3, 0.2, 0.1)),  # below it
    ],
)
def test_what_is_out_of_view_has_no_silhouette(
    from_m: tuple[float, float, float], to_m: tuple[float, float, float]
) -> None:
    view = box_view(box(from_m, to_m), LEVEL, CAMERA)
    assert not view.seen.any()
    assert not view.enter_m.any()


def test_a_box_that_reaches_behind_the_camera_is_clipped() -> None:
    """A track to the left, from behind the camera to 0.8 m ahead of it: at the border it is 0.2 m away."""
    view = box_view(box((-0.5, 0.16, 0.0), (1.0, 0.4, 0.5)), LEVEL, CAMERA)
    rows, columns = view.seen.nonzero()
    assert columns.min() == 0
    assert rows.max() == CAMERA.height - 1
    # Its far end is 0.8 m ahead, and its inner side 0.16 m to the left there.
    assert columns.max() == math.floor(79.5 - 100.0 * 0.16 / 0.8)
    assert view.enter_m[100, 0] == pytest.approx(0.16 / 0.795, rel=1e-5)


def test_from_inside_the_box_fills_the_image() -> None:
    assert box_view(box((0.0, -0.2, 0.2), (0.4, 0.2, 0.8)), LEVEL, CAMERA).seen.all()
