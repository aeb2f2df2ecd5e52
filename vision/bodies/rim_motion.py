"""Speed across the line of sight of bodies by their free rims (vision/depth/rims.py).

The centre of a half hidden body tells no velocity: it moves as the body comes out from behind what hides it.
A free rim is part of the body's own outline and moves with the body. Each row of a rim is compared with the
rim of the same body a moment ago, at the same height, with the camera's own motion taken out. The median over
the rows is the displacement, so that limbs and other changes of the outline in a few rows do not count.

vision/tracker.py calls it after the centres have been measured (vision/bodies/sightings.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray, Integers, Matrix, Pose, Vector
from vision.bodies.tracks import Tracks, speed_of
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid
from vision.depth.rims import NO_RIM, FreeRims, free_rims
from vision.motion.line_of_sight import FLOOR_SIGMA_MPS
from vision.numerics import kalman
from vision.numerics.relative_pose import NEAREST_M, Rows, coordinate_m, relative_rows

# Rims are compared over 0.2 s, rounded to frames: a walking person moves by 0.2 m, five times the width of a
# cell 6 m away, and by less than a step, so that a leg does not change its side.
_LOOK_BACK_NS = 220_000_000
_SHORTEST_NS = 80_000_000  # for younger tracks; in less time the width of a cell is as much as a slow walk
_ALIKE_SIGMAS = 2.5  # 99 % of equal velocities differ by less
_MIN_ROWS = 8  # fewer are a hand, or the corner of something
_ROWS_ALIKE = 5.0  # rows that share their noise: a cell is a median over 5x5 cells
_MEDIAN = 1.2533 * 1.4826  # sigma of a median of one value, in median absolute deviations
_QUANTUM = 0.29  # cells, sigma of a uniform distribution over one: all rows of an upright edge share it
# The outline of a walker swings with his steps by this share of his speed, one standard deviation: on walkers
# of another renderer, 0.9 m/s in the mean, the error is 0.08 m/s in the median and 0.24 m/s at the 90th
# percentile.
_GAIT, _STEP_S = 0.15, 0.5


class RimVelocities(NamedTuple):
    """Velocities of T tracks by their free rims, in the fixed frame.

    mps: component along direction, (T,).
    sigma_mps: its standard deviation, (T,); inf where there are not enough rows of free rims now and then.
    direction: unit vector across the line of sight, along the rows of the image, (T, 3).
    lag_s: time over which they are measured, (T,); 0 where they are not.
    """

    mps: Vector
    sigma_mps: Vector
    direction: Matrix
    lag_s: Vector

    @property
    def sigmas(self) -> FloatArray:
        """(T,) how many standard deviations mps is from zero; 0 where nothing is measured."""
        result: FloatArray = np.abs(self.mps) / np.hypot(self.sigma_mps, FLOOR_SIGMA_MPS)
        return result


@record(frozen=True, slots=True, eq=False)
class _SeenRims:
    """The free rims of the tracks track_id (T,) as seen from pose, the camera's, at stamp_ns."""

    stamp_ns: int
    track_id: NDArray[np.int64]
    rims: FreeRims
    pose: Pose


class RimMemory:
    """Remembers the free rims of the tracks over the last moments."""

    def __init__(self, fastest_mps: float) -> None:
        self._fastest_mps = fastest_mps  # no body is faster
        self._views: list[_SeenRims] = []

    def clear(self) -> None:
        """Forget all rims: the poses of their views cannot be compared with those to come."""
        self._views.clear()

    def velocities(
        self, grid: DepthGrid, labels: IntGrid, tracks: Tracks, pose: Pose, now_ns: int
    ) -> RimVelocities:
        """Measure the tracks with the cells labels (h, w), track index + 1, and remember their rims.

        Call clear first where pose cannot be compared with those before.
        """
        now = _SeenRims(now_ns, tracks.ids, free_rims(grid, labels, len(tracks)), pose)
        self._views = [view for view in self._views if now_ns - view.stamp_ns <= _LOOK_BACK_NS]
        compared = [view for view in self._views if now_ns - view.stamp_ns >= _SHORTEST_NS]
        self._views.append(now)
        if not compared:
            return _nothing_measured(len(tracks))
        # The oldest view, and the latest one for younger tracks.
        return _without_jumps(
            self._since(compared[0], now, grid, tracks), self._since(compared[-1], now, grid, tracks)
        )

    def _since(self, then: _SeenRims, now: _SeenRims, grid: DepthGrid, tracks: Tracks) -> RimVelocities:
        """Measure the tracks by comparing two views."""
        lag_s = (now.stamp_ns - then.stamp_ns) * 1e-9
        track = tracks.index_of(then.track_id)
        return _measured(grid, now.rims, now.pose, then.rims, then.pose, track, lag_s, self._fastest_mps)


