"""Whether one body alone tells how the camera turns.

In a plain room, hardly anything but one crate has corners and upright edges. If that crate moves slowly, the
fit explains it by a turn of the camera within the prior, frame after frame, and no other point contradicts:
those on the floor and on the horizon measure across horizontal lines only. Where tracks slip, the images know
the turn better than the odometry. But if slip does not explain a turn, and one body alone tells it, that body
may as well move, and has no say. The same holds for any motion that contradicts the odometry: a vehicle that
fills the view drives off, and the robot seems to go back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray, Intrinsics, Pose
from vision.camera.lens import MIN_AHEAD_M
from vision.ego_motion.pose_arrays import as_array, in_camera, turned_back
from vision.ego_motion.reprojection import View
from vision.scene import Obstacle

_LARGEST_M = 3.0  # larger ones are walls and racks, which are static
# Of all that is known of the turn. In furnished rooms a quarter of the view has half of it, and 0.8 at most.
_ALONE_SHARE = 0.85
# Margin around a body: the lines behind it end at its outline, and it may have moved since it was reported.
_MARGIN_PX = 8.0


def without_lone_body(view: View, start: Pose, obstacles: tuple[Obstacle, ...], camera: Intrinsics) -> View:
    """The view without the points of a body that alone tells the camera's turn about its y axis, if any.

    start: about where the camera is now. obstacles: of the frame before.
    """
    boxes_px = _may_move_px(obstacles)
    if not len(boxes_px):
        return view
    focal, centre = np.array([camera.fx, camera.fy] * 2), np.array([camera.cx, camera.cy] * 2)
    boxes = (boxes_px + _MARGIN_PX * np.array([-1.0, -1.0, 1.0, 1.0]) - centre) / focal
    others = _others(view, as_array(start), boxes)
    if len(others) == len(view.seen):
        return view
    return View(view.lines[others], view.seen[others], view.whitening[others])


def _may_move_px(obstacles: tuple[Obstacle, ...]) -> FloatArray:
    """(B, 4) bounding boxes (u0, v0, u1, v1) of the obstacles that may move as a whole."""
    boxes = [one.bbox_px for one in obstacles if one.extent_m.max() <= _LARGEST_M]
    return np.array(boxes, float).reshape(-1, 4)


@inlined
def _told(line: FloatArray, seen: FloatArray, whitening: FloatArray, pose: FloatArray) -> float:
    """What a point tells of a turn about the camera's y axis: the inverse of its variance, 1/rad^2."""
    z = max(in_camera(pose, line[0])[2], MIN_AHEAD_M)
    dx, dy, dz = turned_back(pose, line[1, 0], line[1, 1], line[1, 2])
    x, y, own, mixed, other = seen[0], seen[1], whitening[0], whitening[1], whitening[2]
    across, down = own * (1.0 + x * x), mixed * (1.0 + x * x) + other * x * y
    # What is seen along the epipolar line may be due to depth (Sherman-Morrison).
    dx, dy = (dx - x * dz) / z, (dy - y * dz) / z
    dx, dy = own * dx, mixed * dx + other * dy
    along = across * dx + down * dy
    by_depth = along * along * whitening[3] / (1.0 + whitening[3] * (dx * dx + dy * dy))
    told: float = across * across + down * down - by_depth
    return told


@inlined
def _inside(box: FloatArray, seen: FloatArray) -> bool:
    result: bool = box[0] <= seen[0] <= box[2] and box[1] <= seen[1] <= box[3]
    return result


@compiled(View, "float64[:, ::1], float64[:, ::1]")
def _others(view: View, pose: FloatArray, boxes: FloatArray) -> NDArray[np.intp]:
    """The points outside the lone body's box, or all points if there is none. boxes (B, 4): as seen."""
    seen, by_body, by_all = view.seen, np.zeros(len(boxes)), 0.0
    count = len(seen)
    for k in range(count):
        told = _told(view.lines[k], seen[k], view.whitening[k], pose)
        by_all += told
        for b in range(len(boxes)):
            if _inside(boxes[b], seen[k]):
                by_body[b] += told
    lone = by_body.argmax()
    outside = np.ones(count, np.bool_)
    if by_body[lone] >= _ALONE_SHARE * by_all:
        for k in range(count):
            outside[k] = not _inside(boxes[lone], seen[k])
    return outside.nonzero()[0]
