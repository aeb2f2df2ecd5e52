"""What depth alone says of the corridor: the nearest surface in it, blind corners, and floor seen free.

Obstacles are found by edges, which a plain wall does not have, and no depth camera measures glass. So a
surface that no obstacle explains counts as an obstacle, and floor that was not seen is not free.
controller/decision/world_model.py calls Sight once a scene; controller/decision/depth_limits.py makes the
limits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from config.decision import DecisionConfig
from controller.decision.blind_corners import LOW_M, BlindCorners, SurfacesOnPath
from controller.decision.bodies import Bodies
from controller.decision.corridor import BEYOND_RANGE_M, Corridor
from controller.decision.held_surface import SAME_SURFACE_M, HeldSurface, Nearest
from controller.decision.known_floor import KnownFloor
from controller.decision.surfaces import Surfaces
from controller.decision.view_edges import MIN_TAN
from hal.compiled import compiled
from hal.types import CameraMount, FlagMatrix, Flags, FloatArray, PlanarPose
from vision.scene import FreeSpace

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
    corners: the blind corners, where somebody could step out (controller/decision/blind_corners.py).
    """

    def __init__(
        self, corridor: Corridor, mount: CameraMount, config: DecisionConfig, start_s_m: float
    ) -> None:
        self._corridor, self._mount = corridor, mount
        self._sight, self._lateral_m = config.sight, config.margins.lateral_m
        self._floor = KnownFloor(corridor, mount, config.sight, start_s_m)
        self._surface = HeldSurface()
        self.surface_clearance_m = math.inf
        self._surface_d_m = 0.0, 0.0  # from where to where across the path the nearest surface was seen
        self.corners = BlindCorners(config.sight)

    @property
    def surface_s_m(self) -> float:
        """Path coordinate of the nearest unexplained surface in the corridor; inf: none."""
        return self._surface.s_m

    @property
    def known_s_m(self) -> float:
        """The corridor was seen free up to here."""
        return self._floor.known_s_m

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
        blind_s_m = s_m + self._mount.forward_m + self._out_of_view_within_m(free)
        beside_mover = _beside_mover(surfaces.points_m[found.nearest], explained_by)
        nearest = Nearest(found.nearest_s_m, beside_mover, found.clearance_m < -_CLEARANCE_ERROR_M)
        self._surface.note(nearest, s_m, blind_s_m, captured_ns, standing, explained_s)
        self._floor.look(free, pose, s_m, captured_ns, found.in_bands)

    def _explained(self, on_path: SurfacesOnPath, explained: Flags, nearest: Flags) -> float:
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

    def _out_of_view_within_m(self, free: FreeSpace) -> float:
        """Distance ahead of the camera within which surfaces may have left the view, below it or above it."""
        rises_m = max(self._corridor.height_m - self._mount.height_m, 0.0)
        above_m = rises_m / max(free.up_tan, MIN_TAN)
        if free.up_tan < MIN_TAN:  # the upper edge hardly rises: where things leave it is not known
            above_m = min(above_m, _MAX_ABOVE_M)
        return max(self._sight.near_m, free.floor_from_m, above_m)


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

    in_bands: Flags
    explained: Flags
    nearest: Flags
    nearest_s_m: float
    clearance_m: float
    stands: Flags


@compiled(SurfacesOnPath, "float64[:], boolean[:, :], boolean[:], float64, float64, int64")
def _surfaces_in_corridor(
    on_path: SurfacesOnPath,
    half_band_m: FloatArray,
    belongs: FlagMatrix,
    moving: Flags,
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
