"""Dense optical flow minus rigid flow: pixels whose flow differs from that of a static scene are moving.

It is not in the paper's Table 1, but it is what most RGB-D methods without learning do today: DIS flow, the
camera's rigid motion by RANSAC over a grid of pixels with depth, and a threshold on the residual flow.
"""

from __future__ import annotations

import cv2
import numpy as np

from controller.evaluation.methods.baselines import ego_motion
from controller.evaluation.methods.baselines.masks import (
    HalfDepth,
    IdTracker,
    Mask,
    blobs,
    half_depth_m,
    half_grey,
    half_intrinsics,
)
from controller.evaluation.types import MethodOutput
from hal.types import FloatArray, Intrinsics, Pose, RgbdFrame

_GRID_PX = 8
_TOLERANCE_PX = 0.75  # inliers of the rigid motion
# Allowed residual between two frames, in half-size pixels: a constant, and a share of the rigid flow, because
# the errors of depth and flow grow with it.
_BASE_PX = 0.8
_PER_FLOW = 0.08


class DenseFlow:
    """Keeps the image and the depth of the previous frame."""

    def __init__(self) -> None:
        ego_motion.seed_ransac()
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
        self._previous: tuple[Mask, HalfDepth] | None = None
        self._id_tracker = IdTracker()

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        """Odometry is not used; the images give the motion more accurately."""
        grey, depth_m, k = half_grey(frame), half_depth_m(frame), half_intrinsics(frame.intrinsics)
        previous, self._previous = self._previous, (grey, depth_m)
        if previous is None:
            return self._id_tracker.answer([], np.zeros_like(grey))
        # From the current to the previous frame, so that the result is on the pixels of this frame.
        flow = np.asarray(self._flow.calc(grey, previous[0], None), np.float64)  # type: ignore[call-overload]  # the stub lacks None
        mask = self._residual(flow, depth_m, k)
        return self._id_tracker.answer(blobs(mask, depth_m, k), mask)

    def _residual(self, flow: FloatArray, depth_m: HalfDepth, k: Intrinsics) -> Mask:
        height, width = depth_m.shape
        v, u = np.mgrid[0:height, 0:width]
        pixels = np.stack([u, v], axis=2).astype(np.float32)
        grid = np.s_[_GRID_PX // 2 :: _GRID_PX, _GRID_PX // 2 :: _GRID_PX]
        known = depth_m[grid] > 0.0
        points_m = ego_motion.back_project(pixels[grid][known], depth_m[grid][known].astype(np.float64), k)
        tracked_px = (pixels + flow)[grid][known].astype(np.float32)
        motion = ego_motion.rigid_motion(points_m, tracked_px, k, _TOLERANCE_PX)
        if motion is None:
            return np.zeros((height, width), np.uint8)
        flat = pixels.reshape(-1, 2)
        z_m = depth_m.ravel().astype(np.float64)
        rigid = ego_motion.project(motion.apply(ego_motion.back_project(flat, z_m, k)), k) - flat
        residual_px = np.hypot(*(flow.reshape(-1, 2) - rigid).T)
        allowed_px = _BASE_PX + _PER_FLOW * np.hypot(*rigid.T)
        level = np.where(
            (z_m > 0.0) & (residual_px > allowed_px),
            1.0 - 0.5 * allowed_px / np.maximum(residual_px, 1e-9),
            0.0,
        )
        return np.rint(255.0 * np.nan_to_num(level)).astype(np.uint8).reshape(height, width)
