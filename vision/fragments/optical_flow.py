"""Tracking of the end points into the next image: pyramidal Lucas-Kanade with a forward-backward check.

Most ends are where they are expected, to a fraction of a pixel, but for an error that all of them have in
common: a camera rotation that the odometry does not include. So only scouts are searched coarse to fine: the
ends whose expectation was wrong in the frame before, new ones, and a few of the others. The median error of
the scouts is the common one; the others are then searched in the finest level alone.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import FragmentSettings
from hal.compiled import compiled
from hal.records import record
from vision.fragments import lucas_kanade
from vision.fragments.edges import GreyImage
from vision.numerics.order import median_of

_EXPECTATION_PX = 2.0  # sigma of an expected position, after the median error of all ends has been removed
_RIM_PX = 2  # of the image border: an end this close is about to leave the image
_RELIABLE_PX = 1.0  # maximum error of an expectation with which the finest level alone finds the end
# At most every eighth end is a scout, however reliable its expectation; with few ends more of them, so that
# their median is one of sixteen.
_SCOUT_EVERY, _SAMPLE = 8, 16

# An image, then the same at half the size, at a quarter, and so on.
Pyramid = tuple[GreyImage, ...]


@record(frozen=True, slots=True, eq=False)
class Flow:
    """Where N points are in the new image.

    pixels (N, 2). found (N,): tracked, confirmed by the way back, and inside the image. error_px (N,): of the
    expectation, in u or in v, whichever is larger.
    """

    pixels: NDArray[np.float32]
    found: NDArray[np.bool_]
    error_px: NDArray[np.float32]


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
    last_error_px: NDArray[np.float32],
    settings: FragmentSettings,
) -> Flow:
    """Where pixels (N, 2) of the image before are now, searched from guess (N, 2).

    covariance (N, 3): xx, xy, yy of one flow step. An end may slide along its edge both forward and backward;
    across the edge it has to return. Therefore the forward-backward error is measured in these sigmas.
    last_error_px (N,): error_px of the frame before, inf for a new end.

    The backward search starts where the guess predicts the origin of the point, not at its true origin: a
    search that starts at its goal proves nothing.
    """
    if len(pixels) == 0:
        return Flow(np.empty((0, 2), np.float32), np.empty(0, np.bool_), np.empty(0, np.float32))
    side = settings.lk_window_px
    every = min(max(len(pixels) // _SAMPLE, 1), _SCOUT_EVERY)
    scouts = last_error_px > _RELIABLE_PX
    scouts[::every] = True
    start = _by_common_error(_coarse(before, now, pixels, guess, scouts, side), guess, scouts, every)
    everyone = np.ones(len(pixels), np.bool_)
    there, there_ok = lucas_kanade.search(before[0], now[0], pixels, start, everyone, 1.0, side)
    expected, back_guess, doubtful = _expected(there, guess, pixels)
    back_start = _coarse(now[:2], before[:2], there, back_guess, doubtful, side)
    back, back_ok = lucas_kanade.search(now[0], before[0], there, back_start, there_ok, 1.0, side)
    height, width = now[0].shape
    end, error_px, returned = _confirmed(
        there,
        expected,
        back - pixels,
        covariance,
        settings,
        height,
        width,
    )
    return Flow(end, back_ok & returned, error_px)


def _coarse(
    before: Pyramid,
    now: Pyramid,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    chosen: NDArray[np.bool_],
    side: int,
) -> NDArray[np.float32]:
    """guess (N, 2); those that are chosen (N,) as found in all levels but the finest. pixels: (N, 2)."""
    if not chosen.any():
        return guess
    there = guess * np.float32(0.5 ** len(now))
    for level in range(len(now) - 1, 0, -1):
        there, _ = lucas_kanade.search(
            before[level], now[level], pixels, 2.0 * there, chosen, 0.5**level, side
        )
    return 2.0 * there  # of those that are not chosen it is exactly guess again


@compiled("float32[:, ::1], float32[:, ::1], bool_[::1], int64")
def _by_common_error(
    found: NDArray[np.float32], guess: NDArray[np.float32], scouts: NDArray[np.bool_], every: int
) -> NDArray[np.float32]:
    """Where the finest search starts, (N, 2): found for scouts (N,), else guess with the common error.

    found, guess (N, 2). every: how many ends there are for each that the common error is taken from.
    """
    start = found.copy()
    for axis in range(2):
        error = median_of(found[::every, axis] - guess[::every, axis])
        for n in range(len(guess)):
            if not scouts[n]:
                start[n, axis] = guess[n, axis] + error
    return start


@compiled("float32[:, ::1], float32[:, ::1], float32[:, ::1]")
def _expected(
    there: NDArray[np.float32], guess: NDArray[np.float32], pixels: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Where pixels (N, 2) are expected, (N, 2), and from where they are searched on the way back, (N, 2).

    The median difference between what was found there and guess is the error common to all guesses. Also
    returns (N,) whether an end was found farther than _RELIABLE_PX from where it is expected.
    """
    expected, back_guess = np.empty_like(guess), np.empty_like(guess)
    doubtful = np.zeros(len(guess), np.bool_)
    for axis in range(2):
        error = median_of(there[:, axis] - guess[:, axis])
        for n in range(len(guess)):
            expected[n, axis] = guess[n, axis] + error
            back_guess[n, axis] = there[n, axis] - (expected[n, axis] - pixels[n, axis])
            doubtful[n] |= abs(there[n, axis] - expected[n, axis]) > np.float32(_RELIABLE_PX)
    return expected, back_guess, doubtful


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
    "float32[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1]", FragmentSettings, "int64, int64"
)
def _confirmed(
    there: NDArray[np.float32],
    expected: NDArray[np.float32],
    miss: NDArray[np.float32],
    covariance: NDArray[np.float32],
    settings: FragmentSettings,
    height: int,
    width: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Fuse found and expected positions, and check the ends: the fields of Flow.

    Along a straight edge the search ends anywhere; across it, it ends on the edge. So the found position
    there, with covariance (N, 3), is fused with the expected one, with a sigma of _EXPECTATION_PX. An end is
    confirmed if the forward-backward error miss (N, 2) is small and it is inside the image.
    """
    end, error_px = np.empty_like(there), np.empty(len(there), np.float32)
    good = np.empty(len(there), np.bool_)
    prior = np.float32(_EXPECTATION_PX**2)
    squared = mahalanobis(miss, covariance)
    for n in range(len(there)):
        xx, xy, yy = covariance[n, 0] + prior, covariance[n, 1], covariance[n, 2] + prior
        scale = prior / (xx * yy - xy * xy)
        a, b = there[n, 0] - expected[n, 0], there[n, 1] - expected[n, 1]
        u = expected[n, 0] + scale * (yy * a - xy * b)
        v = expected[n, 1] + scale * (xx * b - xy * a)
        end[n, 0], end[n, 1] = u, v
        error_px[n] = max(abs(u - expected[n, 0]), abs(v - expected[n, 1]))
        inside = u >= _RIM_PX and u <= width - 1 - _RIM_PX and v >= _RIM_PX and v <= height - 1 - _RIM_PX
        most_px = settings.forward_backward_px
        near = abs(miss[n, 0]) <= most_px and abs(miss[n, 1]) <= most_px
        good[n] = inside and near and squared[n] <= np.float32(settings.forward_backward_sigmas**2)
    return end, error_px, good
