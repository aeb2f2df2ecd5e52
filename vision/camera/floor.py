"""Where the floor is, found in the depth: for a camera in the hand, whose mounting nobody knows.

The inverse depth of a plane is affine in the image, 1/z = a x + b y + c on rays (x, y, 1), and the noise
of a stereo camera is constant in it, so planes are fitted there. Of all planes below the camera
the floor is the one that much is seen of and under which next to nothing is seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray
from vision.depth.depth_grid import CELL_HEIGHT_NOISE, DepthGrid
from vision.depth.depth_noise import depth_sigma_m

_EVERY = 3  # cells, in both directions
_TRIES = 96  # where half of what is looked at is floor, one in eight hits it three times
_LEAST_SHARE = 0.06  # of the cells looked at: less floor than this is no floor
_BELOW_COSTS = 3.0  # cells seen under a plane speak against it more than cells on it speak for it
_TOLERANCE = 0.012  # 1/m, four standard deviations of a cell
_LEAST_UPRIGHT = 0.7  # cosine: a camera held more askew than 45 degrees is not expected
_HELD_M = (0.15, 2.5)  # as low as a small robot's camera, as high as over a head
_REFINEMENTS = 3  # each from the cells on the plane before
_KEEP_FRAMES = 5  # without it: by then the camera may have turned too far for the last one
_SEARCH_EVERY = 5  # frames, while a floor is followed
_SIGMA_M = 0.01  # of the plane itself
_SIGMA_PER_METRE = 0.006  # and of its tilt: a third of a degree


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """up (3,): unit normal in the camera's optical axes; camera_height_m above the plane."""

    up: FloatArray
    camera_height_m: float


class FloorFinder:
    """Follows the floor from frame to frame. Every few frames, and at once when it is lost, all of the view
    is searched for planes; that of the frame before is compared with them. Until one is found that is done in
    every frame. heights_m: the least and the greatest height of the camera that is possible."""

    def __init__(self, heights_m: tuple[float, float] = _HELD_M) -> None:
        self._heights_m = heights_m
        self._plane: FloatArray | None = None
        self._unsearched = _SEARCH_EVERY
        self._missed = 0

    def find(self, grid: DepthGrid) -> Floor | None:
        """The floor in grid; for a few frames the last one where it is not to be seen, then None."""
        rows, columns = np.nonzero(grid.valid[::_EVERY, ::_EVERY])
        plane = None
        if len(rows) >= 3:
            cells = np.ones((3, len(rows)))
            cells[0], cells[1] = grid.x[::_EVERY].take(columns), grid.y[::_EVERY].take(rows)
            inverse = grid.inverse_depth[::_EVERY, ::_EVERY][rows, columns].astype(float)
            least = _LEAST_SHARE * grid.valid.size / _EVERY**2
            plane = self._plane_in(cells, inverse, least)
        self._missed = 0 if plane is not None else self._missed + 1
        if plane is not None or self._missed > _KEEP_FRAMES:
            self._plane = plane
        return None if self._plane is None else _floor(self._plane)

    def _plane_in(self, cells: FloatArray, inverse: FloatArray, least_cells: float) -> FloatArray | None:
        """(3,) the plane of the floor among cells (3, K); None: not found, or not looked for now."""
        self._unsearched += 1
        due = self._plane is None or self._unsearched >= _SEARCH_EVERY
        if self._plane is not None and not due:
            plane = _refined(self._plane, cells, inverse, least_cells, self._heights_m)
            if plane is not None:
                return plane
            if self._missed > 0:
                return None
        self._unsearched = 0
        best = _best_plane(cells, inverse, self._plane, self._heights_m)
        return None if best is None else _refined(best, cells, inverse, least_cells, self._heights_m)


def on_floor(grid: DepthGrid, floor: Floor, noise: DepthNoise) -> DepthGrid:
    """grid with heights over floor and distances along it."""
    rise = floor.up[0] * grid.x[None, :] + (floor.up[1] * grid.y + floor.up[2])[:, None]
    rise = rise.astype(np.float32)
    ahead = np.array([0.0, 0.0, 1.0]) - floor.up[2] * floor.up
    ahead /= np.sqrt(ahead @ ahead)
    forward = ahead[0] * grid.x[None, :] + (ahead[1] * grid.y + ahead[2])[:, None]
    sigma_m = np.float32(CELL_HEIGHT_NOISE) * depth_sigma_m(grid.depth_m, noise) * np.abs(rise)
    return replace(
        grid,
        forward_m=grid.depth_m * forward.astype(np.float32),
        height_m=np.float32(floor.camera_height_m) + grid.depth_m * rise,
        height_sigma_m=sigma_m + np.float32(_SIGMA_M) + np.float32(_SIGMA_PER_METRE) * grid.depth_m,
        camera_height_m=floor.camera_height_m,
        up=floor.up,
    )


