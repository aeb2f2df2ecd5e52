"""What depth alone says of the corridor: the nearest surface in it, and how far it was seen to be free.

Edges are blind to a plain wall and no camera sees through glass: a surface that no obstacle explains counts
as an obstacle, and floor that was not seen is not free.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from controller.decision.blind_corners import BlindCorners
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor
from controller.decision.surfaces import Surfaces, bands_at
from controller.decision.view_edges import LEAST_TAN, above_from_m, consented_m
from hal.clocks import NS_PER_S
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

_CELL_M = 0.2
_NEVER_NS = -(2**62)
_LANES = 5
# Where the view hardly rises, what flickers farther away than this was nothing.
_MOST_ABOVE_M = 3.0
# One frame's outlier must not brake; three frames of five are a tenth of a second.
_FRAMES = 5


class Sight:
    """Remembers along one path what was seen of it; look() once a scene.

    surface_s_m: where the nearest unexplained surface stands in the corridor (path coordinate of its nearest
    point, inf: none), steady against single frames.
    known_s_m: the corridor was seen free up to here. corners: where somebody could step out from behind
    something.
    """

    def __init__(
        self, corridor: Corridor, mount: CameraMount, config: DecisionConfig, start_s_m: float
    ) -> None:
        self._corridor, self._mount = corridor, mount
        self._sight, self._lateral_m = config.sight, config.margins.lateral_m
        length = corridor.path.length_m + corridor.front_m + _CELL_M
        self._cells = np.arange(0.5 * _CELL_M, length, _CELL_M)
        self._lanes = self._lanes_of(self._cells)
        self._seen_ns = np.full(len(self._cells), _NEVER_NS, np.int64)
        # Under the nose and beside it nothing can be seen: what the robot stands before is free by consent.
        self._near_m = self._floor_from_m = self._lost_m = self._sight.near_m
        self._consent_s_m = start_s_m + mount.forward_m + self._near_m + _CELL_M
        self._nearest: deque[float] = deque(maxlen=_FRAMES)
        self._held_s_m = math.inf
        self.surface_s_m = math.inf
        self.known_s_m = self._consent_s_m
        self.corners = BlindCorners(config.sight)

    def look(
        self,
        free: FreeSpace,
        surfaces: Surfaces,
        pose: PlanarPose,
        s_m: float,
        captured_ns: int,
        explained_by: Bodies,
        standing: bool,
    ) -> None:
        """Take in one scene. surfaces: those of free. pose, s_m: of the robot when it was captured. standing:
        it was at rest then."""
        self._take_edges(free)
        bands, forward, points = surfaces.bands, surfaces.forward_m, surfaces.points_m
        surface_s, surface_d = self._corridor.path.project_points(
            points, s_m, s_m + self._sight.range_m + 2.0
        )
        half_width = self._corridor.half_width(surface_s)
        side = np.abs(surface_d) - surfaces.half_band_m
        inside = (side <= half_width + self._lateral_m) & (surface_s > s_m)
        belongs = surfaces.of(explained_by)
        self.corners.look(
            bands,
            forward,
            surface_s,
            surface_d,
            half_width,
            2.0 * free.half_width_tan,
            s_m + self._corridor.front_m,
            # As matrices of yes and no: whether a point belongs to any who moves.
            ~(belongs @ explained_by.moving),
        )
        way = inside.nonzero()[0]
        way_s = surface_s[way]
        if len(way) and len(explained_by):
            way_s = way_s[~belongs.take(way, 0).any(axis=1)]
        self._note_surface(way_s, s_m, standing)
        in_corridor = np.zeros(len(free.bearing_tan), np.bool_)
        in_corridor[bands] = inside
        self._note_floor(free, pose, s_m, captured_ns, in_corridor)

    def _take_edges(self, free: FreeSpace) -> None:
        """What is below the view of a camera that is higher than usual cannot be seen before the start
        either: by consent it is free, but for a stretch that is too long for that."""
        self._floor_from_m = max(self._sight.near_m, free.floor_from_m)
        near_m = consented_m(self._sight.near_m, free.floor_from_m)
        if near_m > self._near_m:
            self._consent_s_m += near_m - self._near_m
            self._near_m = near_m
        above_m = above_from_m(self._corridor.height_m, self._mount.height_m, free.up_tan)
        if free.up_tan < LEAST_TAN:  # the view hardly rises, and nobody knows where a thing leaves it
            above_m = min(above_m, _MOST_ABOVE_M)
        self._lost_m = max(self._floor_from_m, above_m)

    def _note_surface(self, surfaces_s: FloatArray, s_m: float, standing: bool) -> None:
        nearest = float(surfaces_s.min()) if len(surfaces_s) else math.inf
        self._nearest.append(nearest)
        before = self.surface_s_m
        steady = sorted(self._nearest)[len(self._nearest) // 2]
        # What goes out of sight below or above the view because the robot drives on is still there; what goes
        # while the robot stands has gone away.
        blind_s_m = s_m + self._mount.forward_m + self._lost_m
        if standing or self._held_s_m < s_m:
            self._held_s_m = math.inf
        elif steady > before + _CELL_M and before < blind_s_m:
            self._held_s_m = min(self._held_s_m, before)
        self.surface_s_m = min(steady, self._held_s_m)

    def _note_floor(
        self,
        free: FreeSpace,
        pose: PlanarPose,
        s_m: float,
        captured_ns: int,
        surface_in_corridor: NDArray[np.bool_],
    ) -> None:
        """Mark the cells whose width was seen; then find the first one ahead that is not known."""
        first = int(self._cells.searchsorted(s_m))
        last = int(self._cells.searchsorted(s_m + self._sight.range_m + self._mount.forward_m))
        if last > first and len(free.bearing_tan):
            seen = self._lanes_seen(free, pose, first, last, surface_in_corridor)
            self._seen_ns[first:last][seen >= self._sight.known_share] = captured_ns
        memory_ns = round(self._sight.memory_s * NS_PER_S)
        fresh = self._seen_ns >= captured_ns - memory_ns
        # Too near to be seen again: what was once seen free stays so, others' bodies are watched elsewhere.
        near = self._cells <= s_m + self._mount.forward_m + self._near_m + _CELL_M
        known = fresh | (near & (self._seen_ns > _NEVER_NS)) | (self._cells <= self._consent_s_m)
        unknown = (~known[first:]).nonzero()[0]
        self.known_s_m = float(self._cells[first + unknown[0]]) - 0.5 * _CELL_M if len(unknown) else math.inf

    def _lanes_of(self, cells: FloatArray) -> FloatArray:
        """(2, L, C) points across the swept width at each cell: they depend on the path alone."""
        x, y, heading = self._corridor.path.poses(cells)
        half = self._corridor.half_width(cells)
        lanes = np.linspace(-1.0, 1.0, _LANES)[:, None]
        return np.stack((x - np.sin(heading) * half * lanes, y + np.cos(heading) * half * lanes))

    def _lanes_seen(
        self,
        free: FreeSpace,
        pose: PlanarPose,
        first: int,
        last: int,
        surface_in_corridor: NDArray[np.bool_],
    ) -> FloatArray:
        """(C,) share of the width of the cells first..last that was seen as free, or lies behind a surface in
        the corridor: that surface limits the speed itself."""
        px, py = self._lanes[:, :, first:last]
        forward, band = bands_at(free, pose, self._mount, px, py)
        within = np.minimum(np.maximum(band, 0), len(free.bearing_tan) - 1)
        # What is too near to be measured was not seen, however far the scan goes beyond it. Nor was what is
        # below the view, where that is more than could be consented to.
        least_m = free.blind_m + 0.5 * _CELL_M if free.blind_m > 0.0 else 0.0
        if self._floor_from_m > self._near_m:
            least_m = max(least_m, self._floor_from_m)
        in_view = (forward > least_m) & (band == within)
        # The far edge of a cell, so that a cell is not known for the sake of its beginning.
        far_edge = forward + 0.5 * _CELL_M
        surface_m = np.where(surface_in_corridor, free.nearest_m, np.inf)
        seen = in_view & ((far_edge <= free.known_m[within]) | (far_edge >= surface_m[within]))
        share: FloatArray = seen.sum(axis=0) / _LANES
        return share
