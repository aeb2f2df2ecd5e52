"""Speed towards the camera of bodies that are seen in part, by the depth of their surface then and now.

A vehicle that the border of the image cuts, or that people hide in part, has no centre that tells its
velocity: the centre moves as more of it becomes visible. Its depth does tell. Each cell of its surface is
compared with what was seen in the same place a moment ago, with the camera's own motion taken out. Of
something static the depth is the same, however little of it was visible then. The median over the cells is
the displacement towards the camera. It is far more precise than the depth of one cell, and it needs neither
texture nor an outline.

Only what comes nearer counts. What moves away may be something static that a nearer body has just uncovered.
The displacement over half of the time has to be clearly smaller: a surface that other cells have joined has
jumped.

vision/tracker.py calls it after the free rims have been measured (vision/bodies/rim_motion.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled, inlined
from hal.types import FloatArray, Pose, Vector
from vision.bodies.arrivals import CELL_NOISE_OVER_TIME, EarlierView, ViewMemory
from vision.bodies.proof_rules import EVEN_CELLS, LARGEST_M
from vision.bodies.tracks import Tracks
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid, FloatGrid
from vision.depth.depth_noise import depth_sigma_of
from vision.detection import Detection
from vision.numerics import kalman
from vision.numerics.relative_pose import NEAREST_M, Rows, coordinate_m, relative_rows

# In the longer time a slow vehicle 6 m away comes nearer by twice the error. The shorter one shows jumps.
_LOOK_BACK_S = (0.6, 0.3)
_FASTEST_MPS = 2.0  # what is faster is seen by other means, and the background would be taken for the body
_SIGMAS = 3.5  # of the noise of one cell; exceeded by 1 in 2000
_MIN_SHARE = 0.5  # of the cells of a surface that must have been seen then: the others are of another surface
_STEADY = 1.5  # maximum ratio of the speed over the shorter time to that over the longer one; a jump has 2
_CELLS_ALIKE = 25.0  # cells that share their noise: a cell is a median over 5x5 cells
_MEDIAN = 1.2533  # standard deviation of a median, relative to that of a mean
_COMMON_NOISE = 0.2  # share of a pixel's depth noise that all cells have in common, as for centres
_CAMERA_M = 0.02  # error of the camera's own motion over the longer time
# Farther than this many standard deviations from the end of the range, noise cuts hardly any depth off.
_RANGE_SIGMAS = 2.0
# Of static surfaces: 99 % stay below 2.7 in real recordings without odometry, and below 1.2 in rendered ones.
_CLEAR_SIGMAS = 3.0


class ApproachSpeeds(NamedTuple):
    """Speeds of T tracks towards the camera, 0 or more, by the depth of their surfaces; m/s.

    mps: (T,); 0 where it is not measured.
    sigma_mps: its standard deviation, (T,); inf where it is not measured.
    lag_s: time over which it is measured; 0 where there is no view of that time.
    """

    mps: Vector
    sigma_mps: Vector
    lag_s: float

    @property
    def sigmas(self) -> FloatArray:
        """(T,) how many standard deviations mps is from zero; 0 where nothing is measured."""
        result: FloatArray = self.mps / self.sigma_mps
        return result


def measure(
    tracks: Tracks, detection: Detection, labels: IntGrid, memory: ViewMemory, noise: DepthNoise
) -> ApproachSpeeds:
    """Measure the tracks with the cells labels (h, w), track index + 1.

    Only those that clearly come nearer count as measured.
    """
    nothing = ApproachSpeeds(np.zeros(len(tracks)), np.full(len(tracks), np.inf), 0.0)
    before, lately = (memory.view_of(detection.captured_ns, wanted_s) for wanted_s in _LOOK_BACK_S)
    asked = (tracks.size_m <= LARGEST_M) & (tracks.cells >= EVEN_CELLS)
    cells = np.where(asked, tracks.cells, 0)
    if before is None or lately is None or not cells.any():
        return nothing
    longer = _since(before, detection, labels, cells, noise, _CLEAR_SIGMAS)
    clear = longer.sigmas > _CLEAR_SIGMAS
    if not clear.any():
        return nothing
    shorter = _since(lately, detection, labels, np.where(clear, cells, 0), noise)
    jumped = shorter.mps > _STEADY * longer.mps + shorter.sigma_mps
    counts = clear & np.isfinite(shorter.sigma_mps) & ~jumped
    return ApproachSpeeds(
        np.where(counts, longer.mps, 0.0), np.where(counts, longer.sigma_mps, np.inf), longer.lag_s
    )


def _since(
    then: EarlierView,
    detection: Detection,
    labels: IntGrid,
    cells: NDArray[np.intp],
    noise: DepthNoise,
    least_sigmas: float = -math.inf,
) -> ApproachSpeeds:
    """Measure by comparing with one view; mps is negative for what moves away.

    cells: number of cells of each track, 0 for tracks that are not asked for, (T,). least_sigmas: slower
    tracks, in standard deviations, do not count as measured.
    """
    lag_s = then.ago_s(detection.captured_ns)
    mps, sigma_mps = _compared(
        detection.grid, labels, cells, detection.pose, then.pose, then.inverse, noise, lag_s, least_sigmas
    )
    return ApproachSpeeds(mps, sigma_mps, lag_s)


@inlined
def _cell_sigma_m(depth_m: float, noise: DepthNoise) -> float:
    """Standard deviation of the difference of one cell between two frames."""
    return math.sqrt(2.0) * CELL_NOISE_OVER_TIME * depth_sigma_of(depth_m, noise)


@inlined
def _nearer_m(grid: DepthGrid, i: int, j: int, rows: Rows, seen: FloatGrid) -> tuple[float, float]:
    """By how much cell i, j is nearer than what was seen in its place then, NaN where nothing was; and its
    depth in that view.

    seen (h, w): 1/m. rows: of the transform from the present axes of the camera to those of then.
    """
    height, width = seen.shape
    z = grid.depth_m[i, j]
    x, y = grid.x[j] * z, grid.y[i] * z
    there_m = coordinate_m(rows[2], x, y, z)
    if not there_m > NEAREST_M:
        return math.nan, math.nan
    u = (coordinate_m(rows[0], x, y, z) / there_m - grid.x[0]) / (grid.x[1] - grid.x[0]) + np.float32(0.5)
    v = (coordinate_m(rows[1], x, y, z) / there_m - grid.y[0]) / (grid.y[1] - grid.y[0]) + np.float32(0.5)
    if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
        return math.nan, math.nan
    inverse = seen[int(v), int(u)]
    return (1.0 / inverse - there_m if inverse > 0.0 else math.nan), float(there_m)


@compiled(
    DepthGrid, "int32[:, ::1], int64[::1]", Pose, Pose, "float32[:, ::1]", DepthNoise, "float64, float64"
)
def _compared(
    grid: DepthGrid,
    labels: IntGrid,
    cells: NDArray[np.intp],
    pose: Pose,
    old_pose: Pose,
    seen: FloatGrid,
    noise: DepthNoise,
    lag_s: float,
    least_sigmas: float,
) -> tuple[FloatArray, FloatArray]:
    """(T,) mps and sigma_mps of ApproachSpeeds, mps negative for what moves away.

    cells (T,), least_sigmas: as _since. seen (h, w): 1/m, from old_pose, lag_s ago; 0 where not measured.
    """
    height, width = labels.shape
    rows = relative_rows(old_pose, pose)
    # The displacements of all tracks one after the other, those of track t from first[t] on.
    first = np.cumsum(cells) - cells
    nearer_m, depth_m = np.empty(cells.sum()), np.zeros(len(cells))
    found = np.zeros(len(cells), np.int64)
    for i in range(height):
        for j in range(width):
            t = labels[i, j] - 1
            if t < 0 or found[t] >= cells[t]:
                continue
            by_m, there_m = _nearer_m(grid, i, j, rows, seen)
            slack_m = _SIGMAS * _cell_sigma_m(there_m, noise)
            # False where by_m is NaN.
            if -slack_m <= by_m <= _FASTEST_MPS * lag_s + slack_m:
                nearer_m[first[t] + found[t]] = by_m
                found[t] += 1
                depth_m[t] += there_m
    mps, sigma_mps = np.zeros(len(cells)), np.full(len(cells), np.inf)
    for t in range(len(cells)):
        if found[t] == 0 or found[t] < _MIN_SHARE * cells[t]:
            continue
        there_m = depth_m[t] / found[t]
        noise_m = depth_sigma_of(there_m, noise)
        if there_m + _RANGE_SIGMAS * noise_m > grid.range_m:
            continue
        median_m = _MEDIAN * _cell_sigma_m(there_m, noise) * math.sqrt(_CELLS_ALIKE / found[t])
        common_m = math.sqrt(2.0) * _COMMON_NOISE * noise_m
        sigma_m = math.sqrt(median_m * median_m + common_m * common_m + _CAMERA_M * _CAMERA_M)
        own_m = nearer_m[first[t] : first[t] + found[t]]
        # Counting takes a fraction of the time of a median.
        if 2 * np.count_nonzero(own_m > least_sigmas * sigma_m) >= found[t]:
            mps[t], sigma_mps[t] = np.median(own_m) / lag_s, sigma_m / lag_s
    return mps, sigma_mps


def fuse(tracks: Tracks, approach: ApproachSpeeds, camera_m: FloatArray, dt_s: float) -> None:
    """Update both filters of the tracks with their speeds towards a camera at camera_m (3,).

    Not of those that are known to move: while they cross, what is behind them was seen in their place. dt_s:
    since the frame before.
    """
    use = (np.isfinite(approach.sigma_mps) & ~tracks.moving).nonzero()[0]
    if len(use) == 0:
        return
    sight, _ = tracks.sight(camera_m)
    direction = sight[use]
    # The time windows of successive frames overlap: a frame adds dt / window of a new measurement.
    variance = approach.sigma_mps[use] ** 2 * approach.lag_s / dt_s
    velocity = -approach.mps[use, None] * direction
    tracks.update_with_surface(use, velocity, kalman.along_only(direction, variance))


def approaching_s(so_far_s: FloatArray, approach: ApproachSpeeds, dt_s: float) -> FloatArray:
    """(T,) for how long surfaces have clearly come nearer without a break, after a further frame of dt_s."""
    return np.where(approach.mps > 0.0, so_far_s + dt_s, 0.0)
