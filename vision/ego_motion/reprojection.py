"""Reprojection error of anchored points, with its derivatives: what vision/ego_motion/camera_motion.py
minimises.

For a given pose of the camera: where points that were anchored some frames ago are predicted in the image,
how far from there they are seen (the residual), and how that changes with each unknown: pose (6) and sweep
(2, the camera's turn while the image was read). All in standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from vision.camera.lens import row_delays


@dataclass(frozen=True, slots=True, eq=False)
class Anchors:
    """Points seen some frames ago: points_m (N, 3) in the fixed frame, range_m (N, 3) their derivative
    with respect to depth, depth_sigma_m (N,), pixel_cov (N, 3): xx, xy, yy of where they are seen now,
    usable (N,) bool."""

    points_m: FloatArray
    range_m: FloatArray
    depth_sigma_m: FloatArray
    pixel_cov: FloatArray
    usable: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The N points that count, coordinate by coordinate: at this size a NumPy call costs more than what it
    computes, so everything of one kind lies in one array. lines (3, 2N): points, then their derivatives
    by depth. seen (2, N): on the plane z = 1; delays (N,) of their rows. whitening (3, N): turns an error
    (a, b) on that plane into (w0 a, w1 a + w2 b), of unit variance."""

    lines: FloatArray
    seen: FloatArray
    delays: FloatArray
    depth_variance: FloatArray
    whitening: FloatArray


def view_of(anchors: Anchors, pixels: FloatArray, use: NDArray[np.intp], camera: Intrinsics) -> View:
    """Of the points use (M,)."""
    count = len(use)
    lines = np.empty((3, 2 * count))
    lines[:, :count] = anchors.points_m.T.take(use, axis=1)
    lines[:, count:] = anchors.range_m.T.take(use, axis=1)
    seen = np.empty((2, count))
    u, v = pixels.T.take(use, axis=1)
    seen[0] = (u - camera.cx) / camera.fx
    seen[1] = (v - camera.cy) / camera.fy
    # The inverse of Cholesky's factor.
    xx, xy, yy = anchors.pixel_cov.T.take(use, axis=1)
    first = np.sqrt(xx)
    low = xy / first
    second = np.sqrt(np.maximum(yy - low * low, 1e-6))
    whitening = np.empty((3, count))
    whitening[0] = camera.fx / first
    whitening[1] = -camera.fx * low / (first * second)
    whitening[2] = camera.fy / second
    return View(
        lines=lines,
        seen=seen,
        delays=row_delays(v, camera),
        depth_variance=np.square(anchors.depth_sigma_m[use]),
        whitening=whitening,
    )


def linearise(view: View, pose: Pose, table: FloatArray) -> tuple[NDArray[np.bool_], FloatArray]:
    """Fill table (10, 3, N). Returns which points lie in front of the camera and what the variance of their
    depth takes off the square of an error along the derivative by depth: (N,), (N,).

    Rows 0 to 5: derivative of the image by a small motion of the camera (rotation, translation); rows 6
    and 7: by its sweep; row 8: seen minus predicted, without sweep; row 9: derivative by depth. First and
    second layer: across and down the image, in sigmas. Third layer: the part along the derivative by depth,
    times its length.
    """
    count = view.seen.shape[1]
    turned = pose.rotation.T @ view.lines
    x, y, z = turned[:, :count] - (pose.rotation.T @ pose.translation_m)[:, None]
    direction = turned[:, count:]
    in_front: NDArray[np.bool_] = z > 0.1
    inverse = 1.0 / np.maximum(z, 0.1)
    x *= inverse
    y *= inverse
    # The camera turns by w and goes by v: a point goes by -(w x p) - v in its frame.
    across, down, along = table[:, 0], table[:, 1], table[:, 2]
    np.multiply(x, y, out=across[0])
    np.negative(across[0], out=down[1])
    np.subtract(-1.0, x * x, out=across[1])
    np.add(1.0, y * y, out=down[0])
    across[2] = y
    np.negative(x, out=down[2])
    np.negative(inverse, out=across[3])
    across[4] = 0.0
    down[3] = 0.0
    down[4] = across[3]
    np.multiply(x, inverse, out=across[5])
    np.multiply(y, inverse, out=down[5])
    np.subtract(view.seen[0], x, out=across[8])
    np.subtract(view.seen[1], y, out=down[8])
    np.multiply(inverse, direction[0] - x * direction[2], out=across[9])
    np.multiply(inverse, direction[1] - y * direction[2], out=down[9])
    np.multiply(across[:2], view.delays, out=across[6:8])
    np.multiply(down[:2], view.delays, out=down[6:8])
    own, mixed, other = view.whitening
    down *= other
    down += across * mixed
    across *= own
    np.multiply(across, across[9], out=along)
    along += down * down[9]
    # Depth's share of the covariance, by Sherman and Morrison: only along the epipolar line.
    shrink = view.depth_variance / (1.0 + view.depth_variance * along[9])
    return in_front, shrink
