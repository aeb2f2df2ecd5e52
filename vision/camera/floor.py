"""The floor, found in the depth image: for a hand-held camera, whose mounting is not known.

The inverse depth of a plane is affine in the image, 1/z = a x + b y + c on rays (x, y, 1), and the noise of a
stereo camera is constant in inverse depth, so planes are fitted there. Of all planes below the camera, the
floor is the one with many cells on it and hardly any below it. Also used by vision/camera/mount_check.py.
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

_EVERY = 3  # every third cell is used, in both directions
_TRIES = 96  # random planes: if half of the cells are floor, one try in eight has all three on the floor
_MIN_SHARE = 0.06  # minimum share of the cells that lie on the floor
_BELOW_COSTS = 3.0  # a cell below a plane counts against it three times as much as a cell on it counts for it
_TOLERANCE = 0.012  # 1/m, of a cell on a plane: four standard deviations of a cell
_MIN_UPRIGHT = 0.7  # cosine: a camera held more than 45 degrees off is not expected
_HELD_M = (0.15, 2.5)  # height range: from a small robot's camera to one held above the head
_REFINEMENTS = 3  # repeated fits, each to the cells on the plane before
_KEEP_FRAMES = 5  # the last floor is kept for this many frames; then the camera may have turned too far
_SEARCH_EVERY = 5  # frames between two full searches while a floor is followed
_SIGMA_M = 0.01  # standard deviation of the plane's height
_SIGMA_PER_METRE = 0.006  # and of its tilt: a third of a degree


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """up (3,): unit normal in the camera's optical axes; camera_height_m above the plane."""

    up: FloatArray
    camera_height_m: float


class FloorFinder:
    """Follows the floor from frame to frame.

    The plane of the frame before is refined. Every few frames, and at once when the plane is lost, the whole
    view is searched for planes, and the plane of the frame before is one of the candidates. Until a floor is
    found, every frame is searched. heights_m: minimum and maximum possible height of the camera.
    """

    def __init__(self, heights_m: tuple[float, float] = _HELD_M) -> None:
        self._heights_m = heights_m
        self._plane: FloatArray | None = None
        self._unsearched = _SEARCH_EVERY
        self._missed = 0

    def find(self, grid: DepthGrid) -> Floor | None:
        """The floor in grid. If it is not visible, the last one for a few frames, then None."""
        rows, columns = np.nonzero(grid.valid[::_EVERY, ::_EVERY])
        plane = None
        if len(rows) >= 3:
            cells = np.ones((3, len(rows)))
            cells[0], cells[1] = grid.x[::_EVERY].take(columns), grid.y[::_EVERY].take(rows)
            inverse = grid.inverse_depth[::_EVERY, ::_EVERY][rows, columns].astype(float)
            least = _MIN_SHARE * grid.valid.size / _EVERY**2
            plane = self._plane_in(cells, inverse, least)
        self._missed = 0 if plane is not None else self._missed + 1
        if plane is not None or self._missed > _KEEP_FRAMES:
            self._plane = plane
        return None if self._plane is None else _floor(self._plane)

    def _plane_in(self, cells: FloatArray, inverse: FloatArray, least_cells: float) -> FloatArray | None:
        """(3,) the plane of the floor among cells (3, K); None: not found, or not searched for this time."""
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
    """grid with heights above floor and distances along it."""
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
    """(3,) a, b, c of the plane that is most likely the floor; None if no plane is possible.

    cells (3, K): rays. inverse (K,): their inverse depth. before (3,): plane of the frame before.
    """
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
    """plane (3,) fitted to the cells on it; None if the result is no floor."""
    for _ in range(_REFINEMENTS):
        on_it = np.abs(plane @ cells - inverse) <= _TOLERANCE
        if np.count_nonzero(on_it) < max(3.0, least_cells):
            return None
        # With three unknowns of similar size the normal equations suffice. SVD also handles a single row of
        # cells, which does not determine a plane.
        chosen = cells * on_it
        _, found = cv2.solve(chosen @ cells.T, chosen @ inverse[:, None], flags=cv2.DECOMP_SVD)
        plane = np.asarray(found, np.float64)[:, 0]
    good = _possible(plane[None], heights_m)[0] and _score(plane[None], cells, inverse)[0] > 0.0
    return plane if good else None


def _score(planes: FloatArray, cells: FloatArray, inverse: FloatArray) -> FloatArray:
    """(P,) number of cells on each plane (P, 3), less _BELOW_COSTS times that of the cells below it."""
    above = planes @ cells
    np.subtract(inverse, above, out=above)  # positive: nearer than the plane
    below = np.count_nonzero(above < -2.0 * _TOLERANCE, axis=1)
    on_it = np.count_nonzero(np.abs(above, out=above) <= _TOLERANCE, axis=1)
    result: FloatArray = on_it - _BELOW_COSTS * below
    return result


def _possible(planes: FloatArray, heights_m: tuple[float, float]) -> NDArray[np.bool_]:
    """(P,) which planes (P, 3) lie below an approximately upright camera, at a possible height."""
    low_m, high_m = heights_m
    size = np.sqrt(np.square(planes).sum(axis=1))
    result: NDArray[np.bool_] = (
        (planes[:, 1] >= _MIN_UPRIGHT * size) & (size >= 1.0 / high_m) & (size <= 1.0 / low_m)
    )
    return result


def _floor(plane: FloatArray) -> Floor:
    height_m = 1.0 / float(np.sqrt(plane @ plane))
    return Floor(-plane * height_m, height_m)


@lru_cache(maxsize=1)
def _picks() -> FloatArray:
    """(tries, 3) in [0, 1): positions of the three cells of each try in the list of cells, row by row.

    Two of the three are from the lower half, since the floor is low in the image. The seed is fixed.
    """
    share = np.random.default_rng(1).random((_TRIES, 3))
    share[:, 1:] = 0.5 + 0.5 * share[:, 1:]
    return share
