"""The hall from the inside: floor with markings, walls and ceiling."""

from __future__ import annotations

import math

import numpy as np

from config.scenario import Room, TapeLine
from sim.models.mesh import Faces, join, quad

_TILE_M = 4.096  # side of the square that one texture of the floor or the ceiling covers
_TAPE_LIFT_M = 0.0008  # height of markings above the floor, so that they hide it; too small to matter


def build_room(room: Room) -> Faces:
    """All faces of the hall, in the frame of the floor."""
    x0, x1, y0, y1, z1 = room.x_min_m, room.x_max_m, room.y_min_m, room.y_max_m, room.height_m
    across, along = (y1 - y0) / _TILE_M, (x1 - x0) / _TILE_M
    floor = {"fine": "concrete", "coarse": "patchy-floor", "plain": "smooth-floor"}[room.floor]
    wall = {"fine": "bricks", "coarse": "painted-wall", "plain": "plain/white"}[room.walls]
    roof = {"fine": "roof", "coarse": "roof", "plain": "plain/grey"}[room.ceiling]
    long_x, long_y = (x1 - x0) / 4.0, (y1 - y0) / 4.0
    return join(
        [
            quad([(x0, y1, 0), (x1, y1, 0), (x1, y0, 0), (x0, y0, 0)], floor, (0, 0, along, across)),
            quad([(x1, y1, z1), (x0, y1, z1), (x0, y0, z1), (x1, y0, z1)], roof, (0, 0, along, across)),
            quad([(x1, y1, z1), (x1, y0, z1), (x1, y0, 0), (x1, y1, 0)], wall, (0, 0, long_y, 1)),
            quad([(x0, y0, z1), (x0, y1, z1), (x0, y1, 0), (x0, y0, 0)], wall, (0, 0, long_y, 1)),
            quad([(x0, y1, z1), (x1, y1, z1), (x1, y1, 0), (x0, y1, 0)], wall, (0, 0, long_x, 1)),
            quad([(x1, y0, z1), (x0, y0, z1), (x0, y0, 0), (x1, y0, 0)], wall, (0, 0, long_x, 1)),
            *(_tape(line) for line in room.tape),
        ]
    )


def _tape(line: TapeLine) -> Faces:
    a, b = np.array([line.ax_m, line.ay_m]), np.array([line.bx_m, line.by_m])
    length = float(math.dist(a, b))
    along = (b - a) / length
    left = np.array([-along[1], along[0]]) * 0.5 * line.width_m
    z = _TAPE_LIFT_M
    corners = [(float(p[0]), float(p[1]), z) for p in (a + left, b + left, b - left, a - left)]
    return quad(corners, f"tape/{line.colour}", (0.0, 0.0, length / 2.0, 1.0))
