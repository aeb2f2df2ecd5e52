"""The view of a box is the convex hull of its projected corners, wherever the box and the camera are."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from config.own_parts import OwnPart
from hal.box_view import box_view
from hal.geometry import camera_in_body
from hal.types import CameraMount, FloatArray, Intrinsics

CAMERA = Intrinsics(96, 72, 70.0, 75.0, 46.0, 37.5)
metres = st.floats(-1.5, 1.5)
sizes = st.floats(0.05, 1.0)
boxes = st.builds(
    lambda low, size: OwnPart(
        name="part", from_m=tuple(low), to_m=tuple(a + b for a, b in zip(low, size, strict=True))
    ),
    st.tuples(metres, metres, metres),
    st.tuples(sizes, sizes, sizes),
)
mounts = st.builds(
    CameraMount, st.floats(-1, 1), st.floats(-0.5, 0.5), st.floats(0.1, 1.5), st.floats(-0.7, 1)
)


def corners_in_camera(part: OwnPart, mount: CameraMount) -> FloatArray:
    """(8, 3)."""
    corners = np.array(list(product(*zip(part.from_m, part.to_m, strict=True))))
    return camera_in_body(mount).inverse().apply(corners)


@settings(max_examples=200, deadline=None)
@given(boxes, mounts)
def test_the_silhouette_is_the_hull_of_the_corners(part: OwnPart, mount: CameraMount) -> None:
    corners = corners_in_camera(part, mount)
    if (corners[:, 2] <= 0.05).any():
        return  # without a hull
    pixels = corners[:, :2] / corners[:, 2:] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)
    hull = cv2.convexHull(pixels.astype(np.float32))
    seen = box_view(part, mount, CAMERA).seen
    for row, column in product(range(0, CAMERA.height, 5), range(0, CAMERA.width, 5)):
        inside_px = cv2.pointPolygonTest(hull, (float(column), float(row)), True)
        if abs(inside_px) > 0.01:
            assert seen[row, column] == (inside_px > 0.0)


@settings(max_examples=500, deadline=None)
@given(boxes, mounts, st.floats(0.01, 0.99), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_each_point_of_the_box_that_is_in_view_lies_between_both_depths(
    part: OwnPart, mount: CameraMount, a: float, b: float, c: float
) -> None:
    low, high = np.array(part.from_m), np.array(part.to_m)
    point = camera_in_body(mount).inverse().apply((low + (a, b, c) * (high - low))[None])[0]
    if point[2] <= 0.05:
        return  # behind the camera
    u, v = point[:2] / point[2] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)
    # The camera of the same size whose pixel this is.
    column, row = round(float(u)), round(float(v))
    if not (0 <= column < CAMERA.width and 0 <= row < CAMERA.height):
        return
    shifted = Intrinsics(96, 72, 70.0, 75.0, CAMERA.cx + column - u, CAMERA.cy + row - v)
    view = box_view(part, mount, shifted)
    assert view.seen[row, column]
    assert view.enter_m[row, column] <= point[2] * (1.0 + 1e-5)
    assert view.exit_m[row, column] >= point[2] * (1.0 - 1e-5)


@settings(max_examples=200, deadline=None)
@given(boxes, mounts)
def test_depths_are_in_order_and_0_where_nothing_is_seen(part: OwnPart, mount: CameraMount) -> None:
    view = box_view(part, mount, CAMERA)
    assert np.isfinite(view.exit_m).all()
    assert (view.exit_m[view.seen] > view.enter_m[view.seen] - 1e-6).all()
    assert not view.enter_m[~view.seen].any()
    assert not view.exit_m[~view.seen].any()
