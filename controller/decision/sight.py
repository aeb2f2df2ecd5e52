"""What depth alone says of the corridor: the nearest surface in it, and how far it was seen free.

Obstacles are found by edges, which a plain wall does not have, and no depth camera measures glass. So a
surface that no obstacle explains counts as an obstacle, and floor that was not seen is not free.
controller/decision/world_model.py calls Sight once a scene; controller/decision/depth_limits.py makes the
limits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from controller.decision.blind_corners import LOW_M, BlindCorners, SurfacesOnPath
from controller.decision.bodies import Bodies
from controller.decision.corridor import BEYOND_RANGE_M, Corridor
from controller.decision.held_surface import SAME_SURFACE_M, HeldSurface, Nearest
from controller.decision.surfaces import Surfaces, seen_of
from controller.decision.view_edges import MIN_TAN, assumed_free_m, may_be_above_view_within_m
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

_CELL_M = 0.2  # length of a cell of the corridor
_NEVER_NS = -(2**62)  # when a cell was seen that never was
_LANES = 5  # points across the width of a cell
# If the view's upper edge hardly rises, a surface that vanishes farther away than this has not gone out of
# view upwards: it was flicker.
_MAX_ABOVE_M = 3.0
# Bodies explain a surface that was on no body before if they cover this share of its width.
_EXPLAINED_SHARE = 0.8
_CLEARANCE_ERROR_M = 0.05  # a surface is in the swept width if it is by more than this
_BESIDE_MOVER_M = 1.0  # as close to a mover a surface may be a part of it, such as the rest of a vehicle


class Sight:
    """Remembers what was seen of one path's corridor; call look() once a scene.

    surface_clearance_m: free floor between that surface and the corridor; 0 or less: inside it.
    known_s_m: the corridor was seen free up to here.
    corners: the blind corners, where somebody could step out (controller/decision/blind_corners.py).
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
        # The floor right before and beside the robot is below the view. At the start it counts as free by
        # the consent of whoever starts the robot.
        self._near_m = self._floor_from_m = self._out_of_view_within_m = self._sight.near_m
        self._edges = math.nan, math.nan
        self._assumed_free_s_m = start_s_m + mount.forward_m + self._near_m + _CELL_M
        self._surface = HeldSurface()
        self.surface_clearance_m = math.inf
        self._surface_d_m = 0.0, 0.0  # from where to where across the path the nearest surface was seen
        self.known_s_m = self._assumed_free_s_m
        self.corners = BlindCorners(config.sight)

    @property
    def surface_s_m(self) -> float:
        """Path coordinate of the nearest unexplained surface in the corridor; inf: none."""
        return self._surface.s_m

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
        """Take in one scene.

        free, surfaces: the free space, and the surfaces made of it.
        pose, s_m: of the robot when the scene was captured; standing: it was at rest then.
        explained_by: bodies; a surface that belongs to one of them is no obstacle of its own.
        """
        self._update_view_edges(free)
        on_path = self._on_path(surfaces, s_m)
        belongs = surfaces.of(explained_by)
        found = _surfaces_in_corridor(
            on_path,
            surfaces.half_band_m,
            belongs,
            explained_by.moving,
            s_m,
            self._lateral_m,
            len(free.bearing_tan),
        )
        hides = found.stands & ~belongs[:, explained_by.top_m < LOW_M].any(axis=1)
        self.corners.look(on_path, hides, 2.0 * free.half_width_tan, s_m + self._corridor.front_m)
        if found.nearest_s_m < math.inf:
            self.surface_clearance_m = found.clearance_m
        explained_s = self._explained(on_path, found.explained, found.nearest)
        blind_s_m = s_m + self._mount.forward_m + self._out_of_view_within_m
        beside_mover = _beside_mover(surfaces.points_m[found.nearest], explained_by)
        nearest = Nearest(found.nearest_s_m, beside_mover, found.clearance_m < -_CLEARANCE_ERROR_M)
        self._surface.note(nearest, s_m, blind_s_m, captured_ns, standing, explained_s)
        self._note_floor(free, pose, s_m, captured_ns, found.in_bands)

    def _explained(self, on_path: SurfacesOnPath, explained: BoolArray, nearest: BoolArray) -> float:
        """Path coordinate of the surface in the corridor that bodies explain, where the nearest unexplained
        one was last seen across the path; inf: they cover too little of it.

        explained, nearest (P,): see _InCorridor.
        """
        if nearest.any():
            across_m = on_path.d_m[nearest]
            self._surface_d_m = float(across_m.min()), float(across_m.max())
        low, high = self._surface_d_m
        counts = explained & (on_path.d_m >= low) & (on_path.d_m <= high)
        if not counts.any() or np.ptp(on_path.d_m[counts]) < _EXPLAINED_SHARE * (high - low):
            return math.inf
        return float(on_path.s_m[counts].min())

    def _on_path(self, surfaces: Surfaces, s_m: float) -> SurfacesOnPath:
        """The surfaces in path coordinates, as far as the camera sees from s_m."""
        to_s_m = s_m + self._sight.range_m + BEYOND_RANGE_M
        located = self._corridor.locate(surfaces.points_m, s_m, to_s_m)
        return SurfacesOnPath(surfaces.bands, surfaces.forward_m, *located)

    def _update_view_edges(self, free: FreeSpace) -> None:
        """Take in where the view begins and ends, if that has changed.

        The higher the camera, the longer the stretch of floor below its view, which cannot be seen before the
        start. It counts as free by consent, unless it is too long (assumed_free_m).
        """
        edges = free.floor_from_m, free.up_tan
        if edges == self._edges:
            return
        self._edges = edges
        self._floor_from_m = max(self._sight.near_m, free.floor_from_m)
        near_m = assumed_free_m(self._sight.near_m, free.floor_from_m)
        if near_m > self._near_m:
            self._assumed_free_s_m += near_m - self._near_m
            self._near_m = near_m
        above_m = may_be_above_view_within_m(self._corridor.height_m, self._mount.height_m, free.up_tan)
        if free.up_tan < MIN_TAN:  # the upper edge hardly rises: where things leave it is not known
            above_m = min(above_m, _MAX_ABOVE_M)
        self._out_of_view_within_m = max(self._floor_from_m, above_m)

    def _note_floor(
        self,
        free: FreeSpace,
        pose: PlanarPose,
        s_m: float,
        captured_ns: int,
        in_bands: BoolArray,
    ) -> None:
        """Mark the cells whose width was seen free, then find the first unknown cell ahead.

        in_bands (B,): see _InCorridor. Such a surface limits the speed itself, so behind it nothing has to be
        seen.
        """
        first, last = _between(self._cells, s_m, s_m + self._sight.range_m + self._mount.forward_m)
        if last > first and len(free.bearing_tan):
            # Floor too near to be measured was not seen, however far the scan reaches beyond it. Nor was
            # floor below the view, where that stretch is longer than what is free by consent.
            min_m = free.blind_m + 0.5 * _CELL_M if free.blind_m > 0.0 else 0.0
            if self._floor_from_m > self._near_m:
                min_m = max(min_m, self._floor_from_m)
            lanes = self._lanes[:, first:last]
            # Ask for the far edge of a cell: it is not known if only its beginning was seen.
            seen = seen_of(free, pose, self._mount, lanes, 0.5 * _CELL_M, min_m, in_bands)
            self._seen_ns = _marked(self._seen_ns, first, seen, self._sight.known_share, captured_ns)
        # Cells too near to be seen again stay free once they were seen free; bodies that may come there are
        # covered by controller/decision/out_of_view.py and worst_case_limit.py.
        near_s_m = s_m + self._mount.forward_m + self._near_m + _CELL_M
        memory_ns = round(self._sight.memory_s * NS_PER_S)
        unknown = _first_unknown(
            self._seen_ns, self._cells, first, captured_ns - memory_ns, near_s_m, self._assumed_free_s_m
        )
        known = unknown == len(self._cells)
        self.known_s_m = math.inf if known else float(self._cells[unknown]) - 0.5 * _CELL_M

    def _lanes_of(self, cells: FloatArray) -> FloatArray:
        """(2, C, L) x and y of L points across the swept width at each cell; depends on the path alone."""
        x, y, heading = (values[:, None] for values in self._corridor.path.poses(cells))
        half = self._corridor.half_width(cells)[:, None]
        lanes = np.linspace(-1.0, 1.0, _LANES)
        return np.stack((x - np.sin(heading) * half * lanes, y + np.cos(heading) * half * lanes))