def cells_on(grid: DepthGrid, floor: Floor) -> int:
    """How many cells of grid lie on floor."""
    plane = -floor.up / floor.camera_height_m
    inverse = plane[0] * grid.x[None, :] + (plane[1] * grid.y + plane[2])[:, None]
    return int(np.count_nonzero(grid.valid & (np.abs(inverse - grid.inverse_depth) <= _TOLERANCE)))


def _best_plane(
    cells: FloatArray, inverse: FloatArray, before: FloatArray | None, heights_m: tuple[float, float]
) -> FloatArray | None:
    """(3,) a, b, c of what is most likely the floor of cells (3, K) with inverse depth (K,)."""
    chosen = (_picks() * len(inverse)).astype(np.intp)
    corners = cells[:, chosen].transpose(1, 2, 0)
    flat = np.abs(np.linalg.det(corners)) > 1e-4
    planes = np.linalg.solve(corners[flat], inverse[chosen[flat]][:, :, None])[:, :, 0]
    if before is not None:
        planes = np.concatenate((planes, before[None]))
    planes = planes[_possible(planes, heights_m)]
    if len(planes) == 0:
        return None
    best: FloatArray = planes[_score(planes, cells, inverse).argmax()]
    return best


def _refined(
    plane: FloatArray,
    cells: FloatArray,
    inverse: FloatArray,
    least_cells: float,
    heights_m: tuple[float, float],
) -> FloatArray | None:
    """plane (3,) fitted to the cells on it; None: it is no floor."""
    for _ in range(_REFINEMENTS):
        on_it = np.abs(plane @ cells - inverse) <= _TOLERANCE
        if np.count_nonzero(on_it) < max(3.0, least_cells):
            return None
        # Three unknowns of one size: the normal equations will do. A row of cells only is no plane.
        chosen = cells * on_it
        _, found = cv2.solve(chosen @ cells.T, chosen @ inverse[:, None], flags=cv2.DECOMP_SVD)
        plane = np.asarray(found, np.float64)[:, 0]
    good = _possible(plane[None], heights_m)[0] and _score(plane[None], cells, inverse)[0] > 0.0
    return plane if good else None


def _score(planes: FloatArray, cells: FloatArray, inverse: FloatArray) -> FloatArray:
    """(P,) cells on each plane (P, 3), less those seen through it."""
    above = planes @ cells
    np.subtract(inverse, above, out=above)  # positive: nearer than the plane
    below = np.count_nonzero(above < -2.0 * _TOLERANCE, axis=1)
    on_it = np.count_nonzero(np.abs(above, out=above) <= _TOLERANCE, axis=1)
    result: FloatArray = on_it - _BELOW_COSTS * below
    return result


def _possible(planes: FloatArray, heights_m: tuple[float, float]) -> NDArray[np.bool_]:
    """(P,) which planes (P, 3) lie below a camera held more or less upright."""
    low_m, high_m = heights_m
    size = np.sqrt(np.square(planes).sum(axis=1))
    result: NDArray[np.bool_] = (
        (planes[:, 1] >= _LEAST_UPRIGHT * size) & (size >= 1.0 / high_m) & (size <= 1.0 / low_m)
    )
    return result


def _floor(plane: FloatArray) -> Floor:
    height_m = 1.0 / float(np.sqrt(plane @ plane))
    return Floor(-plane * height_m, height_m)


@lru_cache(maxsize=1)
def _picks() -> FloatArray:
    """(tries, 3) in [0, 1): where three cells of each try lie in the order of rows. The floor is low in the
    image, so two of three come from its lower half. The same in every run."""
    share = np.random.default_rng(1).random((_TRIES, 3))
    share[:, 1:] = 0.5 + 0.5 * share[:, 1:]
    return share
