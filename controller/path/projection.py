"""Where points are along a path, and how far beside it: on pieces of constant curvature, in closed form.

Where all that is looked at is straight, without a search; else from the nearest of samples 0.25 m apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controller.path.path_pieces import EXTENSION_M, Piece
from hal.compiled import compiled, inlined
from hal.types import FloatArray

# s_m, x_m, y_m, heading_rad and curvature_1pm of where the pieces begin, (P,) each.
Chain = tuple[FloatArray, ...]

_SAMPLE_M = 0.25
_ROUNDS = 2
_STRAIGHT_1PM = 1e-7
# Near the centre of a bend "along the path" loses its sense; such a point is beside it, far inside.
_INNERMOST = 0.05


class Projection:
    """Of the path that consists of pieces, the first and last of which are straight extensions; poses tells
    x_m, y_m and heading_rad (S,) of it at s_m (S,)."""

    def __init__(
        self,
        pieces: list[Piece],
        poses: Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
    ) -> None:
        self._chain: Chain = (
            np.array([piece.s_m for piece in pieces]),
            np.array([piece.x_m for piece in pieces]),
            np.array([piece.y_m for piece in pieces]),
            np.array([piece.heading_rad for piece in pieces]),
            np.array([piece.curvature_1pm for piece in pieces]),
        )
        samples = np.arange(-EXTENSION_M, pieces[-1].s_m + EXTENSION_M + _SAMPLE_M, _SAMPLE_M)
        self._sample_x, self._sample_y, _ = poses(samples)
        # Straight on from a piece without a bend to the next one: how far that goes.
        self._straight_to = np.arange(len(pieces))
        for k in range(len(pieces) - 2, -1, -1):
            if pieces[k].curvature_1pm == 0.0 == pieces[k + 1].curvature_1pm:
                self._straight_to[k] = self._straight_to[k + 1]

    def project(self, x_m: float, y_m: float, low_m: float, high_m: float) -> tuple[float, float, float]:
        """s_m, d_m and the path's heading_rad of a point that is looked for from low_m to high_m."""
        return _project(self._chain, self._sample_x, self._sample_y, EXTENSION_M, x_m, y_m, low_m, high_m)

    def locate(
        self,
        points_m: FloatArray,
        velocity_mps: FloatArray,
        times_s: FloatArray,
        from_s_m: float,
        to_s_m: float,
    ) -> FloatArray:
        """(3, N, K) s_m, d_m and the path's heading_rad, times_s (K,) from now, of what is at points_m (N, 2)
        and goes on with velocity_mps (N, 2), nearest to the part from_s_m..to_s_m."""
        return _locate(
            self._chain,
            self._straight_to,
            self._sample_x,
            self._sample_y,
            EXTENSION_M,
            points_m,
            velocity_mps,
            times_s,
            from_s_m,
            to_s_m,
        )


@inlined
def _samples_from_to(low_m: float, high_m: float, extension_m: float) -> tuple[int, int]:
    """The numbers of the first sample and behind the last one; at least one."""
    first = math.ceil((low_m + extension_m) / _SAMPLE_M)
    return first, max(int((high_m + extension_m) / _SAMPLE_M), first) + 1


@inlined
def _piece_at(s_m: float, starts: FloatArray) -> int:
    """The last piece that begins at s_m or before; else the first one."""
    k = len(starts) - 1
    while k > 0 and starts[k] > s_m:
        k -= 1
    return k


@inlined
def _seen_from(chain: Chain, s_m: float, x_m: float, y_m: float) -> tuple[float, float, float, float]:
    """A point ahead and to the left of the path's pose at s_m; the heading and curvature there."""
    starts, xs, ys, headings, bends = chain
    k = _piece_at(s_m, starts)
    along = s_m - starts[k]
    half_turn = 0.5 * bends[k] * along
    chord = along * (math.sin(half_turn) / half_turn if abs(half_turn) > _STRAIGHT_1PM else 1.0)
    middle = headings[k] + half_turn
    dx = x_m - xs[k] - chord * math.cos(middle)
    dy = y_m - ys[k] - chord * math.sin(middle)
    heading = middle + half_turn
    cos, sin = math.cos(heading), math.sin(heading)
    return dx * cos + dy * sin, dy * cos - dx * sin, heading, bends[k]


