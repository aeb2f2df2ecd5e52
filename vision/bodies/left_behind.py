"""What a mover leaves behind: furniture that connected depth has made part of its track.

Somebody who walks past a table at arm's length is one part with it. As he goes on, the table stays where it
was. A surface of a mover is not its own if it was there a second ago while the mover, by its velocity, was
elsewhere. Such surfaces become static tracks, which claim them in the frames that follow
(vision/bodies/votes.py).

It finds the cuts; vision/bodies/cutting.py starts the tracks. vision/tracker.py calls it after carving
(vision/bodies/carving.py). Terms: vision/__init__.py.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise, PerceptionConfig
from hal.compiled import compiled, inlined
from hal.types import FloatArray, Pose
from vision.bodies.arrivals import NEIGHBOURHOOD, ViewMemory
from vision.bodies.births import MIN_CELLS
from vision.bodies.cutting import Cut
from vision.bodies.masks import cells_of
from vision.bodies.sizes import SINGLE_WIDTH_M
from vision.bodies.tracks import Tracks, speed_of
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.depth_noise import depth_sigma_of
from vision.depth.regions import Regions
from vision.detection import Detection
from vision.numerics.pose_axes import inner_vector
from vision.numerics.relative_pose import NEAREST_M

# Longer than the foot that a walker stands on stays where it is, 0.7 s: it belongs to him.
_LOOK_BACK_S = 1.0
_MIN_DISPLACEMENT_M = 0.4  # half the width of a body: after less it still covers most of its former place
_SAME_DEPTH_M = 0.3  # maximum difference in depth between two places on one body
_MAX_STEPS = 10  # of _MIN_DISPLACEMENT_M or more: no body is longer
_SPEED_SHARES = (0.8, 1.0, 1.1)  # the true speed, as a share of the filtered one
# Less than the first share of a track is noise. If more than the second has stayed, the mover itself is too
# close to a wall to be distinguished from it.
_LEAST_SHARE, _MOST_SHARE = 0.1, 0.7


def cuts(
    tracks: Tracks,
    detection: Detection,
    mask: BoolGrid,
    labels: IntGrid,
    measured: Regions,
    memory: ViewMemory,
    config: PerceptionConfig,
) -> list[Cut]:
    """What movers have left behind: it becomes static tracks.

    mask (h, w): cells above the floor. labels (h, w): track index + 1, without the cells that carving cuts
    out. measured: regions of the tracks, with these cells.
    """
    asked = _wide_movers(tracks, measured, config.depth_noise)
    if not asked.any():
        return []
    grid, pose, now_ns = detection.grid, detection.pose, detection.captured_ns
    on_mover = cells_of(labels, tracks.moving)
    around = mask & cv2.dilate(on_mover.view(np.uint8), NEIGHBOURHOOD).view(np.bool_)
    stayed, stayed_s = memory.stayed(grid, around, pose, now_ns, _LOOK_BACK_S)
    gone = asked & (tracks.speed_mps * stayed_s >= _MIN_DISPLACEMENT_M)
    if not gone.any():
        return []
    left = _left_behind(grid, labels, on_mover, stayed, tracks.velocity_mps * stayed_s, gone, pose)
    cells = np.bincount(left.ravel(), minlength=len(gone) + 1)[1:]
    of_track = np.bincount(labels.ravel(), minlength=len(gone) + 1)[1:]
    parted = (cells >= np.maximum(MIN_CELLS, _LEAST_SHARE * of_track)) & (cells <= _MOST_SHARE * of_track)
    return [
        Cut(np.flatnonzero(left == track + 1), 0.0, left_by=track) for track in parted.nonzero()[0].tolist()
    ]


@compiled(Tracks, Regions, DepthNoise)
def _wide_movers(tracks: Tracks, measured: Regions, noise: DepthNoise) -> NDArray[np.bool_]:
    """(T,) tracks that go fast enough to leave something behind, and are wider or deeper than one person."""
    result = np.zeros(len(tracks.state), np.bool_)
    for t in range(len(tracks.state)):
        width_m, deep_m = measured.extent_m[t, 0], measured.extent_m[t, 2]
        sigma_m = depth_sigma_of(measured.position_m[t, 2], noise)
        wide = width_m > SINGLE_WIDTH_M or deep_m > SINGLE_WIDTH_M + 2.0 * sigma_m
        fast = speed_of(tracks.state[t]) * _LOOK_BACK_S >= _MIN_DISPLACEMENT_M
        result[t] = tracks.moving[t] and fast and wide
    return result


@inlined
def _was_there(
    grid: DepthGrid, on_mover: BoolGrid, stayed: BoolGrid, i: int, j: int, step_m: tuple[float, float, float]
) -> bool:
    """Whether the mover at cell i, j has covered this place before it moved by step_m, in the camera's axes.

    If it has, the part of it that was here is a step further now. What is there may have stayed as well: a
    long vehicle covers a place for several steps. The last step has to end at a surface that moves and has
    not stayed; it may be another track, such as the trolley that a walker pushes. Out of view nothing is
    known, so the mover may have been here.
    """
    height, width = stayed.shape
    left, top = grid.x[0], grid.y[0]
    per_column, per_row = 1.0 / (grid.x[1] - left), 1.0 / (grid.y[1] - top)
    row, column = i, j
    for _ in range(_MAX_STEPS):
        depth_m = grid.depth_m[row, column]
        x, y = grid.x[column] * depth_m + step_m[0], grid.y[row] * depth_m + step_m[1]
        z = depth_m + step_m[2]
        if z <= NEAREST_M:
            return True
        u, v = (x / z - left) * per_column + 0.5, (y / z - top) * per_row + 0.5
        if not (0.0 <= u < width and 0.0 <= v < height):
            return True
        row, column = int(v), int(u)
        if not on_mover[row, column] or abs(grid.depth_m[row, column] - z) > _SAME_DEPTH_M:
            return False
        if not stayed[row, column]:
            return True
    return True


@compiled(DepthGrid, "int32[:, ::1], boolean[:, ::1], boolean[:, ::1], float64[:, :], boolean[::1]", Pose)
def _left_behind(
    grid: DepthGrid,
    labels: IntGrid,
    on_mover: BoolGrid,
    stayed: BoolGrid,
    displacement_m: FloatArray,
    gone: NDArray[np.bool_],
    pose: Pose,
) -> IntGrid:
    """(h, w) track index + 1 of the cells in stayed (h, w) at whose place their track was not then.

    on_mover (h, w): cells of tracks that move. displacement_m (T, 3): of the tracks since then. gone (T,):
    tracks that are looked at.
    """
    height, width = labels.shape
    result, moved_m = np.zeros((height, width), np.int32), np.zeros(displacement_m.shape)
    for t in range(len(gone)):
        moved_m[t] = inner_vector(pose, displacement_m[t])
    for i in range(height):
        for j in range(width):
            t = labels[i, j] - 1
            if t < 0 or not gone[t] or not stayed[i, j]:
                continue
            was_there = False
            for share in _SPEED_SHARES:
                step_m = share * moved_m[t, 0], share * moved_m[t, 1], share * moved_m[t, 2]
                was_there = was_there or _was_there(grid, on_mover, stayed, i, j, step_m)
            if not was_there:
                result[i, j] = t + 1
    return result