@compiled("int64")
def _nothing_measured(count: int) -> RimVelocities:
    """RimVelocities of count tracks, none of which is measured."""
    return RimVelocities(
        mps=np.zeros(count),
        sigma_mps=np.full(count, np.inf),
        direction=np.zeros((count, 3)),
        lag_s=np.zeros(count),
    )


@inlined
def _add_shifts(
    grid: DepthGrid,
    column: NDArray[np.int32],
    old_column: NDArray[np.int32],
    old_depth_m: np.float32,
    rows: Rows,
    farthest_m: float,
    shift_m: FloatArray,
    sums: FloatArray,
) -> None:
    """Compare one rim, column (h,), with the same rim of another view, old_column (h,), row by row.

    rows: of the transform from the old axes of the camera to its present ones. Adds the displacements along x
    to shift_m, and to sums their number, the ray x and the depth of the rim. Displacements of more than
    farthest_m are left out: there other cells have joined the body or left it.
    """
    to_x, to_y, to_z = rows
    height, step = len(column), grid.y[1] - grid.y[0]
    for i in range(height):
        if old_column[i] == NO_RIM:
            continue
        x_m, y_m = grid.x[old_column[i]] * old_depth_m, grid.y[i] * old_depth_m
        depth_m = coordinate_m(to_z, x_m, y_m, old_depth_m)
        if depth_m < NEAREST_M:
            continue
        y = coordinate_m(to_y, x_m, y_m, old_depth_m) / depth_m
        row = math.floor((y - grid.y[0]) / step + np.float32(0.5))
        if row < 0 or row >= height or column[row] == NO_RIM:
            continue
        x = grid.x[column[row]]
        displacement_m = x * depth_m - coordinate_m(to_x, x_m, y_m, old_depth_m)
        if abs(displacement_m) > farthest_m:
            continue
        shift_m[int(sums[0])] = displacement_m
        sums[0] += 1.0
        sums[1] += x
        sums[2] += depth_m


@compiled(DepthGrid, FreeRims, Pose, FreeRims, Pose, "int64[::1], float64, float64")
def _measured(
    grid: DepthGrid,
    now: FreeRims,
    pose: Pose,
    then: FreeRims,
    old_pose: Pose,
    track: Integers,
    lag_s: float,
    fastest_mps: float,
) -> RimVelocities:
    """The velocities of the tracks by their rims now and then, lag_s ago.

    track: present index of each track of then, -1 if it has ended.
    """
    result = _nothing_measured(len(now.column))
    rows = relative_rows(pose, old_pose)
    shift_m, step, sums = np.empty(2 * now.column.shape[2]), grid.x[1] - grid.x[0], np.empty(3)
    for k in range(len(track)):
        t = track[k]
        if t < 0:
            continue
        sums[:] = 0.0
        for side in range(2):
            if then.inverse[k, side] > 0.0 and now.inverse[t, side] > 0.0:
                old_depth_m = np.float32(1.0 / then.inverse[k, side])
                column, old_column = now.column[t, side], then.column[k, side]
                _add_shifts(grid, column, old_column, old_depth_m, rows, fastest_mps * lag_s, shift_m, sums)
        found = int(sums[0])
        if found < _MIN_ROWS:
            continue
        x, depth_m = sums[1] / found, sums[2] / found
        middle_m = np.median(shift_m[:found])
        spread_m = _MEDIAN * np.median(np.abs(shift_m[:found] - middle_m))
        variance = 2.0 * (_QUANTUM * step * depth_m) ** 2 + spread_m * spread_m * _ROWS_ALIKE / found
        across = 1.0 / math.sqrt(1.0 + x * x)
        result.mps[t] = across * middle_m / lag_s
        result.sigma_mps[t] = across * math.sqrt(variance) / lag_s
        for i in range(3):
            result.direction[t, i] = across * (pose.rotation[i, 0] - x * pose.rotation[i, 2])
        result.lag_s[t] = lag_s
    return result


