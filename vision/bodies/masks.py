"""Prediction of the cells of each track in the next frame. Terms: vision/__init__.py.

Connected depth alone would merge a person with a wall that the person passes. So the cells that each track
covered are kept as 3D points. They are moved by the camera's motion and, for movers, by the track's velocity,
and projected into the new grid. A cell is predicted for a track if the depth measured there agrees with the
projected point. The predicted cells then vote to which track each part belongs (vision/bodies/votes.py).
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray, Pose
from vision.depth.cells import lattice_of, place_of
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid
from vision.numerics.pose_axes import inner_vector
from vision.numerics.relative_pose import NEAREST_M, coordinate_m, relative_rows

# The gate on depth is the sum of both: as large as a jump in depth within one part may be (in 1/m), and how
# much nearer or farther a surface may get (in m), besides the track's velocity, as a body turns or bends.
_DEPTH_GATE_INVERSE = 0.03
_DEPTH_GATE_M = 0.25


@record(frozen=True, slots=True, eq=False)
class TrackSurfaces:
    """The surfaces of T tracks in one frame, as K points.

    points_m: in the camera axes of pose, (3, K).
    owner: index of each point's track, (K,).
    track_id: (T,).
    pose: the camera in the fixed frame.
    """

    points_m: Annotated[FloatGrid, "float32[:, ::1]"]
    owner: Annotated[NDArray[np.int32], "int32[::1]"]
    track_id: NDArray[np.int64]
    pose: Pose


NO_TRACK_SURFACES = TrackSurfaces(
    np.empty((3, 0), np.float32),
    np.empty(0, np.int32),
    np.empty(0, np.int64),
    Pose(np.eye(3), np.zeros(3)),
)


def surfaces(grid: DepthGrid, labels: IntGrid, ids: NDArray[np.int64], pose: Pose) -> TrackSurfaces:
    """The surfaces of tracks with ids (T,). labels (h, w): track index + 1 of each cell, 0 for none."""
    return TrackSurfaces(*_points_of(grid, labels), ids, pose)


@compiled(DepthGrid, "int32[:, ::1]")
def _points_of(grid: DepthGrid, labels: IntGrid) -> tuple[FloatGrid, NDArray[np.int32]]:
    """points_m (3, K) of all labelled cells and their owner (K,), label - 1."""
    (height, width), depth_m = labels.shape, grid.depth_m
    count = np.count_nonzero(labels)
    points_m, owner = np.empty((3, count), np.float32), np.empty(count, np.int32)
    k = 0
    for i in range(height):
        for j in range(width):
            if labels[i, j] == 0:
                continue
            points_m[0, k], points_m[1, k] = grid.x[j] * depth_m[i, j], grid.y[i] * depth_m[i, j]
            points_m[2, k], owner[k] = depth_m[i, j], labels[i, j] - 1
            k += 1
    return points_m, owner


def predict(
    before: TrackSurfaces, index: NDArray[np.intp], shift_m: FloatArray, grid: DepthGrid, pose: Pose
) -> IntGrid:
    """(h, w) track index + 1 predicted for each cell where the measured depth agrees; 0: none.

    index (T,): present index of each track in before, -1 if it has ended. shift_m (present tracks, 3):
    displacement of each track since then, in the fixed frame, as before.pose and pose are.
    """
    return _predicted(before, index, shift_m, before.pose, pose, grid)


@compiled(TrackSurfaces, "int64[::1], float64[:, :]", Pose, Pose, DepthGrid)
def _predicted(
    before: TrackSurfaces,
    index: NDArray[np.intp],
    shift_m: FloatArray,
    old_pose: Pose,
    pose: Pose,
    grid: DepthGrid,
) -> IntGrid:
    """As predict. old_pose: of the camera when the points were seen; pose: now."""
    height, width = grid.inverse_depth.shape
    result, nearest = np.zeros((height, width), np.int32), np.zeros((height, width), np.float32)
    lattice = lattice_of(grid.x, grid.y)
    to_x, to_y, to_z = relative_rows(pose, old_pose)
    displacement_m = np.zeros(shift_m.shape, np.float32)  # in the camera's axes now
    for track in range(len(shift_m)):
        displacement_m[track] = inner_vector(pose, shift_m[track])
    for k in range(len(before.owner)):
        track = index[before.owner[k]]
        if track < 0:
            continue
        x, y, z = before.points_m[0, k], before.points_m[1, k], before.points_m[2, k]
        there_m = coordinate_m(to_z, x, y, z) + displacement_m[track, 2]
        if not there_m > NEAREST_M:
            continue
        expected = np.float32(1.0) / there_m
        x, y = (
            coordinate_m(to_x, x, y, z) + displacement_m[track, 0],
            coordinate_m(to_y, x, y, z) + displacement_m[track, 1],
        )
        column, row = place_of(x * expected, y * expected, lattice)
        if not (0.0 <= column < width and 0.0 <= row < height):
            continue
        i, j = int(row), int(column)
        measured = grid.inverse_depth[i, j]
        gate = np.float32(_DEPTH_GATE_INVERSE) + np.float32(_DEPTH_GATE_M) * expected * expected
        if not (measured > 0 and abs(measured - expected) <= gate):
            continue
        # Where several points project into one cell, the nearest one gets it; of equally near ones the last.
        if expected >= nearest[i, j]:
            nearest[i, j], result[i, j] = expected, track + 1
    return result


@compiled("int32[:, ::1], int64[::1], int64")
def count_cells(labels: IntGrid, cells: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """(count,) how many of the flat cells (K,) lie in each of the parts 1..count of labels (h, w)."""
    flat, result = labels.ravel(), np.zeros(count, np.intp)
    for cell in cells:
        if flat[cell] > 0:
            result[flat[cell] - 1] += 1
    return result


@compiled("int32[:, ::1], boolean[::1]")
def cells_of(labels: IntGrid, chosen: NDArray[np.bool_]) -> BoolGrid:
    """(h, w) the cells of tracks chosen (T,)."""
    height, width = labels.shape
    result = np.zeros((height, width), np.bool_)
    for i in range(height):
        for j in range(width):
            if labels[i, j] > 0:
                result[i, j] = chosen[labels[i, j] - 1]
    return result