def _beside_mover(points_m: FloatArray, bodies: Bodies) -> bool:
    """Whether one of the points (P, 2) is close to a body that moves."""
    if not len(points_m) or not np.count_nonzero(bodies.moving):
        return False
    reach_m = np.full(len(points_m), _BESIDE_MOVER_M)
    return bool(bodies.select(bodies.moving).covers(points_m, reach_m, _BESIDE_MOVER_M).any())


class _InCorridor(NamedTuple):
    """Which of P surfaces are in the corridor, and which of these bodies explain.

    in_bands: (B,) in which bands of the scan a surface is in the corridor.
    explained: (P,) those in the corridor that belong to bodies.
    nearest: (P,) those that belong to none and are about as near as the nearest of them. A wall across the
        way begins beside it.
    nearest_s_m: path coordinate of that one; inf if there is none.
    clearance_m: free floor between the nearest ones and the corridor; inf if there are none.
    stands: (P,) those, in the corridor or not, that belong to no mover.
    """

    in_bands: BoolArray
    explained: BoolArray
    nearest: BoolArray
    nearest_s_m: float
    clearance_m: float
    stands: BoolArray


@compiled(SurfacesOnPath, "float64[:], boolean[:, :], boolean[:], float64, float64, int64")
def _surfaces_in_corridor(
    on_path: SurfacesOnPath,
    half_band_m: FloatArray,
    belongs: BoolArray,
    moving: BoolArray,
    s_m: float,
    lateral_m: float,
    bands_count: int,
) -> _InCorridor:
    """Judge the surfaces beyond s_m. belongs (P, N): which belong to which of N bodies; moving (N,)."""
    count = len(on_path.bands)
    in_bands, stands = np.zeros(bands_count, np.bool_), np.ones(count, np.bool_)
    explained, nearest = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    nearest_s_m = clearance_m = math.inf
    for i in range(count):
        of_body = False
        for k in range(len(moving)):
            if belongs[i, k]:
                of_body = True
                stands[i] &= not moving[k]
        aside_m = abs(on_path.d_m[i]) - half_band_m[i]
        if aside_m <= on_path.half_width_m[i] + lateral_m and on_path.s_m[i] > s_m:
            in_bands[on_path.bands[i]] = True
            explained[i], nearest[i] = of_body, not of_body
            if not of_body:
                nearest_s_m = min(nearest_s_m, on_path.s_m[i])
    for i in range(count):
        nearest[i] &= on_path.s_m[i] <= nearest_s_m + SAME_SURFACE_M
        if nearest[i]:
            aside_m = abs(on_path.d_m[i]) - half_band_m[i]
            clearance_m = min(clearance_m, aside_m - on_path.half_width_m[i])
    return _InCorridor(in_bands, explained, nearest, nearest_s_m, clearance_m, stands)


