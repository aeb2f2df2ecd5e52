"""The camera's ego-motion for the baselines: a homography, or a rigid motion from depth."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.evaluation.methods.baselines.masks import HalfDepth, Mask
from hal.types import FloatArray, Intrinsics, Pose

Points = NDArray[np.float32]

_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01)
_MAX_FORWARD_BACKWARD_PX = 1.0  # greatest error of the forward-backward check
_MIN_POINTS = 8
_SEED = 20200127
_MIN_CORNER_DISTANCE_PX = 7  # least distance of two corners


def seed_ransac() -> None:
    """Seed OpenCV's random generator of this thread, which RANSAC draws from, for reproducible results."""
    cv2.setRNGSeed(_SEED)


def corners(grey: Mask, count: int, existing: Points | None = None) -> Points:
    """(N, 2) corners (good features to track), at most count; none near the points in existing."""
    mask = None
    if existing is not None and len(existing):
        mask = np.full(grey.shape, 255, np.uint8)
        for u, v in np.rint(existing).astype(int):
            cv2.circle(mask, (int(u), int(v)), _MIN_CORNER_DISTANCE_PX, 0, -1)
    found: object = cv2.goodFeaturesToTrack(grey, count, 0.01, _MIN_CORNER_DISTANCE_PX, mask=mask)
    return np.empty((0, 2), np.float32) if found is None else np.asarray(found, np.float32).reshape(-1, 2)


def track_points(before: Mask, now: Mask, points: Points) -> tuple[Points, NDArray[np.bool_]]:
    """Track points by pyramidal Lucas-Kanade with a forward-backward check: (N, 2), and found (N,)."""
    if len(points) == 0:
        return points, np.empty(0, np.bool_)
    shaped = points.reshape(-1, 1, 2)
    options = {"winSize": (15, 15), "maxLevel": 3, "criteria": _CRITERIA}
    tracked, tracked_ok, _ = cv2.calcOpticalFlowPyrLK(before, now, shaped, None, **options)  # type: ignore[call-overload]  # the stub lacks None
    back, back_ok, _ = cv2.calcOpticalFlowPyrLK(now, before, tracked, None, **options)  # type: ignore[call-overload]  # the stub lacks None
    close = np.hypot(*(back.reshape(-1, 2) - points).T) <= _MAX_FORWARD_BACKWARD_PX
    found = (tracked_ok.ravel() == 1) & (back_ok.ravel() == 1) & close
    return np.asarray(tracked, np.float32).reshape(-1, 2), found


def homography(before: Mask, now: Mask) -> FloatArray | None:
    """(3, 3) from the previous image to the current one, by RANSAC over tracked corners; None if it fails."""
    start = corners(before, 300)
    end, found = track_points(before, now, start)
    if np.count_nonzero(found) < _MIN_POINTS:
        return None
    matrix: object = cv2.findHomography(start[found], end[found], cv2.RANSAC, 2.0)[0]
    return None if matrix is None else np.asarray(matrix, np.float64)


def back_project(points: Points, z_m: FloatArray, k: Intrinsics) -> FloatArray:
    """Pixels (N, 2) with depth z_m (N,) to points (N, 3) in the optical frame."""
    x = (points[:, 0] - k.cx) / k.fx * z_m
    y = (points[:, 1] - k.cy) / k.fy * z_m
    return np.stack([x, y, z_m], axis=1)


def depth_at(points: Points, depth_m: HalfDepth) -> FloatArray:
    """(N,) depth at the nearest pixel, 0 where there is none."""
    height, width = depth_m.shape
    u = np.clip(np.rint(points[:, 0]).astype(int), 0, width - 1)
    v = np.clip(np.rint(points[:, 1]).astype(int), 0, height - 1)
    return np.asarray(depth_m[v, u], np.float64)


def rigid_motion(points_m: FloatArray, pixels: Points, k: Intrinsics, tolerance_px: float) -> Pose | None:
    """Pose of the previous camera in the current one (p_now = motion.apply(p_before)), by RANSAC and PnP.

    points_m: (N, 3) in the previous camera.
    pixels: (N, 2) where they are seen now.
    None if there are too few inliers.
    """
    if len(points_m) < _MIN_POINTS:
        return None
    matrix = np.array([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]])
    ok, rotation, translation, found = cv2.solvePnPRansac(
        points_m, pixels.astype(np.float64), matrix, None,
        iterationsCount=100, reprojectionError=tolerance_px, flags=cv2.SOLVEPNP_EPNP,
    )  # fmt: skip
    inliers: object = found
    if not ok or inliers is None or len(found) < _MIN_POINTS:
        return None
    inlier_index = np.asarray(found).ravel()
    rotation, translation = cv2.solvePnPRefineLM(
        points_m[inlier_index],
        pixels[inlier_index].astype(np.float64),
        matrix,
        np.zeros(4),
        rotation,
        translation,
    )
    return Pose(
        np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(translation, np.float64).ravel()
    )


def project(points_m: FloatArray, k: Intrinsics) -> FloatArray:
    """Points (N, 3) to pixels (N, 2); NaN behind the camera."""
    z = np.where(points_m[:, 2] > 0.05, points_m[:, 2], np.nan)
    return np.stack([k.fx * points_m[:, 0] / z + k.cx, k.fy * points_m[:, 1] / z + k.cy], axis=1)
