"""Tracking of the end points into the next image: pyramidal Lucas-Kanade with a forward-backward check."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import FragmentSettings
from hal.compiled import compiled
from vision.fragments import lucas_kanade
from vision.fragments.edges import GreyImage

_EXPECTATION_PX = 2.0  # sigma of an expected position, after the median error of all ends has been removed
_RIM_PX = 2  # of the image border: an end this close is about to leave the image

# An image, then the same at half the size, at a quarter, and so on.
Pyramid = tuple[GreyImage, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Where N points are in the new image.

    pixels (N, 2). found (N,): tracked, confirmed by the way back, and inside the image.
    """

    pixels: NDArray[np.float32]
    found: NDArray[np.bool_]


def pyramid(grey: GreyImage, settings: FragmentSettings) -> Pyramid:
    """grey and its smaller copies: as many as the settings ask for, none smaller than the search window."""
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

    covariance (N, 3): xx, xy, yy of one flow step. An end may slide along its edge both forward and backward;
    across the edge it has to return. Therefore the forward-backward error is measured in these sigmas.

    The backward search starts where the guess predicts the origin of the point, not at its true origin: a
    search that starts at its goal proves nothing.
    """
    if len(pixels) == 0:
        return Flow(np.empty((0, 2), np.float32), np.empty(0, np.bool_))
    there, there_ok = _search(before, now, pixels, guess, settings.lk_window_px)
    expected, back_guess = _expected(there, guess, pixels)
    back, back_ok = _search(now[:2], before[:2], there, back_guess, settings.lk_window_px)
    height, width = now[0].shape
    end, returned = _confirmed(
        there,
        expected,
        back - pixels,
        covariance,
        settings.forward_backward_sigmas,
        settings.forward_backward_px,
        height,
        width,
    )
    return Flow(end, there_ok & back_ok & returned)


def _search(
    before: Pyramid,
    now: Pyramid,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    window_px: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Search for pixels (N, 2) from guess (N, 2), coarse to fine; positions (N, 2) and whether found (N,)."""
    there, found = guess * np.float32(0.5 ** len(now)), np.zeros(len(guess), np.bool_)
    for level in reversed(range(len(now))):
        there, found = lucas_kanade.search(
            before[level], now[level], pixels, 2.0 * there, 0.5**level, window_px
        )
    return there, found


@compiled("float32[:, ::1], float32[:, ::1], float32[:, ::1]")
def _expected(
    there: NDArray[np.float32], guess: NDArray[np.float32], pixels: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where pixels (N, 2) are expected, (N, 2), and from where they are searched on the way back, (N, 2).

    The median difference between what was found there and guess is an error common to all guesses: a camera
    rotation that they do not include.
    """
    expected, back_guess = np.empty_like(guess), np.empty_like(guess)
    middle, even = len(guess) // 2, len(guess) % 2 == 0
    for axis in range(2):
        ordered = np.sort(there[:, axis] - guess[:, axis])
        error = ordered[middle]
        if even:
            error = np.float32(0.5) * (ordered[middle - 1] + error)
        for n in range(len(guess)):
            expected[n, axis] = guess[n, axis] + error
            back_guess[n, axis] = there[n, axis] - (expected[n, axis] - pixels[n, axis])
    return expected, back_guess


@compiled("float32[:, ::1], float32[:, ::1]")
def mahalanobis(miss: NDArray[np.float32], covariance: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N,) squared Mahalanobis length of miss (N, 2) under covariance (N, 3): xx, xy, yy."""
    result = np.empty(len(miss), np.float32)
    for n in range(len(miss)):
        xx, xy, yy = covariance[n, 0], covariance[n, 1], covariance[n, 2]
        a, b = miss[n, 0], miss[n, 1]
        result[n] = (yy * a * a - np.float32(2.0) * xy * a * b + xx * b * b) / (xx * yy - xy * xy)
    return result


@compiled(
    "float32[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1], float64, float64, int64, int64"
)
def _confirmed(
    there: NDArray[np.float32],
    expected: NDArray[np.float32],
    miss: NDArray[np.float32],
    covariance: NDArray[np.float32],
    most_sigmas: float,
    most_px: float,
    height: int,
    width: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Fuse found and expected positions, and check the ends; positions (N, 2) and whether confirmed (N,).

    Along a straight edge the search ends anywhere; across it, it ends on the edge. So the found position
    there, with covariance (N, 3), is fused with the expected one, with a sigma of _EXPECTATION_PX. An end is
    confirmed if the forward-backward error miss (N, 2) is small and it is inside the image.
    """
    end, good = np.empty_like(there), np.empty(len(there), np.bool_)
    prior = np.float32(_EXPECTATION_PX**2)
    squared = mahalanobis(miss, covariance)
    for n in range(len(there)):
        xx, xy, yy = covariance[n, 0] + prior, covariance[n, 1], covariance[n, 2] + prior
        scale = prior / (xx * yy - xy * xy)
        a, b = there[n, 0] - expected[n, 0], there[n, 1] - expected[n, 1]
        u = expected[n, 0] + scale * (yy * a - xy * b)
        v = expected[n, 1] + scale * (xx * b - xy * a)
        end[n, 0], end[n, 1] = u, v
        inside = u >= _RIM_PX and u <= width - 1 - _RIM_PX and v >= _RIM_PX and v <= height - 1 - _RIM_PX
        near = abs(miss[n, 0]) <= most_px and abs(miss[n, 1]) <= most_px
        good[n] = inside and near and squared[n] <= np.float32(most_sigmas**2)
    return end, good
