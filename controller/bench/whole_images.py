"""The paper's chain of OpenCV calls on whole images: the time of a search without any ROI.

Canny, contours, Hough, and forward-backward Lucas-Kanade for as many fragment ends as perception tracks, with
perception's settings and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import FragmentSettings
from hal.types import ColourImage
from vision.fragments.edges import GreyImage, find_edges
from vision.fragments.segments import hough_segments, longest_first


class WholeImages:
    """Keeps the previous image and the fragment ends found in it."""

    def __init__(self, settings: FragmentSettings, stopwatch_ns: Callable[[], int]) -> None:
        self._settings = settings
        self._stopwatch_ns = stopwatch_ns
        self._previous: GreyImage | None = None
        self._ends_px = np.empty((0, 2), np.float32)

    def step(self, colour: ColourImage) -> int:
        """Nanoseconds of the calls on the next image; in the first one there is nothing to track."""
        settings = self._settings
        start_ns = self._stopwatch_ns()
        grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), np.uint8)
        edges = find_edges(grey, 0.5 * (settings.canny_least + settings.canny_most))
        cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        segments_px = hough_segments(edges, settings.min_length_px)
        if self._previous is not None and len(self._ends_px):
            tracked = self._track(self._previous, grey, self._ends_px)
            self._track(grey, self._previous, tracked)
        spent_ns = self._stopwatch_ns() - start_ns
        self._previous = grey
        self._ends_px = longest_first(segments_px)[: settings.max_fragments].reshape(-1, 2)
        return spent_ns

    def _track(self, before: GreyImage, now: GreyImage, pixels: NDArray[np.float32]) -> NDArray[np.float32]:
        side = self._settings.lk_window_px
        tracked, _, _ = cv2.calcOpticalFlowPyrLK(
            before,
            now,
            pixels,
            pixels.copy(),
            winSize=(side, side),
            maxLevel=self._settings.lk_levels,
        )
        return np.asarray(tracked, np.float32)
