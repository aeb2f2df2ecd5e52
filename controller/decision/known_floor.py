"""How far the corridor was seen free, from the robot on along its path. What was not seen is not free.

The corridor is divided into cells along the path. A cell is known for some time after its width was seen
free, and near the robot, where its floor is too near to be seen again, for ever.
controller/decision/sight.py takes each scene in here, with the bands in which a surface is in the corridor.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.decision import SightConfig
from controller.decision.corridor import Corridor
from controller.decision.surfaces import seen_of
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import CameraMount, Flags, FloatArray, PlanarPose
from vision.scene import FreeSpace

IntArray = NDArray[np.int64]

_CELL_M = 0.2  # length of a cell
_NEVER_NS = -(2**62)  # when a cell was seen that never was
_LANES = 5  # points across the width of a cell
# Floor below the view beyond this distance is too much to be taken as free without having been seen.
MAX_ASSUMED_FREE_M = 2.5


def assumed_free_m(near_m: float, floor_from_m: float) -> float:
    """How far ahead of the camera the floor is taken as free although it was never seen, in metres.

    Whoever starts the robot consents to that: up to near_m, or to floor_from_m, where the floor comes into
    view, but never more than MAX_ASSUMED_FREE_M (unless near_m is more).
    """
    return max(near_m, min(floor_from_m, MAX_ASSUMED_FREE_M))


class KnownFloor:
    """Remembers which cells of one path's corridor were seen free; call look() once a scene.

    start_s_m: the robot stands here at the start.
    known_s_m: the corridor was seen free up to here.
    """

    def __init__(self, corridor: Corridor, mount: CameraMount, sight: SightConfig, start_s_m: float) -> None:
        self._mount, self._sight = mount, sight
        length_m = corridor.path.length_m + corridor.front_m + _CELL_M
        self._cells_m = np.arange(0.5 * _CELL_M, length_m, _CELL_M)
        self._lanes_m = _lanes_of(corridor, self._cells_m)
        self._seen_ns = np.full(len(self._cells_m), _NEVER_NS, np.int64)
        # The floor right before and beside the robot is below the view. At the start it counts as free by
        # the consent of whoever starts the robot.
        self._near_m = sight.near_m
        self._assumed_free_s_m = start_s_m + mount.forward_m + sight.near_m + _CELL_M
        self.known_s_m = self._assumed_free_s_m

    def look(self, free: FreeSpace, pose: PlanarPose, s_m: float, captured_ns: int, hides: Flags) -> None:
        """Mark the cells whose width was seen free, then find the first unknown cell ahead.

        pose, s_m: of the robot. hides (B,): in which bands of the scan a surface is in the corridor. Such a
        surface limits the speed itself, so behind it nothing has to be seen.
        """
        self._assume_free_below_view(free)
        from_m, to_m = s_m, s_m + self._sight.range_m + self._mount.forward_m
        first, last = np.searchsorted(self._cells_m, (from_m, to_m)).tolist()
        if last > first and len(free.bearing_tan):
            lanes_m, min_m = self._lanes_m[:, first:last], self._seen_from_m(free)
            # Ask for the far edge of a cell: it is not known if only its beginning was seen.
            seen = seen_of(free, pose, self._mount, lanes_m, 0.5 * _CELL_M, min_m, hides)
            self._seen_ns = _marked(self._seen_ns, first, seen, self._sight.known_share, captured_ns)
        # Cells too near to be seen again stay free once they were seen free; bodies that may come there are
        # covered by controller/decision/out_of_view.py and worst_case_limit.py.
        near_s_m = s_m + self._mount.forward_m + self._near_m + _CELL_M
        since_ns = captured_ns - round(self._sight.memory_s * NS_PER_S)
        unknown = _first_unknown(
            self._seen_ns, self._cells_m, first, since_ns, near_s_m, self._assumed_free_s_m
        )
        known = unknown == len(self._cells_m)
        self.known_s_m = math.inf if known else float(self._cells_m[unknown]) - 0.5 * _CELL_M

    def _assume_free_below_view(self, free: FreeSpace) -> None:
        """Take in where the view begins.

        The higher the camera, the longer the stretch of floor below its view, which cannot be seen before the
        start. It counts as free by consent, unless it is too long (assumed_free_m).
        """
        near_m = assumed_free_m(self._sight.near_m, free.floor_from_m)
        if near_m > self._near_m:
            self._assumed_free_s_m += near_m - self._near_m
            self._near_m = near_m

    def _seen_from_m(self, free: FreeSpace) -> float:
        """Least distance ahead of the camera at which floor can be seen free.

        Floor too near to be measured was not seen, however far the scan reaches beyond it. Nor was floor
        below the view, where that stretch is longer than what is free by consent.
        """
        min_m = free.blind_m + 0.5 * _CELL_M if free.blind_m > 0.0 else 0.0
        return max(min_m, free.floor_from_m) if free.floor_from_m > self._near_m else min_m


def _lanes_of(corridor: Corridor, cells_m: FloatArray) -> FloatArray:
    """(2, C, L) x and y of L points across the swept width at each of the cells (C,)."""
    x, y, heading = (values[:, None] for values in corridor.path.poses(cells_m))
    half = corridor.half_width(cells_m)[:, None]
    lanes = np.linspace(-1.0, 1.0, _LANES)
    return np.stack((x - np.sin(heading) * half * lanes, y + np.cos(heading) * half * lanes))


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
