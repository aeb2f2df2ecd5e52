"""Remembers the floor around the robot as the camera saw it on the way here, outside the present view.

On a path known beforehand, the camera sees the floor long before the robot is there
(controller/decision/known_floor.py). A planner's arc begins below the camera's view, turns into floor beside
the view, or sweeps all around the robot. That floor was seen earlier, from elsewhere. It is kept in a square
grid around the robot. ground_limits.py makes limits from it.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.robot import Robot
from controller.decision.bodies import Bodies
from controller.decision.known_floor import assumed_free_m
from controller.decision.surfaces import bands_at, floor_points, surfaces_of
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

CELL_M = 0.1
# A surface marked within this time is in view; the decision knows it better than this grid.
IN_VIEW_NS = 300 * NS_PER_MS
# Cells per side of the grid; what is farther away than half of it is forgotten.
_SIZE = 128
_LOOK_M = 4.0  # cells up to this distance ahead of the camera can be seen free
_SURFACE_M = 3.0  # surfaces farther away are ignored: their depth is too coarse for these cells
_THROUGH_M = 0.1  # a cell is seen free if the view goes on for at least this beyond it
# A sighting of a surface adds _HIT to the cell's score, up to _MOST_HITS; a scene that sees through the cell
# takes 1 off. A cell is blocked from _BLOCKED_HITS on, so from the second sighting.
_HIT, _MOST_HITS, _BLOCKED_HITS = 2, 6, 3
# How long a mover's surface stays. It may have moved on unseen soon after. The same holds for what leaves the
# view of a robot that stands, which it can do only by moving (as in controller/decision/out_of_view.py).
_PASSING_NS = 2 * NS_PER_S
_FOR_EVER_NS = 2**62
_BESIDE = 2  # a surface also marks the cells up to this many cells around its own
_AROUND_M = 0.3  # a surface this near to a mover's box belongs to the mover
_NEVER_M = -math.inf
# Floor seen free longer ago than this travelled distance no longer counts: odometry has drifted meanwhile, or
# others have changed the place.
_TRAVEL_M = 8.0
_TURN_AS_M = 0.3  # a rotation by 1 rad counts as this travelled distance


class GroundMemory:
    """A grid of the floor: takes in scans, tells which points are free or blocked; poses in a fixed frame.

    As long as the robot has not moved since the start, a disc around it counts as free, by the consent of
    whoever starts it. consent_m: radius of the disc.
    """

    def __init__(self, robot: Robot, mount: CameraMount, config: DecisionConfig) -> None:
        self._body, self._mount = robot.body, mount
        self._least_near_m = self._near_m = config.sight.near_m
        self._reach_m = mount.forward_m + 3.0 * CELL_M
        self.consent_m = self._reach_m + self._near_m
        self._key = np.full((_SIZE, _SIZE, 2), np.iinfo(np.int32).min, np.int32)
        self._free_ns = np.zeros((_SIZE, _SIZE), np.int64)
        self._free_at_m = np.full((_SIZE, _SIZE), _NEVER_M)
        self._hits = np.zeros((_SIZE, _SIZE), np.int8)
        self._until_ns = np.zeros((_SIZE, _SIZE), np.int64)
        self._marked_ns = np.zeros((_SIZE, _SIZE), np.int64)
        self._stands = np.zeros((_SIZE, _SIZE), np.bool_)
        self._hidden = np.zeros((_SIZE, _SIZE), np.bool_)
        self._seen_from_m = np.zeros((_SIZE, _SIZE))
        # The arrays with the state of the cells, and their values for a cell of which nothing is known.
        self._unknown: tuple[tuple[NDArray[Any], float], ...] = (
            (self._free_ns, 0),
            (self._free_at_m, _NEVER_M),
            (self._hits, 0),
            (self._until_ns, 0),
            (self._marked_ns, 0),
            (self._stands, False),
            (self._hidden, False),
            (self._seen_from_m, 0.0),
        )
        self._travelled_m = 0.0
        self._stood = True
        self._pose: PlanarPose | None = None

    def move(self, pose: PlanarPose, now_ns: int) -> None:
        """Set the robot's pose: the floor below its body is free, and the travelled distance is added up."""
        before, self._pose = self._pose, pose
        if before is None:
            self._stamp_disc(pose, now_ns)
        else:
            turned = abs(math.remainder(pose.heading_rad - before.heading_rad, math.tau))
            self._travelled_m += (
                math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m) + _TURN_AS_M * turned
            )
        body = self._body
        ahead = np.arange(-body.rear_m, body.front_m + CELL_M / 2, CELL_M / 2)
        left = np.arange(-body.width_m / 2, body.width_m / 2 + CELL_M / 2, CELL_M / 2)
        at = self._cells(floor_points(pose, *np.meshgrid(ahead, left)))
        self._set_free(at, now_ns)
        self._hits[at] = 0

    def renew_consent(self, now_ns: int) -> None:
        """Keep the disc free. To be called as long as the robot has not moved since the start."""
        if self._pose is not None:
            self._stamp_disc(self._pose, now_ns)

    def look(
        self, free: FreeSpace, pose: PlanarPose, captured_ns: int, moving: Bodies, standing: bool
    ) -> None:
        """Take in a scan. pose: the robot's. moving: the movers in that scene. standing: the robot stands."""
        if not len(free.bearing_tan):
            return
        self._near_m = max(self._least_near_m, free.floor_from_m)
        self.consent_m = self._reach_m + assumed_free_m(self._least_near_m, free.floor_from_m)
        if self._stood and not standing:
            # Static surfaces that were in view when the robot set off stay for ever: they leave the view
            # because the robot moves.
            there = self._stands & (self._marked_ns >= captured_ns - IN_VIEW_NS)
            self._until_ns[there] = _FOR_EVER_NS
            self._hidden[:] = False
        self._stood = standing
        self._see_through(free, pose, captured_ns)
        self._mark_surfaces(free, pose, captured_ns, moving)

    def free(self, points_m: FloatArray, since_ns: int = 0) -> BoolArray:
        """(N,) whether floor points (N, 2) were seen free, after since_ns and within _TRAVEL_M of travel."""
        index, keys = self._index(points_m)
        mine = (self._key[index] == keys).all(axis=-1)
        recent = (self._free_at_m[index] >= self._travelled_m - _TRAVEL_M) & (
            self._free_ns[index] >= since_ns
        )
        return np.asarray(mine & recent, np.bool_)

    def blocked(self, points_m: FloatArray, now_ns: int, before_ns: int | None = None) -> BoolArray:
        """(N,) whether a surface stood at floor points (N, 2) when they were last seen.

        before_ns: only surfaces that were last marked before this time.
        """
        index, keys = self._index(points_m)
        mine = (self._key[index] == keys).all(axis=-1)
        stands = (self._hits[index] >= _BLOCKED_HITS) & (self._until_ns[index] > now_ns)
        if before_ns is not None:
            stands &= self._marked_ns[index] < before_ns
        return np.asarray(mine & stands, np.bool_)

    def _see_through(self, free: FreeSpace, pose: PlanarPose, captured_ns: int) -> None:
        """Set cells free that are in view and nearer than the first surface."""
        count = round(_LOOK_M / CELL_M)
        middle = np.floor(np.array((pose.x_m, pose.y_m)) / CELL_M) + 0.5
        points = (middle + self._around(count)) * CELL_M
        forward, band = bands_at(free, pose, self._mount, points[:, 0], points[:, 1])
        ahead = (forward > 0.0) & (forward < _LOOK_M) & (band >= 0) & (band < len(free.bearing_tan))
        points, forward, chosen = points[ahead], forward[ahead], band[ahead]
        if self._stood:
            self._hidden[self._cells(points[forward > free.nearest_m[chosen]])] = True
        reach = np.minimum(free.known_m[chosen], free.nearest_m[chosen])
        through = forward + _THROUGH_M <= reach
        points, forward = points[through], forward[through]
        at = self._cells(points)
        # A low obstacle can be below the view. So a cell's surface counts as gone only if the cell is seen
        # from near_m or more, or from no nearer than the surface was seen from.
        gone = forward >= np.minimum(self._near_m, self._seen_from_m[at] - _THROUGH_M)
        self._hits[at] = np.where(gone, np.maximum(self._hits[at] - 1, 0), self._hits[at])
        was_free = self._free_at_m[at] >= self._travelled_m - _TRAVEL_M
        # While the robot stood, something hid these cells and then went away. They are free, as in a mission.
        revealed = self._hidden[at] & self._stood
        seen = (forward >= self._near_m) | was_free | revealed
        self._set_free((at[0][seen], at[1][seen]), captured_ns)

    def _mark_surfaces(self, free: FreeSpace, pose: PlanarPose, captured_ns: int, moving: Bodies) -> None:
        surfaces = surfaces_of(free, pose, self._mount)
        near = surfaces.forward_m <= _SURFACE_M
        if not near.any():
            return
        forward, points = surfaces.forward_m[near], surfaces.points_m[near]
        at = self._cells(points)
        moves = moving.covers(points, np.full(len(points), _AROUND_M), _AROUND_M).any(axis=1)
        self._hits[at] = np.minimum(self._hits[at] + _HIT, _MOST_HITS)
        self._stands[at] = ~moves
        self._until_ns[at] = np.where(moves | self._stood, captured_ns + _PASSING_NS, _FOR_EVER_NS)
        # A surface on the border of two cells falls into either of them, and a person's arms swing. So the
        # cells around are marked as in view, too.
        beside = self._cells((points[:, None, :] + CELL_M * self._around(_BESIDE)).reshape(-1, 2))
        self._marked_ns[beside] = captured_ns
        if self._stood:
            self._until_ns[beside] = np.minimum(self._until_ns[beside], captured_ns + _PASSING_NS)
        self._seen_from_m[at] = forward

    @staticmethod
    @cache
    def _around(count: int) -> FloatArray:
        """Offsets (N, 2), in cells, of all cells up to count cells away."""
        steps = np.arange(-count, count + 1, dtype=np.float64)
        return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)

    def _stamp_disc(self, pose: PlanarPose, now_ns: int) -> None:
        offsets = np.arange(-self.consent_m, self.consent_m + CELL_M / 2, CELL_M / 2)
        x, y = np.meshgrid(offsets, offsets)
        inside = x * x + y * y <= self.consent_m**2
        points = np.stack((pose.x_m + x[inside], pose.y_m + y[inside]), axis=-1)
        self._set_free(self._cells(points), now_ns)

    def _set_free(self, at: tuple[IntArray, IntArray], now_ns: int) -> None:
        self._free_ns[at] = np.maximum(self._free_ns[at], now_ns)
        self._free_at_m[at] = self._travelled_m

    def _cells(self, points_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Indices of the cells of these points; a cell that held another place before is reset."""
        index, keys = self._index(points_m)
        other = (self._key[index] != keys).any(axis=-1)
        new = (index[0][other], index[1][other])
        self._key[new] = keys[other]
        for kept, unknown in self._unknown:
            kept[new] = unknown
        return index

    @staticmethod
    def _index(points_m: FloatArray) -> tuple[tuple[IntArray, IntArray], NDArray[np.int32]]:
        keys = np.floor(points_m / CELL_M).astype(np.int32)
        wrapped = (keys % _SIZE).astype(np.intp)
        return (wrapped[..., 0], wrapped[..., 1]), keys