@inlined
def _nearest(
    chain: Chain,
    sample_x: FloatArray,
    sample_y: FloatArray,
    first: int,
    last: int,
    x_m: float,
    y_m: float,
    low_m: float,
    high_m: float,
) -> tuple[float, float, float]:
    """Path coordinates of a point between low_m and high_m along the path, and the path's heading there.

    From the nearest of the samples first..last, on the circle that the path is there: exact but for the steps
    of a blend, and those take a second round.
    """
    nearest, least = first, math.inf
    for k in range(first, min(last, len(sample_x))):
        dx, dy = x_m - sample_x[k], y_m - sample_y[k]
        away = dx * dx + dy * dy
        if away < least:
            nearest, least = k, away
    starts_m = chain[0]
    s_m = starts_m[0] + nearest * _SAMPLE_M
    ahead, left, heading, bend = _seen_from(chain, s_m, x_m, y_m)
    for _ in range(_ROUNDS):
        step = ahead
        if abs(bend) >= _STRAIGHT_1PM:
            step = math.atan2(bend * ahead, max(1.0 - bend * left, _INNERMOST)) / bend
        before_m, s_m = s_m, min(max(s_m + step, low_m), high_m)
        if s_m == before_m:
            break
        ahead, left, heading, bend = _seen_from(chain, s_m, x_m, y_m)
    return s_m, math.copysign(math.hypot(ahead, left), left), heading


@compiled(
    "UniTuple(float64[::1], 5), float64[::1], float64[::1], float64, float64, float64, float64, float64"
)
def _project(
    chain: Chain,
    sample_x: FloatArray,
    sample_y: FloatArray,
    extension_m: float,
    x_m: float,
    y_m: float,
    low_m: float,
    high_m: float,
) -> tuple[float, float, float]:
    """project() of a chain that is extended so far at either end."""
    first, last = _samples_from_to(low_m, high_m, extension_m)
    return _nearest(chain, sample_x, sample_y, max(first, 0), last, x_m, y_m, low_m, high_m)


@inlined
def _on_line(
    line: tuple[float, float, float, float, float], x_m: float, y_m: float, low_m: float, high_m: float
) -> tuple[float, float]:
    """s_m and d_m where all that is looked at lies on a line: s_m, x_m and y_m of where it begins, the cosine
    and sine of where it leads."""
    line_s_m, line_x_m, line_y_m, cos, sin = line
    dx, dy = x_m - line_x_m, y_m - line_y_m
    along, left = dx * cos + dy * sin + line_s_m, dy * cos - dx * sin
    s_m = min(max(along, low_m), high_m)
    return s_m, math.copysign(math.hypot(along - s_m, left), left)


@compiled(
    "UniTuple(float64[::1], 5), int64[::1], float64[::1], float64[::1], float64,"
    "float64[:, :], float64[:, :], float64[:], float64, float64"
)
def _locate(
    chain: Chain,
    straight_to: NDArray[np.int64],
    sample_x: FloatArray,
    sample_y: FloatArray,
    extension_m: float,
    points_m: FloatArray,
    velocity_mps: FloatArray,
    times_s: FloatArray,
    from_s_m: float,
    to_s_m: float,
) -> FloatArray:
    """locate() on a chain; straight_to (P,): up to which piece it is straight from the beginning of each."""
    starts, xs, ys, headings, bends = chain
    end_m = starts[-1] + extension_m
    low_m = min(max(from_s_m, -extension_m), end_m - _SAMPLE_M)
    high_m = min(max(to_s_m, low_m + _SAMPLE_M), end_m)
    piece = _piece_at(low_m, starts)
    straight = bends[piece] == 0.0 and straight_to[piece] >= _piece_at(high_m, starts)
    heading = headings[piece]
    line = starts[piece], xs[piece], ys[piece], math.cos(heading), math.sin(heading)
    first, last = _samples_from_to(low_m, high_m, extension_m)
    located = np.empty((3, len(points_m), len(times_s)))
    for k in range(len(points_m)):
        for j in range(len(times_s)):
            x = points_m[k, 0] + velocity_mps[k, 0] * times_s[j]
            y = points_m[k, 1] + velocity_mps[k, 1] * times_s[j]
            if straight:
                located[0, k, j], located[1, k, j] = _on_line(line, x, y, low_m, high_m)
                located[2, k, j] = heading
            else:
                located[:, k, j] = _nearest(chain, sample_x, sample_y, first, last, x, y, low_m, high_m)
    return located
