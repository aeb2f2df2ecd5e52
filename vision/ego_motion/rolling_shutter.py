"""Rolling shutter: the rows of an image are read one after another, so a shaking camera distorts the image.

The colour sensor of a D435i has a rolling shutter; such sensors take some 10 to 30 ms from their first row to
their last. The robot's crawler tracks shake the camera by a quarter of a radian per second and more. That
stretches and shrinks the image by pixels, and the length ratio (vision/motion/velocities.py) would take this
for speed.

The sweep is how far the camera turned about x and y while one image was read.
vision/ego_motion/camera_motion.py estimates it for each image, and straight_rays corrects pixels by it. The
prior of the sweep follows from the rate of turn and the read-out time of the image. No recording states the
read-out time, so ReadOut learns it. For a global shutter ReadOut learns 0, and nothing is corrected.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray, Intrinsics
from vision.camera.lens import row_delay
from vision.ego_motion.camera_motion import CameraEstimate
from vision.ego_motion.motion_prior import SweepPrior

_UNKNOWN_S = 0.015  # one sigma of the read-out time before anything is learned
_MAX_READ_OUT_S = 0.035  # maximum read-out time: about the interval of frames
_MEMORY = 0.98  # per frame: old information decays, so that mistakes made at the start fade
_OTHER_BENDS_RAD = 0.7e-3  # one sigma of distortions of the image by other causes
_MIN_SWEEP_RAD = 1e-9  # practically 0, but avoids a division by 0
_RATE_MEMORY = 0.9  # per frame: decay of the fastest rate of turn, since vibration varies between frames


def straight_rays(pixels: NDArray[np.float32], camera: Intrinsics, sweep_rad: FloatArray) -> FloatArray:
    """(N, 3) points at z = 1 m behind pixels (N, 2), as if all rows had been read with the middle one.

    sweep_rad (2,): how far the camera turned about x and y while the image was read.
    """
    return _straightened(pixels, camera, sweep_rad).T


@compiled("float32[:, :]", Intrinsics, "float64[:]")
def _straightened(pixels: NDArray[np.float32], camera: Intrinsics, sweep_rad: FloatArray) -> FloatArray:
    """As straight_rays, (3, N)."""
    result = np.ones((3, len(pixels)))
    cx, cy = np.float32(camera.cx), np.float32(camera.cy)
    fx, fy = np.float32(camera.fx), np.float32(camera.fy)
    for k in range(len(pixels)):
        # As rays in vision/camera/lens.py, in single precision.
        x, y = np.float64((pixels[k, 0] - cx) / fx), np.float64((pixels[k, 1] - cy) / fy)
        delay = row_delay(camera, np.float64(pixels[k, 1]))
        about_x, about_y = sweep_rad[0] * delay, sweep_rad[1] * delay
        # Derivatives by a small rotation, as in vision/ego_motion/robust_fit.py.
        result[0, k] = x - (about_x * x * y - about_y * (1.0 + x * x))
        result[1, k] = y - (about_x * (1.0 + y * y) - about_y * x * y)
    return result


class ReadOut:
    """Learns the read-out time of an image from its distortion (bend) while the camera pitches.

    Least squares of the bend over the rate of turn at that image, with a prior of 0 +- 15 ms. Only pitch is
    used: vibration alternates, while a steady turn distorts all images alike, which cannot be observed.
    """

    def __init__(self, vibration_radps: float) -> None:
        """vibration_radps: assumed rate of turn before any is observed."""
        self._rates_radps = np.full(2, vibration_radps)
        self._information = 0.0
        self._weighted_sum = 0.0
        self._bend: tuple[float, float, float, float] | None = None

    @property
    def seconds(self) -> float:
        """From the first row to the last: the estimate less one sigma, 0 for a global shutter."""
        estimate_s, sigma_s = self._estimate()
        return min(max(estimate_s - sigma_s, 0.0), _MAX_READ_OUT_S)

    def _estimate(self) -> tuple[float, float]:
        """The read-out time that was learned, and one sigma of it, in seconds."""
        information = self._information + 1.0 / _UNKNOWN_S**2
        return self._weighted_sum / information, 1.0 / math.sqrt(information)

    def sweep(self) -> SweepPrior:
        """The prior of how far the camera turns about x and y while the next image is read."""
        estimate_s, sigma_s = self._estimate()
        max_s = min(max(estimate_s, 0.0) + sigma_s, _MAX_READ_OUT_S)
        return SweepPrior(
            _MIN_SWEEP_RAD + self.seconds * self._rates_radps, _MIN_SWEEP_RAD + max_s * self._rates_radps
        )

    def learn(self, found: CameraEstimate, turn_rad: FloatArray, dt_s: float) -> None:
        """Learn from an image.

        found: the estimate for this image. turn_rad (3,): the camera's rotation since the frame before, dt_s
        ago. The rate of turn at an image follows one frame later, from the rotations before and after it.
        """
        if self._bend is not None:
            bend_rad, variance, before_rad, before_s = self._bend
            rate = (before_rad + float(turn_rad[0])) / (before_s + dt_s)
            weight = 1.0 / (variance + _OTHER_BENDS_RAD**2)
            self._weighted_sum = _MEMORY * self._weighted_sum + weight * bend_rad * rate
            self._information = _MEMORY * self._information + weight * rate * rate
        self._bend = None
        if found.visual:
            self._bend = float(found.bend_rad[0]), float(found.bend_variance[0]), float(turn_rad[0]), dt_s
        self._rates_radps = np.maximum(_RATE_MEMORY * self._rates_radps, np.abs(turn_rad[:2]) / dt_s)

    def forget_last(self) -> None:
        """Forget the bend of the last image: the next image does not follow it."""
        self._bend = None
