"""A closer look at bodies of which too few fragments tell how they move.

The fragments of an image are spread over all of it, long ones first; what is small, plain or half hidden gets
none. Here one such body a frame is searched by itself, for shorter ones too. What is found is a witness of
that body alone: the camera's motion does not rest on it, for the body may go.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.compiled import compiled
from hal.types import FloatArray, RgbdFrame
from vision.bodies.tracks import Tracks
from vision.depth.depth_mask import SurfaceDepth
from vision.depth.depth_noise import depth_sigma_of
from vision.detection import Detection
from vision.fragments.candidates import (
    NOTHING_NEW,
    NewFragments,
    depth_along,
    held_ends,
    new_fragments,
    on_one_surface,
)
from vision.fragments.edges import GreyImage, find_edges
from vision.fragments.segments import find_segments, longest_first

_FEW_FRAGMENTS = 4  # eight ends are what a verdict along the line of sight takes (vision/bodies/proof.py)
_ENOUGH_OF_A_MOVER = 2  # to follow it, its surface helps
_MIN_CELLS = 12  # what a track begins with (vision/bodies/births.py): less is a sliver
_REACH_M = 9.0  # short of the depth mask's 10 m by about the noise of depth there
_URGENT_SIGHTINGS = 45  # who is new in view, or under suspicion, is looked at more often
# Beside no whole number of frames at 30, 15 or 10 Hz, or the rounding of a stamp would decide.
_URGENT_NS = 95_000_000
_IDLE_NS = 495_000_000  # who is known well is looked at twice a second
_MARGIN_PX = 6  # around its box: an edge is at the rim of a body, and corners are looked for beside it
_MIN_SIDE_PX = 16  # the least length of a segment here
_MIN_LENGTH = 0.5  # of the length of other fragments
_MIN_END_DISTANCE_PX = 8.0  # half of the least length of a segment here: ends were moved to corners
_LEAST_HELD = 600.0  # on a short edge without corners both ends slide alike; noise alone makes 220
# Not what vision/fragments/renewal.py has adapted to there, mostly more: velocities were no better known by
# it.
_CONTRAST = 60.0
_CANDIDATES = 48  # the longest ones, which bounds the time that one look takes
_AT_ONCE = 4  # from none to enough in one look, and no body takes all free places
_GATE_M = 0.3  # about a body's depth, and
_GATE_SIGMAS = 2.0  # 95 % of what is there, by the noise of depth
_DEEPEST_M = 1.0  # of its measured depth no more counts: the rest of something deeper is noise, or a wall
_ONE_SURFACE = 0.5  # of the gate
_HOLES = 0.2  # of the 25 samples around an end: from a quarter on another surface may be there


@dataclass(frozen=True, slots=True, eq=False)
class Wanted:
    """K bodies that too few fragments tell of. ids (K,); box_px (K, 4): u0, v0, u1, v1; depth_m (K,) and
    gate_m (K,): how deep they are, and by how much what is on them may be off; urgent (K,)."""

    ids: NDArray[np.int64]
    box_px: FloatArray
    depth_m: FloatArray
    gate_m: FloatArray
    urgent: NDArray[np.bool_]


def wanted(tracks: Tracks, detection: Detection, config: PerceptionConfig) -> Wanted:
    """Of the tracks seen in this frame."""
    noise = config.depth_noise
    chosen, depth_m, gate_m, urgent = _told_of_by_too_few(
        tracks.state,
        tracks.extent_m,
        tracks.moving,
        tracks.evidence,
        tracks.fragments,
        tracks.cells,
        tracks.sightings,
        tracks.seen_ns,
        detection.captured_ns,
        detection.pose.rotation,
        detection.pose.translation_m,
        noise.floor_m,
        noise.quadratic_per_m,
    )
    return Wanted(tracks.ids[chosen], tracks.bbox_px[chosen], depth_m, gate_m, urgent)


@compiled(
    "float64[:, :], float64[:, :], bool_[:], float64[:], int64[:], int64[:], int64[:], int64[:], int64, "
    "float64[:, :], float64[:], float64, float64"
)
def _told_of_by_too_few(
    state: FloatArray,
    extent_m: FloatArray,
    moving: NDArray[np.bool_],
    evidence: FloatArray,
    fragments: NDArray[np.intp],
    cells: NDArray[np.intp],
    sightings: NDArray[np.intp],
    seen_ns: NDArray[np.int64],
    now_ns: int,
    rotation: FloatArray,
    camera_m: FloatArray,
    floor_m: float,
    quadratic_per_m: float,
) -> tuple[NDArray[np.intp], FloatArray, FloatArray, NDArray[np.bool_]]:
    """Which of the tracks are wanted, and depth_m, gate_m and urgent of these. floor_m and quadratic_per_m:
    the noise of depth."""
    chosen, depth_m, gate_m = np.empty(len(state), np.intp), np.empty(len(state)), np.empty(len(state))
    urgent, count = np.empty(len(state), np.bool_), 0
    for n in range(len(state)):
        few = fragments[n] < (_ENOUGH_OF_A_MOVER if moving[n] else _FEW_FRAGMENTS)
        if not few or seen_ns[n] != now_ns or cells[n] < _MIN_CELLS:
            continue
        x, y, z = state[n, 0] - camera_m[0], state[n, 1] - camera_m[1], state[n, 2] - camera_m[2]
        if not x * x + y * y + z * z <= _REACH_M**2:
            continue
        depth = max(x * rotation[0, 2] + y * rotation[1, 2] + z * rotation[2, 2], 0.0)
        gate = _GATE_M + _GATE_SIGMAS * depth_sigma_of(depth, floor_m, quadratic_per_m)
        gate += 0.5 * np.minimum(extent_m[n, 2], _DEEPEST_M)
        chosen[count], depth_m[count], gate_m[count] = n, depth, gate
        urgent[count] = evidence[n] > 0.0 or sightings[n] < _URGENT_SIGHTINGS
        count += 1
    return chosen[:count], depth_m[:count], gate_m[:count], urgent[:count]


class Attention:
    """Keeps when each body was looked at last."""

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config
        self._looked_ns: dict[int, int] = {}
        self._began_ns: int | None = None

    def find(
        self, frame: RgbdFrame, grey: GreyImage, ends_px: NDArray[np.float32], bodies: Wanted
    ) -> NewFragments:
        """Fragments on the body whose turn it is, where none of ends_px (K, 2, 2) are: all present ones."""
        settings = self._config.fragments
        room = settings.max_fragments + settings.closer_fragments - len(ends_px)
        one = self._next(bodies, frame.captured_ns) if room > 0 else None
        if one is None:
            return NOTHING_NEW
        height, width = grey.shape
        u0, v0, u1, v1 = bodies.box_px[one].astype(int).tolist()
        left, right = max(0, u0 - _MARGIN_PX), min(width, u1 + _MARGIN_PX)
        top, bottom = max(0, v0 - _MARGIN_PX), min(height, v1 + _MARGIN_PX)
        if min(right - left, bottom - top) < _MIN_SIDE_PX:
            return NOTHING_NEW
        edges = find_edges(grey[top:bottom, left:right], _CONTRAST)
        segments_px = find_segments(edges, _MIN_LENGTH * settings.min_length_px, (left, top))
        longest_px = longest_first(segments_px)[:_CANDIDATES]
        ends, tensor = held_ends(grey, longest_px, ends_px, _MIN_END_DISTANCE_PX, _LEAST_HELD)
        surface = depth_along(ends, frame, self._config)
        picked = self._on_it(surface, bodies.depth_m[one], bodies.gate_m[one]).nonzero()[0]
        return new_fragments(picked[: min(room, _AT_ONCE)], ends, tensor, surface, settings)

    def _on_it(self, surface: SurfaceDepth, depth_m: float, gate_m: float) -> NDArray[np.bool_]:
        """(N,) segments of the body at depth_m. One with an end between two surfaces, or beside what has no
        depth, would be a witness of either."""
        near_m, far_m, holes = surface.near_m[:, ::4], surface.far_m[:, ::4], surface.holes[:, ::4]
        here = np.abs(near_m - depth_m) <= gate_m
        alone = (far_m - near_m <= _ONE_SURFACE * gate_m) & (holes <= _HOLES)
        result: NDArray[np.bool_] = on_one_surface(surface.near_m, self._config)
        return result & (here & alone).all(axis=1)

    def _next(self, bodies: Wanted, now_ns: int) -> int | None:
        """Index of the body whose turn it is: an urgent one, of these the one that has waited for longest."""
        # At the very beginning everything is new, and waits for its turn.
        self._began_ns = now_ns if self._began_ns is None else min(self._began_ns, now_ns)
        ids = bodies.ids.tolist()
        if not ids:
            return None
        self._looked_ns = {one: at for one, at in self._looked_ns.items() if now_ns - at < _IDLE_NS}
        first, longest = None, (False, -1)
        for index, (number, urgent) in enumerate(zip(ids, bodies.urgent.tolist(), strict=True)):
            waited_ns = now_ns - self._looked_ns.get(number, self._began_ns)
            if waited_ns >= (_URGENT_NS if urgent else _IDLE_NS) and (urgent, waited_ns) > longest:
                first, longest = index, (urgent, waited_ns)
        if first is not None:
            self._looked_ns[ids[first]] = now_ns
        return first
