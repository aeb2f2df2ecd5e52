"""The floor around the robot as the camera saw it on the way here: what its view no longer covers.

A path that is known beforehand is looked at long before the robot is there (controller/decision/sight.py). A
planner's arc begins under the camera's nose, turns into floor beside the view, or sweeps all around the
robot: what is known of that floor was seen earlier, from elsewhere. Kept in square cells that move along with
the robot.
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
from controller.decision.surfaces import bands_at, floor_points, surfaces_of
from controller.decision.view_edges import assumed_free_m
from hal.clocks import NS_PER_S
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

CELL_M = 0.1
# What was marked so lately is in view, and known better from there.
IN_VIEW_NS = 300_000_000
# Cells in a row: what is further away than half of them is forgotten.
_SIZE = 128
_LOOK_M = 4.0
# Depth farther off is too coarse for cells of this size.
_SURFACE_M = 3.0
_THROUGH_M = 0.1
# Two sightings make a surface; being seen through takes it back three times as slowly as that.
_HIT, _MOST_HITS, _BLOCKED_HITS = 2, 6, 3
# What moved may have gone on, unseen, soon after; so has what leaves the view of a robot that stands, which
# it can only do by moving (as controller/decision/out_of_view.py keeps both).
_PASSING_NS = 2 * NS_PER_S
_FOR_EVER_NS = 2**62
_BESIDE = 2
_AROUND_M = 0.3
_NEVER_M = -math.inf
# Floor seen longer ago than this on the way is another place by now, or has been changed by others.
_TRAVEL_M = 8.0
_TURN_AS_M = 0.3


class GroundMemory:
    """Takes in scenes; tells of points what is known. Poses are in one frame that does not move.

    Free at the start is a disc around the robot, by the consent of whoever starts it, as long as it stands.
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
        # Everything that is kept of a cell, and what it is while nothing is known of that place.
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
        """The robot is at pose now: what its body covers is free, and the way that it made counts."""
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
        """The robot has not moved since it was started: the disc stays free."""
        if self._pose is not None:
            self._stamp_disc(self._pose, now_ns)

    def look(
        self, free: FreeSpace, pose: PlanarPose, captured_ns: int, moving: Bodies, standing: bool
    ) -> None:
        """Take in a scan from a robot at pose. moving: what moved in that scene; standing: the robot does."""
        if not len(free.bearing_tan):
            return
        self._near_m = max(self._least_near_m, free.floor_from_m)
        self.consent_m = self._reach_m + assumed_free_m(self._least_near_m, free.floor_from_m)
        if self._stood and not standing:
            # What was still there when the robot set off does not go away by that.
            there = self._stands & (self._marked_ns >= captured_ns - IN_VIEW_NS)
            self._until_ns[there] = _FOR_EVER_NS
            self._hidden[:] = False
        self._stood = standing
        self._see_through(free, pose, captured_ns)
        self._mark_surfaces(free, pose, captured_ns, moving)

    def free(self, points_m: FloatArray, since_ns: int = 0) -> BoolArray:
        """(N,) of floor points (N, 2): seen free, after since_ns and not too far back on the way."""
        index, keys = self._index(points_m)
        mine = (self._key[index] == keys).all(axis=-1)
        recent = (self._free_at_m[index] >= self._travelled_m - _TRAVEL_M) & (
            self._free_ns[index] >= since_ns
        )
        return np.asarray(mine & recent, np.bool_)

    def blocked(self, points_m: FloatArray, now_ns: int, before_ns: int | None = None) -> BoolArray:
        """(N,) of floor points (N, 2): a surface stood there when it was last seen (before before_ns)."""
        index, keys = self._index(points_m)
        mine = (self._key[index] == keys).all(axis=-1)
        stands = (self._hits[index] >= _BLOCKED_HITS) & (self._until_ns[index] > now_ns)
        if before_ns is not None:
            stands &= self._marked_ns[index] < before_ns
        return np.asarray(mine & stands, np.bool_)

    def _see_through(self, free: FreeSpace, pose: PlanarPose, captured_ns: int) -> None:
        """Cells that lie in view before the first surface."""
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
        # A low thing can hide below the view: only from where a surface was seen can its absence be seen.
        gone = forward >= np.minimum(self._near_m, self._seen_from_m[at] - _THROUGH_M)
        self._hits[at] = np.where(gone, np.maximum(self._hits[at] - 1, 0), self._hits[at])
        was_free = self._free_at_m[at] >= self._travelled_m - _TRAVEL_M
        # Hidden by something that then went away before a standing robot: as in a mission, its place is free.
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
        # A surface between two cells falls now into one, now into the other, and a person swings arms.
        beside = self._cells((points[:, None, :] + CELL_M * self._around(_BESIDE)).reshape(-1, 2))
        self._marked_ns[beside] = captured_ns
        if self._stood:
            self._until_ns[beside] = np.minimum(self._until_ns[beside], captured_ns + _PASSING_NS)
        self._seen_from_m[at] = forward

    @staticmethod
    @cache
    def _around(count: int) -> FloatArray:
        """Offsets (N, 2) of all cells up to count away, in cells."""
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
        """Where these points are kept; a cell that held another place before begins anew."""
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
