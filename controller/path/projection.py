"""Path coordinates of points: how far along a path they are, and how far beside it.

They are computed in closed form on pieces of constant curvature. Where the part of the path in question is
straight, no search is needed; else it starts from the nearest of samples 0.25 m apart.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from controller.path.path_pieces import EXTENSION_M, Piece, along_arc
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.types import FloatArray, Integers

# s_m, x_m, y_m, heading_rad and curvature_1pm of the pieces at their beginnings, (P,) each.
Chain = Annotated[tuple[FloatArray, ...], "UniTuple(float64[::1], 5)"]
Samples = Annotated[FloatArray, "float64[::1]"]

_SAMPLE_M = 0.25
_NEWTON_ROUNDS = 2
_STRAIGHT_1PM = 1e-7
# Near the centre of a bend "along the path" has no meaning. Such a point counts as no nearer to the centre
# than this share of the radius.
_MIN_RADIUS_SHARE = 0.05

_along_arc = inlined(along_arc)


class Projection:
    """Projects points onto a path, and gives the path's poses.

    chain: the pieces of the path; the first and the last are straight extensions.
    straight_to: (P,) for each straight piece, index of the last one of the unbroken row of straight pieces
        from it on.
    sample_x, sample_y: (S,) points of the path, one every _SAMPLE_M.
    """

    chain: Chain
    straight_to: Integers
    sample_x: Samples
    sample_y: Samples

    def __init__(self, pieces: list[Piece]) -> None:
        self.chain = (
            np.array([piece.s_m for piece in pieces]),
            np.array([piece.x_m for piece in pieces]),
            np.array([piece.y_m for piece in pieces]),
            np.array([piece.heading_rad for piece in pieces]),
            np.array([piece.curvature_1pm for piece in pieces]),
        )
        samples = np.arange(-EXTENSION_M, pieces[-1].s_m + EXTENSION_M + _SAMPLE_M, _SAMPLE_M)
        self.sample_x, self.sample_y, _ = self.poses(samples)
        self.straight_to = np.arange(len(pieces))
        for k in range(len(pieces) - 2, -1, -1):
            if pieces[k].curvature_1pm == 0.0 == pieces[k + 1].curvature_1pm:
                self.straight_to[k] = self.straight_to[k + 1]

    def poses(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x_m, y_m and heading_rad (not wrapped) of the path at s_m (S,), (S,) each."""
        x_m, y_m, heading_rad = _poses(self.chain, s_m)
        return x_m, y_m, heading_rad

    def project(self, x_m: float, y_m: float, low_m: float, high_m: float) -> tuple[float, float, float]:
        """s_m, d_m and the path's heading_rad of a point, searched from low_m to high_m along the path."""
        return _project(self, x_m, y_m, low_m, high_m)

    def locate(
        self,
        points_m: FloatArray,
        velocity_mps: FloatArray,
        times_s: FloatArray,
        from_s_m: float,
        to_s_m: float,
    ) -> FloatArray:
        """(3, N, K) s_m, d_m and the path's heading_rad of moving points, times_s (K,) from now.

        They move from points_m (N, 2) with constant velocity_mps (N, 2). Searched from from_s_m to to_s_m.
        """
        return _locate(self, points_m, velocity_mps, times_s, from_s_m, to_s_m)


@inlined
def _samples_from_to(low_m: float, high_m: float) -> tuple[int, int]:
    """Range of sample indices from low_m to high_m: the first, and one past the last; at least one sample."""
    first = math.ceil((low_m + EXTENSION_M) / _SAMPLE_M)
    return first, max(int((high_m + EXTENSION_M) / _SAMPLE_M), first) + 1


@inlined
def _piece_at(s_m: float, starts: FloatArray) -> int:
    """Index of the last piece that begins at s_m or before it; else of the first one."""
    k = len(starts) - 1
    while k > 0 and starts[k] > s_m:
        k -= 1
    return k


@inlined
def _pose_on(chain: Chain, s_m: float) -> tuple[float, float, float, float]:
    """x_m, y_m, heading_rad (not wrapped) and curvature of the path at s_m."""
    starts, xs, ys, headings, bends = chain
    k = _piece_at(s_m, starts)
    x_m, y_m, heading = _along_arc(xs[k], ys[k], headings[k], bends[k], s_m - starts[k])
    return x_m, y_m, heading, bends[k]


@compiled("UniTuple(float64[::1], 5), float64[:]")
def _poses(chain: Chain, s_m: FloatArray) -> FloatArray:
    """(3, S) x_m, y_m and heading_rad of the path at s_m (S,)."""
    poses = np.empty((3, len(s_m)))
    for k in range(len(s_m)):
        poses[0, k], poses[1, k], poses[2, k], _ = _pose_on(chain, s_m[k])
    return poses


