"""New tracks for large parts of the view that no track claims. Terms: vision/__init__.py."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from vision.bodies.tracks import Tracks
from vision.depth import occlusion
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid, FloatGrid
from vision.depth.regions import Regions
from vision.detection import Detection

# Of a new track; about 0.1 x 0.1 m at 4 m with the camera of sim.yaml. Smaller parts come and go with noise.
MIN_CELLS = 12
FIRST_SIGMA_M = 0.2  # standard deviation of a first sighting: centre of the visible surface from the body's
# A part above the robot's height at the side of the image begins a track if it has arrived and reaches down
# below the height of a person.
_ARRIVED_CELLS = 24  # minimum number of its cells that have arrived
_ARRIVED_SHARE = 0.5  # minimum share of its cells that have arrived
_PERSON_M = 2.0


def start_tracks(
    tracks: Tracks,
    detection: Detection,
    parts: IntGrid,
    measured: Regions,
    arrived_cells: NDArray[np.intp],
    winner: NDArray[np.int32],
    body_height_m: float,
    max_speed_mps: float,
) -> NDArray[np.int32]:
    """winner (P,), track index + 1 of each part or 0, with new tracks for large parts without a winner.

    A part begins a track if it reaches down below the robot's height, if its lower end is hidden so that it
    may reach down, or if it is an arm that swings into the view ahead of its body.

    parts (h, w): labels of the parts. measured: their regions. arrived_cells (P,): their cells that have
    arrived.
    """
    grid = detection.grid
    large = (winner == 0) & (measured.cells >= MIN_CELLS)
    overhead = large.copy()
    if large.any():
        overhead &= ~reaching_down(grid, parts, len(winner), body_height_m)
        swings_in = (
            overhead
            & ~measured.sides_visible
            & (arrived_cells >= _ARRIVED_CELLS)
            & (arrived_cells >= _ARRIVED_SHARE * measured.cells)
        )
        if swings_in.any():
            swings_in &= reaching_down(grid, parts, len(winner), _PERSON_M)
        large &= ~overhead | swings_in | occlusion.hidden_below(grid, parts, measured)
    born = large.nonzero()[0]
    if len(born) == 0:
        return winner
    result = winner.copy()
    result[born] = np.arange(1, len(born) + 1) + len(tracks)
    position_m = detection.pose.apply(measured.position_m[born])
    tracks.start(position_m, FIRST_SIGMA_M, max_speed_mps, 0.0, detection.captured_ns)
    tracks.overhead[-len(born) :] = overhead[born]
    return result


def reaching_down(grid: DepthGrid, labels: IntGrid, count: int, body_height_m: float) -> NDArray[np.bool_]:
    """(count,) parts 1..count of labels (h, w) with cells below body_height_m; all without a known floor."""
    if grid.height_m is None:
        return np.ones(count, np.bool_)
    return _low(labels, grid.height_m, np.float32(body_height_m), count)


@compiled("int32[:, ::1], float32[:, ::1], float32, int64")
def _low(labels: IntGrid, height_m: FloatGrid, body_height_m: np.float32, count: int) -> NDArray[np.bool_]:
    """As reaching_down, with known heights (h, w)."""
    rows, columns = labels.shape
    cells = np.zeros(count, np.intp)
    for i in range(rows):
        for j in range(columns):
            if labels[i, j] > 0 and height_m[i, j] < body_height_m:
                cells[labels[i, j] - 1] += 1
    return cells >= MIN_CELLS // 2
