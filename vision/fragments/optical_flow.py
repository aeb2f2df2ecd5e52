"""Pyramidal Lucas-Kanade on the end points, with a forward-backward check."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import FragmentSettings
from vision.fragments.edges import GreyImage
from vision.numerics.order import median

_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.02)  # px: far below an end's own sigma
_MIN_EIGENVALUE = 1e-5  # low: straight edges are to pass, and are held by the expectation
# Eigenvalues are at hand; the other error that could be asked for would be worked out pixel by pixel.
_FLAGS = cv2.OPTFLOW_USE_INITIAL_FLOW | cv2.OPTFLOW_LK_GET_MIN_EIGENVALS
_EXPECTATION_PX = 2.0  # one sigma of where an end is expected, once what all have in common is taken off

# An image, then itself at half the size, at a quarter, and so on.
Pyramid = tuple[GreyImage, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """pixels (N, 2) float32 in the new image; found (N,) bool: tracked, came back, still inside."""

    pixels: NDArray[np.float32]
    found: NDArray[np.bool_]


def pyramid(grey: GreyImage, settings: FragmentSettings) -> Pyramid:
    """grey with its smaller copies: no more than the settings ask for, nor smaller than the search window."""
    levels = [grey]
    while len(levels) <= settings.lk_levels:
        if min(levels[-1].shape) < 2 * settings.lk_window_px + 1:
            break
        levels.append(np.asarray(cv2.pyrDown(levels[-1]), np.uint8))
    return tuple(levels)


def track(
    before: Pyramid,
    now: Pyramid,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    covariance: NDArray[np.float32],
    settings: FragmentSettings,
) -> Flow:
    """Where pixels (N, 2) of the image before are now, searched from guess (N, 2).

    covariance (N, 3): xx, xy, yy of one flow step. An end may slide along its edge, there and back alike;
    across the edge it has to return. Therefore the miss is measured in its own sigmas.

    The way back starts from where the guess says that the point came from, not from the point itself:
    a search that starts at its goal proves nothing.
    """
    if len(pixels) == 0:
        return Flow(np.empty((0, 2), np.float32), np.empty(0, np.bool_))
    there, there_ok = _search(before, now, pixels, guess, settings.lk_window_px)
    # What all ends have in common was the guess's own error: a turn of the camera it did not know of.
    expected = guess + median((there - guess).T)
    back_guess = there - (expected - pixels)
    back, back_ok = _search(now[:2], before[:2], there, back_guess, settings.lk_window_px)
    end = _held(there, expected, covariance)
    miss = back - pixels
    height, width = now[0].shape
    found = there_ok & back_ok
    found &= mahalanobis(miss, covariance) <= settings.forward_backward_sigmas**2
    near = np.abs(miss) <= settings.forward_backward_px
    found &= near[:, 0] & near[:, 1]
    u, v = end.T
    found &= (u >= 2.0) & (u <= width - 3) & (v >= 2.0) & (v <= height - 3)
    return Flow(end, found)


def _search(
    before: Pyramid,
    now: Pyramid,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    window_px: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where pixels (N, 2) are found, coarse to fine from guess (N, 2) on, and which are: (N, 2), (N,).

    Level by level: a call for all of them at once would make the pyramids of both images anew, twice a frame.
    """
    there, found = guess * np.float32(0.5 ** len(now)), np.empty((0, 1), np.uint8)
    for level in reversed(range(len(now))):
        ends, status, _ = cv2.calcOpticalFlowPyrLK(
            before[level],
            now[level],
            pixels * np.float32(0.5**level),
            2.0 * there,
            winSize=(window_px, window_px),
            maxLevel=0,
            criteria=_CRITERIA,
            flags=_FLAGS,
            minEigThreshold=_MIN_EIGENVALUE,
        )
        there, found = np.asarray(ends, np.float32), np.asarray(status, np.uint8)
    return there, found[:, 0].astype(np.bool_)


def _held(
    found: NDArray[np.float32], expected: NDArray[np.float32], covariance: NDArray[np.float32]
) -> NDArray[np.float32]:
    """found (N, 2), with the part that the image cannot tell taken from expected (N, 2).

    Along a straight edge a search ends anywhere; across it, it ends on the edge. The two are weighted by
    covariance (N, 3) and by how far off an expectation usually is.
    """
    prior = np.float32(_EXPECTATION_PX**2)
    xx, xy, yy = covariance[:, 0] + prior, covariance[:, 1], covariance[:, 2] + prior
    scale = prior / (xx * yy - xy * xy)
    a, b = found[:, 0] - expected[:, 0], found[:, 1] - expected[:, 1]
    result = np.empty_like(found)
    result[:, 0] = expected[:, 0] + scale * (yy * a - xy * b)
    result[:, 1] = expected[:, 1] + scale * (xx * b - xy * a)
    return result


def mahalanobis(miss: NDArray[np.float32], covariance: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N,) squared length of miss (N, 2) in sigmas of covariance (N, 3)."""
    xx, xy, yy = covariance[:, 0], covariance[:, 1], covariance[:, 2]
    a, b = miss[:, 0], miss[:, 1]
    result: NDArray[np.float32] = (yy * a * a - 2.0 * xy * a * b + xx * b * b) / (xx * yy - xy * xy)
    return result