@compiled(RimVelocities, RimVelocities)
def _without_jumps(long: RimVelocities, short: RimVelocities) -> RimVelocities:
    """The velocities over the long time; those over the short time where the track is too young for that.

    What has moved has moved as fast over both. A rim that jumped once, as cells of something else joined the
    body, has not: nothing is measured for as long as the jump lies between the views.
    """
    result = RimVelocities(
        mps=short.mps.copy(),
        sigma_mps=short.sigma_mps.copy(),
        direction=short.direction.copy(),
        lag_s=short.lag_s.copy(),
    )
    for t in range(len(result.mps)):
        if not (short.sigma_mps[t] < np.inf and long.sigma_mps[t] < np.inf):
            continue
        apart_mps = abs(long.mps[t] - short.mps[t])
        if apart_mps > _ALIKE_SIGMAS * math.hypot(long.sigma_mps[t], short.sigma_mps[t]):
            result.mps[t], result.sigma_mps[t] = 0.0, np.inf
        else:
            result.mps[t], result.sigma_mps[t] = long.mps[t], long.sigma_mps[t]
            result.direction[t], result.lag_s[t] = long.direction[t], long.lag_s[t]
    return result


def one_way_s(so_far_s: FloatArray, rims: RimVelocities, sigmas: float, dt_s: float) -> FloatArray:
    """(T,) for how long rims have shown motion one way without a break, after a further frame of dt_s.

    Negative to the left. sigmas: so clear it has to be.
    """
    return _one_way_s(so_far_s, rims.mps, rims.sigmas > sigmas, dt_s)


@compiled("float64[::1], float64[::1], boolean[::1], float64")
def _one_way_s(so_far_s: FloatArray, mps: FloatArray, clear: NDArray[np.bool_], dt_s: float) -> FloatArray:
    """As one_way_s. clear (T,): rims that show motion."""
    result = np.zeros(len(mps))
    for t in range(len(mps)):
        if clear[t]:
            way = np.sign(mps[t])
            result[t] = (so_far_s[t] if np.sign(so_far_s[t]) == way else 0.0) + way * dt_s
    return result


def fuse(tracks: Tracks, rims: RimVelocities, dt_s: float) -> None:
    """Update both filters of the tracks with their velocities by rims. dt_s: since the frame before."""
    use, velocity_mps, variance = _measurements(rims, tracks, dt_s)
    tracks.update_with_surface(
        use, velocity_mps, kalman.along_only(rims.direction.take(use, axis=0), variance)
    )


@compiled(RimVelocities, Tracks, "float64")
def _measurements(
    rims: RimVelocities, tracks: Tracks, dt_s: float
) -> tuple[Integers, FloatArray, FloatArray]:
    """Indices (K,) of the tracks with a velocity by rims; these velocities (K, 3), their variances (K,)."""
    use = np.isfinite(rims.sigma_mps).nonzero()[0]
    velocity_mps, variance = np.empty((len(use), 3)), np.empty(len(use))
    for k in range(len(use)):
        t = use[k]
        # The time windows of successive frames overlap: a frame adds dt / window of a new measurement. The
        # swing of the outline lasts as long as a step.
        swing_mps = _GAIT * speed_of(tracks.state[t]) if tracks.moving[t] else 0.0
        noise = rims.sigma_mps[t] ** 2 * rims.lag_s[t] + swing_mps**2 * _STEP_S
        velocity_mps[k], variance[k] = rims.mps[t] * rims.direction[t], noise / dt_s
    return use, velocity_mps, variance
