"""Dense optical flow minus rigid flow: pixels whose flow differs from that of a static scene are moving.

It is not in the paper's Table 1, but it is what most RGB-D methods without learning do today: DIS flow, the
camera's rigid motion by RANSAC over a grid of pixels with depth, and a threshold on the residual flow.
"""

from __future__ import annotations

import cv2
import numpy as np

from controller.evaluation.baselines import ego
from controller.evaluation.baselines.masks import (
    HalfDepth,
    Identities,
    Mask,
    half_depth_m,
    half_grey,
    half_intrinsics,
    things,
)
from controller.evaluation.types import Answer
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
        ego.seed_ransac()
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
        self._before: tuple[Mask, HalfDepth] | None = None
        self._identities = Identities()

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> Answer:
        """Odometry is not used; the images give the motion more accurately."""
        grey, depth_m, k = half_grey(frame), half_depth_m(frame), half_intrinsics(frame.intrinsics)
        before, self._before = self._before, (grey, depth_m)
        if before is None:
            return self._identities.answer([], np.zeros_like(grey))
        # From the current to the previous frame, so that the result is on the pixels of this frame.
        flow = np.asarray(self._flow.calc(grey, before[0], None), np.float64)  # type: ignore[call-overload]  # the stub lacks None
        mask = self._residual(flow, depth_m, k)
        return self._identities.answer(things(mask, depth_m, k), mask)

    def _residual(self, flow: FloatArray, depth_m: HalfDepth, k: Intrinsics) -> Mask:
        height, width = depth_m.shape
        v, u = np.mgrid[0:height, 0:width]
        pixels = np.stack([u, v], axis=2).astype(np.float32)
        grid = np.s_[_GRID_PX // 2 :: _GRID_PX, _GRID_PX // 2 :: _GRID_PX]
        known = depth_m[grid] > 0.0
        points_m = ego.back_project(pixels[grid][known], depth_m[grid][known].astype(np.float64), k)
        seen = (pixels + flow)[grid][known].astype(np.float32)
        motion = ego.rigid_motion(points_m, seen, k, _TOLERANCE_PX)
        if motion is None:
            return np.zeros((height, width), np.uint8)
        flat = pixels.reshape(-1, 2)
        z_m = depth_m.ravel().astype(np.float64)
        rigid = ego.project(motion.apply(ego.back_project(flat, z_m, k)), k) - flat
        miss_px = np.hypot(*(flow.reshape(-1, 2) - rigid).T)
        allowed_px = _BASE_PX + _PER_FLOW * np.hypot(*rigid.T)
        level = np.where(
            (z_m > 0.0) & (miss_px > allowed_px), 1.0 - 0.5 * allowed_px / np.maximum(miss_px, 1e-9), 0.0
        )
        return np.rint(255.0 * np.nan_to_num(level)).astype(np.uint8).reshape(height, width)
