"""Lucas-Kanade: where points of one image are in another, on one level of the pyramids (Bouguet 2000).

The window around a point of the first image is compared with windows in the second. Its gradient, times the
difference of grey levels and summed over the window, is the mismatch; the inverse of the structure tensor
makes a step of it. Grey levels between pixels are interpolated from four pixels, so the sum of gradient times
grey level is a weighted mean of four sums, for the windows at the four whole pixels around. Iterations that
stay between the same pixels share these sums and take no pass over the window. OpenCV's function takes one in
each iteration, and makes the gradient of the whole image first.

Windows are flat arrays, row by row. A row takes stride values, a multiple of the 16 that the processor
handles at a time; the gradient is 0 in what does not belong to the window. Offsets into windows are unsigned
(np.uintp): the compiler then need not check for negative indices, and takes several values at once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, in_place
from vision.fragments.edges import GreyImage

Values = NDArray[np.int16]
FourSums = tuple[float, float, float, float]  # upper left, upper right, lower left, lower right

ITERATIONS = 10
CONVERGED_PX = 0.02  # a shorter step is the last one: far below an end's own sigma
_OSCILLATION_PX = 0.01  # a step that takes back the one before, up to this, is halved, and is the last one
# Minimum of the smaller eigenvalue of the structure tensor, per pixel of the window, in (grey levels / px)^2.
# It is low, so that straight edges pass: along the edge the expectation holds them (optical_flow.py).
MIN_EIGENVALUE = 0.01
_MIN_DETERMINANT = 0.125  # of the structure tensor, a sum over the window
_STRIDE, _WINDOW = 16, 64  # the stride is a multiple of the first, a window of the second
_SHARE_BITS = 15  # of a number between 0 and 1
_EIGHTHS, _EIGHTHS_BITS = 8.0, 3  # grey levels of the first window are in eighths
# Scharr's filter (3, 10, 3) gives 32 times the gradient, and at most 16 times the largest grey level. A sum
# of 41 x 41 products of that with grey levels fits 32 bits.
_SCHARR = 32.0
_NEXT = np.uintp(1)


@in_place
def _load(image: GreyImage, top: int, left: int, rows: int, stride: int, out: Values) -> None:
    """Put rows of stride pixels, from top and left on, into out. Beyond its border the image is mirrored."""
    height, width = image.shape
    if top >= 0 and left >= 0 and top + rows <= height and left + stride <= width:
        for i in range(rows):
            for j in range(stride):
                out[i * stride + j] = image[top + i, left + j]
        return
    for i in range(rows):
        v = abs(top + i)
        v = max(min(v, 2 * (height - 1) - v), 0)
        for j in range(stride):
            u = abs(left + j)
            out[i * stride + j] = image[v, max(min(u, 2 * (width - 1) - u), 0)]


@in_place
def _blend(values: Values, step: np.uintp, share: float, bits: int, count: np.uintp, out: Values) -> None:
    """Put values, interpolated with share towards those step farther on, times 2^bits, into out."""
    far = np.int32(share * (1 << _SHARE_BITS))
    near, shift = np.int32((1 << _SHARE_BITS) - far), np.int32(_SHARE_BITS - bits)
    half = np.int32(1 << (shift - 1))
    for k in range(count):
        both = np.int32(near * np.int32(values[k])) + np.int32(far * np.int32(values[k + step]))
        out[k] = np.int32(both + half) >> shift


@in_place
def _smooth(values: Values, step: np.uintp, bits: int, count: np.uintp, out: Values) -> None:
    """Put 3, 10, 3 times values, which are step apart, divided by 2^bits, into out."""
    half = (1 << bits) >> 1
    for k in range(count):
        out[k] = (3 * (values[k] + values[k + step + step]) + 10 * values[k + step] + half) >> bits


@in_place
def _differ(values: Values, step: np.uintp, bits: int, count: np.uintp, out: Values) -> None:
    """Put the difference of values that are two steps apart, divided by 2^bits, into out."""
    half = (1 << bits) >> 1
    for k in range(count):
        out[k] = (values[k + step + step] - values[k] + half) >> bits


@in_place
def _interpolate(
    values: Values, u: float, v: float, bits: int, stride: int, count: int, work: Values, out: Values
) -> None:
    """Put values at u, v beyond each of count pixels, times 2^bits, into out. work: as long as values."""
    down, wanted = np.uintp(stride), np.uintp(count)
    _blend(values, _NEXT, u, bits, wanted + down, work)
    _blend(work, down, v, 0, wanted, out)


@in_place
def _scharr(values: Values, bits: int, stride: int, count: int, work: Values, gx: Values, gy: Values) -> None:
    """Put Scharr's derivatives of values, divided by 2^bits, into gx and gy, for count pixels.

    values: from one column to the left and one row above these on. work: as long as values.
    """
    down, wanted = np.uintp(stride), np.uintp(count)
    _smooth(values, down, 0, wanted, work)
    _differ(work, _NEXT, bits, wanted, gx)
    _differ(values, down, 0, wanted, work)
    _smooth(work, _NEXT, bits, wanted, gy)


@in_place
def _blank_outside(
    top: int, left: int, rows: int, stride: int, image: GreyImage, gx: Values, gy: Values
) -> None:
    """Set the derivatives gx, gy, in rows of pixels from top, left on, to 0 outside of image."""
    for i in range(rows):
        for j in range(stride):
            if not (0 <= top + i < image.shape[0] and 0 <= left + j < image.shape[1]):
                gx[i * stride + j] = gy[i * stride + j] = 0


@in_place
def _blank(inside: Values, count: np.uintp, values: Values) -> None:
    """Set values to 0 where inside is 0."""
    for k in range(count):
        values[k] *= inside[k]


@in_place
def _sum(gradient: Values, grey: Values, start: np.uintp, count: np.uintp) -> float:
    """Sum of gradient times grey, which begins at start."""
    total = np.int32(0)
    for k in range(count):
        total = np.int32(total + np.int32(np.int32(gradient[k]) * np.int32(grey[k + start])))
    return float(total)


@in_place
def _tensor(gx: Values, gy: Values) -> tuple[float, float, float]:
    """Structure tensor xx, xy, yy: sums of products of the gradient, in (grey levels / px)^2."""
    xx, xy, yy, first, count = 0.0, 0.0, 0.0, np.uintp(0), np.uintp(_WINDOW)
    for begin in range(0, len(gx), _WINDOW):  # the sums of so many products fit 32 bits
        x, y = gx[begin : begin + _WINDOW], gy[begin : begin + _WINDOW]
        xx += _sum(x, x, first, count)
        xy += _sum(x, y, first, count)
        yy += _sum(y, y, first, count)
    return xx / _SCHARR**2, xy / _SCHARR**2, yy / _SCHARR**2


@in_place
def _four_sums(gradient: Values, grey: Values, stride: np.uintp, count: np.uintp) -> FourSums:
    """Sums of gradient times grey for the windows at four neighbouring pixels."""
    return (
        _sum(gradient, grey, np.uintp(0), count),
        _sum(gradient, grey, _NEXT, count),
        _sum(gradient, grey, stride, count),
        _sum(gradient, grey, stride + _NEXT, count),
    )


@in_place
def _between(sums: FourSums, u: float, v: float) -> float:
    """The sum for the window that is u and v beyond the upper left one, by bilinear interpolation."""
    upper = sums[0] + u * (sums[1] - sums[0])
    lower = sums[2] + u * (sums[3] - sums[2])
    result: float = upper + v * (lower - upper)
    return result


@in_place
def _in_reach(top: int, left: int, side: int, image: GreyImage) -> bool:
    """Whether a window overlaps the image."""
    result: bool = -side <= top < image.shape[0] and -side <= left < image.shape[1]
    return result


@in_place
def _inverse(xx: float, xy: float, yy: float, side: int) -> tuple[bool, float, float, float]:
    """Whether a structure tensor can be inverted, and its inverse, for mismatches in the scale of _SCHARR."""
    smaller = 0.5 * (xx + yy - math.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))
    determinant = xx * yy - xy * xy
    usable = smaller >= MIN_EIGENVALUE * side * side and determinant >= _MIN_DETERMINANT
    scale = 1.0 / (_SCHARR * determinant) if usable else 0.0
    return usable, scale * yy, -scale * xy, scale * xx


@in_place
def _follow(
    image: GreyImage,
    u: float,
    v: float,
    side: int,
    stride: int,
    gx: Values,
    gy: Values,
    aim: tuple[float, float],
    inverse: tuple[float, float, float],
    patch: Values,
) -> tuple[bool, float, float]:
    """Move a window in image, from its upper left corner u, v, until it matches. False: it left the image.

    patch: work space.
    """
    down, window, left, top = np.uintp(stride), np.uintp(len(gx)), 0, 0
    last_u, last_v = math.inf, math.inf
    for iteration in range(ITERATIONS):
        if iteration == 0 or math.floor(u) != left or math.floor(v) != top:
            left, top = math.floor(u), math.floor(v)
            if not _in_reach(top, left, side, image):
                return False, u, v
            _load(image, top, left, side + 1, stride, patch)
            sums_x, sums_y = _four_sums(gx, patch, down, window), _four_sums(gy, patch, down, window)
        miss_x = aim[0] - _between(sums_x, u - left, v - top)
        miss_y = aim[1] - _between(sums_y, u - left, v - top)
        du, dv = inverse[0] * miss_x + inverse[1] * miss_y, inverse[1] * miss_x + inverse[2] * miss_y
        u, v = u + du, v + dv
        if du * du + dv * dv <= CONVERGED_PX**2:
            break
        if abs(du + last_u) < _OSCILLATION_PX and abs(dv + last_v) < _OSCILLATION_PX:
            return True, u - 0.5 * du, v - 0.5 * dv
        last_u, last_v = du, dv
    return True, u, v


@compiled("uint8[:, ::1], uint8[:, ::1], float32[:, ::1], float32[:, ::1], boolean[::1], float64, int64")
def search(
    before: GreyImage,
    now: GreyImage,
    pixels: NDArray[np.float32],
    guess: NDArray[np.float32],
    chosen: NDArray[np.bool_],
    scale: float,
    side: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where points of before are in now, searched from guess (N, 2); and which are found, (N,).

    pixels (N, 2): the points; scale times that is in pixels of these images, as guess is. chosen (N,): only
    these are searched. side: of the window, at most 41. A point that is not chosen, or whose window is plain
    or out of the image, stays at its guess.
    """
    stride = -(-(side + 3) // _STRIDE) * _STRIDE
    count = -(-side * stride // _WINDOW) * _WINDOW
    size = count + 4 * stride
    patch, work, grey = np.zeros(size, np.int16), np.zeros(size, np.int16), np.zeros(size, np.int16)
    pixel_gx, pixel_gy = np.zeros(size, np.int16), np.zeros(size, np.int16)
    gx, gy, inside = np.zeros(count, np.int16), np.zeros(count, np.int16), np.zeros(count, np.int16)
    for i in range(side):
        inside[i * stride : i * stride + side] = 1
    there, found = guess.copy(), np.zeros(len(guess), np.bool_)
    first, window, half = np.uintp(stride + 1), np.uintp(count), 0.5 * (side - 1)
    for n in range(len(pixels)):
        if not chosen[n]:
            continue
        u, v = scale * pixels[n, 0] - half, scale * pixels[n, 1] - half
        left, top = math.floor(u), math.floor(v)
        if not _in_reach(top, left, side, before):
            continue
        u, v = u - left, v - top
        _load(before, top - 1, left - 1, side + 3, stride, patch)
        _interpolate(patch, u, v, _EIGHTHS_BITS, stride, count + 2 * stride, work, grey)
        if 0 <= top < before.shape[0] - side and 0 <= left < before.shape[1] - side:
            _scharr(grey, _EIGHTHS_BITS, stride, count, work, gx, gy)
        else:
            # Only the derivatives at pixels of the image count. What is mirrored beyond them would move the
            # ends at the border by up to a tenth of a pixel.
            _scharr(patch, 0, stride, count + stride, work, pixel_gx, pixel_gy)
            _blank_outside(top, left, side + 1, stride, before, pixel_gx, pixel_gy)
            _interpolate(pixel_gx, u, v, 0, stride, count, work, gx)
            _interpolate(pixel_gy, u, v, 0, stride, count, work, gy)
        _blank(inside, window, gx)
        _blank(inside, window, gy)
        usable, xx, xy, yy = _inverse(*_tensor(gx, gy), side)
        if not usable:
            continue
        aim = _sum(gx, grey, first, window) / _EIGHTHS, _sum(gy, grey, first, window) / _EIGHTHS
        found[n], u, v = _follow(
            now, guess[n, 0] - half, guess[n, 1] - half, side, stride, gx, gy, aim, (xx, xy, yy), patch
        )
        if found[n]:
            there[n, 0], there[n, 1] = u + half, v + half
    return there, found
