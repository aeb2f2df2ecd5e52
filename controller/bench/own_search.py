"""OpenCV's counterpart of perception's own Lucas-Kanade, for the comparison with bare OpenCV calls.

Perception searches with vision/fragments/lucas_kanade.py. For a fair comparison the bare calls have to do the
same work, so each search is recorded as the call of OpenCV that finds the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.bench.opencv_calls import OpenCvCall
from vision.fragments import lucas_kanade
from vision.fragments.edges import GreyImage

_CRITERIA = (
    cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS,
    lucas_kanade.ITERATIONS,
    lucas_kanade.CONVERGED_PX,
)
_MIN_EIGENVALUE = lucas_kanade.MIN_EIGENVALUE / 1024.0  # OpenCV counts in (grey levels / px)^2 / 1024
# The minimum eigenvalue is available anyway; OpenCV would compute its other error measure pixel by pixel.
_FLAGS = cv2.OPTFLOW_USE_INITIAL_FLOW | cv2.OPTFLOW_LK_GET_MIN_EIGENVALS


def by_opencv(
    before: GreyImage,
    now: GreyImage,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    scale: float,
    side: int,
) -> OpenCvCall:
    """The call that finds what lucas_kanade.search finds with these arguments, if all points are chosen."""
    options = {
        "winSize": (side, side),
        "maxLevel": 0,
        "criteria": _CRITERIA,
        "flags": _FLAGS,
        "minEigThreshold": _MIN_EIGENVALUE,
    }
    return OpenCvCall("calcOpticalFlowPyrLK", (before, now, pixels * np.float32(scale), guess), options)


@contextmanager
def recorded_searches(calls: list[OpenCvCall]) -> Iterator[None]:
    """Inside the block, OpenCV's counterpart of each search of perception is appended to calls."""
    own = lucas_kanade.search

    def caught(
        before: GreyImage,
        now: GreyImage,
        pixels: NDArray[np.float32],
        guess: NDArray[np.float32],
        chosen: NDArray[np.bool_],
        scale: float,
        side: int,
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        if chosen.any():  # OpenCV refuses a search for nothing
            calls.append(by_opencv(before, now, pixels[chosen], guess[chosen], scale, side).copied())
        return own(before, now, pixels, guess, chosen, scale, side)

    vars(lucas_kanade)["search"] = caught
    try:
        yield
    finally:
        vars(lucas_kanade)["search"] = own
