"""Low rank and sparse representation (Table 1, fourth row): windowed robust principal component analysis.

The last images, aligned to the newest by homographies, are the columns of a matrix. Its low-rank part is the
background, its sparse part the movers (principal component pursuit by an inexact augmented Lagrange
multiplier; Candes et al. 2011, Lin et al. 2010). It works at an eighth of the resolution; at full resolution
it would take seconds.
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np

from controller.evaluation.methods.baselines import ego_motion
from controller.evaluation.methods.baselines.masks import (
    IdTracker,
    Mask,
    blobs,
    half_depth_m,
    half_grey,
    half_intrinsics,
)
from controller.evaluation.types import MethodOutput
from hal.types import FloatArray, Pose, RgbdFrame

_WINDOW = 16
_MIN_WINDOW = 6
_SHRINK = 4  # on top of the half-size images
_ITERATIONS = 25
_TOLERANCE = 1e-4
_SPARSE_LEVEL = 18.0  # grey levels


class LowRank:
    """Keeps the last images and the homographies that lead to the newest."""

    def __init__(self) -> None:
        ego_motion.seed_ransac()
        self._images: deque[Mask] = deque(maxlen=_WINDOW)
        self._to_newest: deque[FloatArray] = deque(maxlen=_WINDOW)
        self._id_tracker = IdTracker()

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        """Odometry is not used."""
        grey = half_grey(frame)
        if self._images:
            step = ego_motion.homography(self._images[-1], grey)
            if step is None:
                self._images.clear()
                self._to_newest.clear()
            else:
                self._to_newest = deque((step @ matrix for matrix in self._to_newest), maxlen=_WINDOW)
        self._images.append(grey)
        self._to_newest.append(np.eye(3))
        if len(self._images) < _MIN_WINDOW:
            return self._id_tracker.answer([], np.zeros_like(grey))
        mask = self._sparse_mask(grey)
        found = blobs(mask, half_depth_m(frame), half_intrinsics(frame.intrinsics))
        return self._id_tracker.answer(found, mask)

    def _sparse_mask(self, grey: Mask) -> Mask:
        height, width = grey.shape[0] // _SHRINK, grey.shape[1] // _SHRINK
        columns = []
        for image, matrix in zip(self._images, self._to_newest, strict=True):
            # Outside an old image, the newest image fills the gap, so that unknown pixels are not moving.
            warped = grey.copy()
            cv2.warpPerspective(
                image, matrix, (grey.shape[1], grey.shape[0]), dst=warped, borderMode=cv2.BORDER_TRANSPARENT
            )
            small = cv2.resize(warped, (width, height), interpolation=cv2.INTER_AREA)
            columns.append(np.asarray(small, np.float64).ravel())
        sparse = robust_pca(np.stack(columns, axis=1))[:, -1]
        moving = (np.abs(sparse) > _SPARSE_LEVEL).astype(np.uint8).reshape(height, width) * 255
        full = cv2.resize(moving, (grey.shape[1], grey.shape[0]), interpolation=cv2.INTER_NEAREST)
        return np.asarray(full, np.uint8)


def robust_pca(data: FloatArray) -> FloatArray:
    """The sparse part (N, K) of data (N, K), N much larger than K.

    Minimises the nuclear norm of (data - sparse) plus the 1-norm of sparse divided by sqrt(N).
    """
    weight = 1.0 / np.sqrt(max(data.shape))
    scale = _norm(data)
    if scale == 0.0:
        return np.zeros_like(data)
    largest = float(np.sqrt(np.linalg.eigvalsh(_gram(data))[-1]))
    multiplier = data / max(largest, float(np.abs(data).max()) / weight)
    penalty, sparse = 1.25 / largest, np.zeros_like(data)
    for _ in range(_ITERATIONS):
        low = _shrink_singular_values(data - sparse + multiplier / penalty, 1.0 / penalty)
        residual = data - low + multiplier / penalty
        sparse = np.sign(residual) * np.maximum(np.abs(residual) - weight / penalty, 0.0)
        remainder = data - low - sparse
        multiplier = multiplier + penalty * remainder
        penalty *= 1.5
        if _norm(remainder) <= _TOLERANCE * scale:
            break
    return sparse


def _shrink_singular_values(matrix: FloatArray, threshold: float) -> FloatArray:
    """Singular value thresholding through the small Gram matrix (K, K)."""
    squares, vectors = np.linalg.eigh(_gram(matrix))
    values = np.sqrt(np.maximum(squares, 0.0))
    factor = np.where(values > threshold, 1.0 - threshold / np.maximum(values, 1e-12), 0.0)
    return np.asarray(cv2.gemm(matrix, (vectors * factor) @ vectors.T, 1.0, np.empty(0), 0.0), np.float64)


# OpenCV's matrix products stay on one core. NumPy's use several threads, which at this size costs far more
# than the product itself when cores are shared.


def _gram(matrix: FloatArray) -> FloatArray:
    return np.asarray(cv2.mulTransposed(matrix, True), np.float64)


def _norm(matrix: FloatArray) -> float:
    return float(cv2.norm(matrix))