@compiled("float64[:], float64, float64")
def _between(cells_m: FloatArray, from_s_m: float, to_s_m: float) -> tuple[int, int]:
    """Index of the first of the cells (C,) at or behind from_s_m, and of the first at or behind to_s_m."""
    return int(np.searchsorted(cells_m, from_s_m)), int(np.searchsorted(cells_m, to_s_m))


@compiled("int64[:], int64, int64[:], float64, int64")
def _marked(seen_ns: IntArray, first: int, lanes: IntArray, known_share: float, captured_ns: int) -> IntArray:
    """When each cell (C,) was last seen: from first on, now, if enough of its points are seen: lanes (K,)."""
    marked = seen_ns.copy()
    for k in range(len(lanes)):
        if lanes[k] / _LANES >= known_share:
            marked[first + k] = captured_ns
    return marked


@compiled("int64[:], float64[:], int64, int64, float64, float64")
def _first_unknown(
    seen_ns: IntArray,
    cells_m: FloatArray,
    first: int,
    since_ns: int,
    near_s_m: float,
    assumed_free_s_m: float,
) -> int:
    """Index of the first unknown cell of the cells (C,) from first on; C if there is none.

    A cell is unknown if it was not seen since since_ns; up to near_s_m, if it was never seen; up to
    assumed_free_s_m, never.
    """
    for c in range(first, len(cells_m)):
        near, assumed = cells_m[c] <= near_s_m, cells_m[c] <= assumed_free_s_m
        if not (seen_ns[c] >= since_ns or (near and seen_ns[c] > _NEVER_NS) or assumed):
            return c
    return len(cells_m)
