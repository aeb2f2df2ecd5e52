"""Anchored points, and where they are seen now: the input of the fit (vision/ego_motion/robust_fit.py)."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.records import record
from hal.types import Flags, FloatArray, Intrinsics, Matrix, Vector
from vision.camera.lens import ray_through, row_delay

_Rows = Annotated[FloatArray, "float64[:, ::1]"]


@record(frozen=True, slots=True, eq=False)
class Anchors:
    """N points seen some frames ago.

    points_m: in the fixed frame, (N, 3).
    range_m: their derivative with respect to depth, (N, 3).
    depth_sigma_m: standard deviation of depth, (N,).
    pixel_cov: covariance xx, xy, yy of where they are seen now, px^2, (N, 3).
    usable: (N,).
    left_out: not usable, but only because their fragment is excluded as one that moves, (N,).
    """

    points_m: Matrix
    range_m: Matrix
    depth_sigma_m: Vector
    pixel_cov: Matrix
    usable: Flags
    left_out: Flags


@record(frozen=True, slots=True, eq=False)
class View:
    """The usable points as arrays for the fit.

    lines: each point and its derivative by depth, (N, 2, 3).
    seen: its position on the plane z = 1, and when its row was read (row_delay), (N, 3).
    whitening: w0, w1, w2, which whiten an error (a, b) on that plane to (w0 a, w1 a + w2 b), of unit
        variance; then the variance of its depth, (N, 4).
    """

    lines: Annotated[FloatArray, "float64[:, :, ::1]"]
    seen: _Rows
    whitening: _Rows

    def with_pixel_variance(self, scale: float) -> View:
        """The same points, with scale times the variance of where they are seen."""
        whitening = self.whitening.copy()
        whitening[:, :3] /= math.sqrt(scale)
        return View(self.lines, self.seen, whitening)


def view_of(anchors: Anchors, pixels: FloatArray, use: NDArray[np.intp], camera: Intrinsics) -> View:
    """The View of the points use (M,), as indices. pixels (N, 2): where the points are seen now."""
    return View(*_view(anchors, pixels, use, camera))


@compiled(Anchors, "float64[:, :], int64[::1]", Intrinsics)
def _view(
    anchors: Anchors,
    pixels: FloatArray,
    use: NDArray[np.intp],
    camera: Intrinsics,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The fields of View."""
    count = len(use)
    lines, seen, whitening = np.empty((count, 2, 3)), np.empty((count, 3)), np.empty((count, 4))
    for k in range(count):
        one = use[k]
        for i in range(3):
            lines[k, 0, i], lines[k, 1, i] = anchors.points_m[one, i], anchors.range_m[one, i]
        seen[k, 0], seen[k, 1] = ray_through(camera, pixels[one, 0], pixels[one, 1])
        seen[k, 2] = row_delay(camera, pixels[one, 1])
        # The inverse of the Cholesky factor.
        uu, uv, vv = anchors.pixel_cov[one]
        first = math.sqrt(uu)
        low = uv / first
        second = math.sqrt(max(vv - low * low, 1e-6))
        whitening[k, 0] = camera.fx / first
        whitening[k, 1] = -camera.fx * low / (first * second)
        whitening[k, 2] = camera.fy / second
        whitening[k, 3] = anchors.depth_sigma_m[one] * anchors.depth_sigma_m[one]
    return lines, seen, whitening
