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
from controller.decision.surfaces import Surfaces, seen_of
from controller.decision.view_edges import LEAST_TAN, above_from_m, consented_m
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

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
        self._edges = math.nan, math.nan
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
        belongs = surfaces.of(explained_by)
        in_corridor, nearest_s, stands = _beside_the_way(
            bands,
            surface_s,
            surface_d,
            half_width,
            surfaces.half_band_m,
            belongs,
            explained_by.moving,
            s_m,
            self._lateral_m,
            len(free.bearing_tan),
        )
        self.corners.look(
            bands,
            forward,
            surface_s,
            surface_d,
            half_width,
            2.0 * free.half_width_tan,
            s_m + self._corridor.front_m,
            stands,
        )
        self._note_surface(nearest_s, s_m, standing)
        self._note_floor(free, pose, s_m, captured_ns, in_corridor)

    def _take_edges(self, free: FreeSpace) -> None:
        """What is below the view of a camera that is higher than usual cannot be seen before the start
        either: by consent it is free, but for a stretch that is too long for that."""
        edges = free.floor_from_m, free.up_tan
        if edges == self._edges:
            return
        self._edges = edges
        self._floor_from_m = max(self._sight.near_m, free.floor_from_m)
        near_m = consented_m(self._sight.near_m, free.floor_from_m)
        if near_m > self._near_m:
            self._consent_s_m += near_m - self._near_m
            self._near_m = near_m
        above_m = above_from_m(self._corridor.height_m, self._mount.height_m, free.up_tan)
        if free.up_tan < LEAST_TAN:  # the view hardly rises, and nobody knows where a thing leaves it
            above_m = min(above_m, _MOST_ABOVE_M)
        self._lost_m = max(self._floor_from_m, above_m)

    def _note_surface(self, nearest_s_m: float, s_m: float, standing: bool) -> None:
        self._nearest.append(nearest_s_m)
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
        in_corridor: BoolArray,
    ) -> None:
        """Mark the cells whose width was seen; then find the first one ahead that is not known. in_corridor
        (B,): in which bands a surface is, which limits the speed itself: behind it nothing has to be seen."""
        first, last = _between(self._cells, s_m, s_m + self._sight.range_m + self._mount.forward_m)
        if last > first and len(free.bearing_tan):
            # What is too near to be measured was not seen, however far the scan goes beyond it. Nor was what
            # is below the view, where that is more than could be consented to.
            least_m = free.blind_m + 0.5 * _CELL_M if free.blind_m > 0.0 else 0.0
            if self._floor_from_m > self._near_m:
                least_m = max(least_m, self._floor_from_m)
            lanes = self._lanes[:, first:last]
            # The far edge of a cell, so that a cell is not known for the sake of its beginning.
            seen = seen_of(free, pose, self._mount, lanes, 0.5 * _CELL_M, least_m, in_corridor)
            self._seen_ns = _marked(self._seen_ns, first, seen, self._sight.known_share, captured_ns)
        # Too near to be seen again: what was once seen free stays so, others' bodies are watched elsewhere.
        near_s_m = s_m + self._mount.forward_m + self._near_m + _CELL_M
        memory_ns = round(self._sight.memory_s * NS_PER_S)
        unknown = _first_unknown(
            self._seen_ns, self._cells, first, captured_ns - memory_ns, near_s_m, self._consent_s_m
        )
        known = unknown == len(self._cells)
        self.known_s_m = math.inf if known else float(self._cells[unknown]) - 0.5 * _CELL_M

    def _lanes_of(self, cells: FloatArray) -> FloatArray:
        """(2, C, L) points across the swept width at each cell: they depend on the path alone."""
        x, y, heading = (values[:, None] for values in self._corridor.path.poses(cells))
        half = self._corridor.half_width(cells)[:, None]
        lanes = np.linspace(-1.0, 1.0, _LANES)
        return np.stack((x - np.sin(heading) * half * lanes, y + np.cos(heading) * half * lanes))


@compiled(
    "int64[:], float64[:], float64[:], float64[:], float64[:], boolean[:, :], boolean[:],"
    "float64, float64, int64"
)
def _beside_the_way(
    bands: NDArray[np.intp],
    surface_s_m: FloatArray,
    surface_d_m: FloatArray,
    half_width_m: FloatArray,
    half_band_m: FloatArray,
    belongs: BoolArray,
    moving: BoolArray,
    s_m: float,
    lateral_m: float,
    bands_count: int,
) -> tuple[BoolArray, float, BoolArray]:
    """In which of the B bands a surface is in the corridor (B,); where the nearest of those is that no body
    explains, inf: there is none; and which surfaces (P,) belong to nobody who moves. belongs (P, N): which
    of them belong to which bodies; moving (N,): of these."""
    in_corridor, stands = np.zeros(bands_count, np.bool_), np.ones(len(bands), np.bool_)
    nearest_s = math.inf
    for i in range(len(bands)):
        explained = False
        for k in range(len(moving)):
            if belongs[i, k]:
                explained = True
                stands[i] &= not moving[k]
        aside_m = abs(surface_d_m[i]) - half_band_m[i]
        if aside_m <= half_width_m[i] + lateral_m and surface_s_m[i] > s_m:
            in_corridor[bands[i]] = True
            if not explained:
                nearest_s = min(nearest_s, surface_s_m[i])
    return in_corridor, nearest_s, stands


@compiled("float64[:], float64, float64")
def _between(cells_m: FloatArray, from_s_m: float, to_s_m: float) -> tuple[int, int]:
    """The first of the cells (C,) from from_s_m on, and the first one from to_s_m on."""
    return int(np.searchsorted(cells_m, from_s_m)), int(np.searchsorted(cells_m, to_s_m))


@compiled("int64[:], int64, int64[:], float64, int64")
def _marked(seen_ns: IntArray, first: int, lanes: IntArray, known_share: float, captured_ns: int) -> IntArray:
    """The cells (C,); from first on, those are seen now of which enough lanes (K,) are."""
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
    consent_s_m: float,
) -> int:
    """The first of the cells (C,) from first on that was not seen since since_ns; up to near_s_m, not ever;
    up to consent_s_m none is unknown. C: none is."""
    for c in range(first, len(cells_m)):
        near, consent = cells_m[c] <= near_s_m, cells_m[c] <= consent_s_m
        if not (seen_ns[c] >= since_ns or (near and seen_ns[c] > _NEVER_NS) or consent):
            return c
    return len(cells_m)