@inlined
def _seen_from(chain: Chain, s_m: float, x_m: float, y_m: float) -> tuple[float, float, float, float]:
    """Where a point is relative to the path's pose at s_m: ahead, left; and heading and curvature there."""
    there_x_m, there_y_m, heading, bend = _pose_on(chain, s_m)
    ahead, left = along_and_left(x_m - there_x_m, y_m - there_y_m, math.cos(heading), math.sin(heading))
    return ahead, left, heading, bend


@inlined
def _nearest(
    path: Projection, first: int, last: int, x_m: float, y_m: float, low_m: float, high_m: float
) -> tuple[float, float, float]:
    """Path coordinates of a point, with s_m from low_m to high_m, and the path's heading there.

    Starts from the nearest sample of first..last (exclusive) and projects onto the circle that the path is
    there. That is exact on one piece; across the short pieces of a blend a second round is needed.
    """
    chain, nearest, least = path.chain, first, math.inf
    for k in range(first, min(last, len(path.sample_x))):
        dx, dy = x_m - path.sample_x[k], y_m - path.sample_y[k]
        away = dx * dx + dy * dy
        if away < least:
            nearest, least = k, away
    starts_m = chain[0]
    s_m = starts_m[0] + nearest * _SAMPLE_M
    ahead, left, heading, bend = _seen_from(chain, s_m, x_m, y_m)
    for _ in range(_NEWTON_ROUNDS):
        step = ahead
        if abs(bend) >= _STRAIGHT_1PM:
            step = math.atan2(bend * ahead, max(1.0 - bend * left, _MIN_RADIUS_SHARE)) / bend
        before_m, s_m = s_m, min(max(s_m + step, low_m), high_m)
        if s_m == before_m:
            break
        ahead, left, heading, bend = _seen_from(chain, s_m, x_m, y_m)
    return s_m, math.copysign(math.hypot(ahead, left), left), heading


@compiled(Projection, "float64, float64, float64, float64")
def _project(
    path: Projection, x_m: float, y_m: float, low_m: float, high_m: float
) -> tuple[float, float, float]:
    """As Projection.project()."""
    first, last = _samples_from_to(low_m, high_m)
    return _nearest(path, max(first, 0), last, x_m, y_m, low_m, high_m)


@inlined
def _on_line(
    line: tuple[float, float, float, float, float], x_m: float, y_m: float, low_m: float, high_m: float
) -> tuple[float, float]:
    """s_m and d_m of a point where the path is a straight line from low_m to high_m.

    line: s_m, x_m and y_m of its beginning, and cosine and sine of its direction.
    """
    line_s_m, line_x_m, line_y_m, cos, sin = line
    along, left = along_and_left(x_m - line_x_m, y_m - line_y_m, cos, sin)
    s_m = min(max(along + line_s_m, low_m), high_m)
    return s_m, math.copysign(math.hypot(along + line_s_m - s_m, left), left)


@inlined
def located(
    path: Projection,
    points_m: FloatArray,
    velocity_mps: FloatArray,
    times_s: FloatArray,
    from_s_m: float,
    to_s_m: float,
) -> FloatArray:
    """As Projection.locate(), for compiled steps."""
    starts, xs, ys, headings, bends = path.chain
    end_m = starts[-1] + EXTENSION_M
    low_m = min(max(from_s_m, -EXTENSION_M), end_m - _SAMPLE_M)
    high_m = min(max(to_s_m, low_m + _SAMPLE_M), end_m)
    piece = _piece_at(low_m, starts)
    straight = bends[piece] == 0.0 and path.straight_to[piece] >= _piece_at(high_m, starts)
    heading = headings[piece]
    line = starts[piece], xs[piece], ys[piece], math.cos(heading), math.sin(heading)
    first, last = _samples_from_to(low_m, high_m)
    result = np.empty((3, len(points_m), len(times_s)))
    for k in range(len(points_m)):
        for j in range(len(times_s)):
            x = points_m[k, 0] + velocity_mps[k, 0] * times_s[j]
            y = points_m[k, 1] + velocity_mps[k, 1] * times_s[j]
            if straight:
                result[0, k, j], result[1, k, j] = _on_line(line, x, y, low_m, high_m)
                result[2, k, j] = heading
            else:
                result[:, k, j] = _nearest(path, first, last, x, y, low_m, high_m)
    return result


@compiled(Projection, "float64[:, :], float64[:, :], float64[:], float64, float64")
def _locate(
    path: Projection,
    points_m: FloatArray,
    velocity_mps: FloatArray,
    times_s: FloatArray,
    from_s_m: float,
    to_s_m: float,
) -> FloatArray:
    return located(path, points_m, velocity_mps, times_s, from_s_m, to_s_m)
