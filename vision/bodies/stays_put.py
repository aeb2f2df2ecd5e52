"""Tracks whose surface stays where it is, though something moves on it: a picture on a screen, a light.

The fragments follow the picture, and agree on a velocity. But depth shows the same surface at the same place
as half a second ago, when by that velocity a part of it could not have been there yet.

vision/tracker.py calls it before the verdict. Terms: vision/__init__.py.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from hal.compiled import compiled
from hal.types import Flags, FloatArray, Pose, Vector
from vision.bodies.arrivals import NEIGHBOURHOOD, ViewMemory
from vision.bodies.masks import cells_of, count_cells
from vision.bodies.tracks import Tracks
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid

_LOOK_BACK_S = 0.6
# Least way across the line of sight in that time, as a share of the width: after less, nearly all of any body
# is where it was.
_LEAST_WAY = 0.1
_STAYED_SHARE = 0.9  # of the cells: of a body that goes along a wall, depth takes a part for the wall
_STAYED_OF_WAY = 0.5  # as much of what the way would have taken off the surface has to be there yet
# Where depth resolves less, somebody who goes along a wall may be taken for the wall. Half of this is what
# ViewMemory.stayed leaves to noise: a chest is 0.4 m from the wall.
_RESOLVED_M = 0.8


def stays_put(
    tracks: Tracks,
    grid: DepthGrid,
    mask: BoolGrid,
    labels: IntGrid,
    memory: ViewMemory,
    pose: Pose,
    now_ns: int,
) -> Flags:
    """(T,) movers of which nearly all surface is where it was, although by their velocity it cannot be.

    Asked of tracks with evidence of motion. mask (h, w): cells above the floor. labels (h, w): track index
    + 1. pose: of the camera.
    """
    result: Flags = tracks.mover
    if not result.any():
        return result
    sight, distance_m = tracks.sight(pose.translation_m)
    way = _LOOK_BACK_S * _widths_per_s(tracks, sight)
    result &= (way >= _LEAST_WAY) & (memory.resolves_m(distance_m) <= _RESOLVED_M)
    if not result.any():
        return result
    around = mask & cv2.dilate(cells_of(labels, result).view(np.uint8), NEIGHBOURHOOD).view(np.bool_)
    stayed, stayed_s = memory.stayed(grid, around, pose, now_ns, _LOOK_BACK_S)
    here = count_cells(labels, np.flatnonzero(stayed), len(tracks))
    cells = np.bincount(labels.ravel(), minlength=len(tracks) + 1)[1:]
    gone = np.minimum(way * stayed_s / _LOOK_BACK_S, 1.0)
    return result & (here > 0) & (here >= np.maximum(_STAYED_SHARE, 1.0 - _STAYED_OF_WAY * gone) * cells)


@compiled(Tracks, "float64[:, ::1]")
def _widths_per_s(tracks: Tracks, sight: FloatArray) -> Vector:
    """(T,) speed across the line of sight, in widths of the track. sight (T, 3): unit vectors to them."""
    result = np.zeros(len(sight))
    for t in range(len(sight)):
        along, squared = 0.0, 0.0
        for i in range(3):
            along += tracks.state[t, 3 + i] * sight[t, i]
            squared += tracks.state[t, 3 + i] ** 2
        result[t] = math.sqrt(max(squared - along * along, 0.0)) / max(tracks.extent_m[t, 0], 0.1)
    return result
