"""Background modelling (Table 1, first row): MOG2 on images whose camera motion is removed by homographies.

A homography is exact only for a distant or flat scene. Near objects show parallax and are taken for movers.
This is the weakness that the paper's table names ("not good for free camera motion").
"""

from __future__ import annotations

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

_HISTORY = 30  # frames
_VARIANCE = 25.0  # threshold on the squared Mahalanobis distance of a pixel from the background
_LEARNING_RATE = 0.05
_WARM_UP_FRAMES = 4
_MIN_OVERLAP = 0.6  # least share of the reference image still in view; below it the model starts anew


class BackgroundModel:
    """Keeps the model in a reference image. Each frame is warped to it, and the mask is warped back."""

    def __init__(self) -> None:
        ego_motion.seed_ransac()
        self._previous: Mask | None = None
        self._to_reference: FloatArray = np.eye(3)
        self._id_tracker = IdTracker()
        self._start_model()

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        """Odometry is not used."""
        grey = half_grey(frame)
        if self._previous is not None:
            step = ego_motion.homography(self._previous, grey)
            if step is None or abs(np.linalg.det(step)) < 1e-6:
                self._restart()
            else:
                self._to_reference = self._to_reference @ np.linalg.inv(step)
        self._previous = grey
        size = (grey.shape[1], grey.shape[0])
        covered = cv2.warpPerspective(np.full_like(grey, 255), self._to_reference, size)
        if float(np.count_nonzero(covered)) < _MIN_OVERLAP * covered.size:
            self._restart()
            covered = np.full_like(grey, 255)
        # Outside the frame the model gets its own background image, so that it learns nothing there.
        warped = cv2.warpPerspective(grey, self._to_reference, size)
        background = self._model.getBackgroundImage() if self._age else warped
        warped = np.where(covered == 255, warped, background)
        moving = self._model.apply(warped, learningRate=1.0 if self._age == 0 else _LEARNING_RATE)
        self._age += 1
        if self._age <= _WARM_UP_FRAMES:
            return self._id_tracker.answer([], np.zeros_like(grey))
        moving = np.where(covered == 255, moving, 0).astype(np.uint8)
        back = cv2.warpPerspective(moving, self._to_reference, size, flags=cv2.WARP_INVERSE_MAP)
        mask = np.where(back > 127, 255, 0).astype(np.uint8)
        found = blobs(mask, half_depth_m(frame), half_intrinsics(frame.intrinsics))
        return self._id_tracker.answer(found, mask)

    def _restart(self) -> None:
        self._to_reference = np.eye(3)
        self._start_model()

    def _start_model(self) -> None:
        self._model = cv2.createBackgroundSubtractorMOG2(_HISTORY, _VARIANCE, detectShadows=False)
        self._age = 0
