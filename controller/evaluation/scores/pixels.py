"""Scores at pixel level: the pixels that a method calls moving against the true mask of the moving bodies.

A method without a mask of its own claims, for each obstacle, the pixels inside its box whose measured depth
lies within the obstacle's visible surface. Pixels with a true depth of up to 10 m count. Those of bodies that
move at 0.1 m/s or more are moving. Those of slower bodies that creep or turn on the spot count neither way;
the caller lists them as excused (controller/evaluation/run_sequence.py).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from controller.evaluation.scores.totals import PixelCounts
from controller.evaluation.simulated_set.eligibility import MAX_DISTANCE_M
from controller.evaluation.types import DetectedObject
from hal.types import RgbdFrame

STEP_PX = 2  # every second pixel of every second row is judged
# Pixels belong to an obstacle within a margin of depth around its surface. The second part grows with the
# square of the depth: two standard deviations of a real RealSense camera.
_DEPTH_MARGIN_M = 0.15
_DEPTH_MARGIN_PER_M2 = 0.015


def claimed_levels(frame: RgbdFrame, detections: Sequence[DetectedObject]) -> NDArray[np.uint8]:
    """(H / 2, W / 2) levels 0..255: the greatest confidence of the detections that claim the pixel."""
    depth_m = frame.depth[::STEP_PX, ::STEP_PX].astype(np.float32) * np.float32(frame.depth_scale_m)
    levels = np.zeros(depth_m.shape, np.uint8)
    height, width = depth_m.shape
    for detection in sorted(detections, key=lambda detection: detection.confidence):
        if not np.isfinite(detection.box).all() or not np.isfinite(detection.position_m[2]):
            continue
        u0, v0, u1, v1 = detection.box
        left, right = _span(u0, u1, width)
        top, bottom = _span(v0, v1, height)
        z_m = float(detection.position_m[2])
        half_m = (
            0.5 * float(np.nan_to_num(detection.extent_m[2]))
            + _DEPTH_MARGIN_M
            + _DEPTH_MARGIN_PER_M2 * z_m**2
        )
        inside = np.abs(depth_m[top:bottom, left:right] - z_m) <= half_m
        levels[top:bottom, left:right][inside] = round(255 * min(max(detection.confidence, 0.0), 1.0))
    return levels


def _span(first_px: float, last_px: float, limit: int) -> tuple[int, int]:
    first = int(np.clip(np.ceil(first_px / STEP_PX), 0, limit))
    return first, int(np.clip(np.floor(last_px / STEP_PX) + 1, first, limit))


def count_pixels(
    levels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
    depth_m: NDArray[np.float32],
    moving: Collection[int],
    excused: Collection[int],
) -> PixelCounts:
    """Histograms of the levels, for moving pixels and for the rest.

    levels, instances, depth_m: (H / 2, W / 2) levels from claimed_levels(), body ids, true depth.
    moving, excused: ids of bodies that move, and of those whose pixels do not count.
    """
    judged = (depth_m > 0.0) & (depth_m <= MAX_DISTANCE_M)
    moving_pixels = judged & np.isin(instances, list(moving))
    static_pixels = judged & ~moving_pixels & ~np.isin(instances, list(excused))
    return PixelCounts(
        np.bincount(levels[moving_pixels], minlength=256).astype(np.int64),
        np.bincount(levels[static_pixels], minlength=256).astype(np.int64),
    )
