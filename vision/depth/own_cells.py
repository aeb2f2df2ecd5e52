"""Cells of the depth grid that show the robot itself (`camera.own_parts`), not its surroundings.

vision/camera/own_parts.py knows where they may be. Their depth has been taken out of the image before the
grid is made, so they are not valid: no part, no floor and no obstacle is made of them. Two things set them
apart from cells in which nothing was measured:

* They are nearer than all beside them: a body that ends at one is hidden there (occlusion.py, rims.py).
* They are like pixels outside of the image: no hole in the floor (free_space.py). Floor that they hide is not
  seen, as floor below the view is not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hal.types import CameraMount, Intrinsics
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid, floor_ray

# Floor that is hidden up to this forward distance counts as below the view. It is as much as the decision
# takes as free without having seen it (controller/decision/view_edges.py). What hides more leaves a hole.
MOST_HIDDEN_M = 2.5


@dataclass(frozen=True, slots=True, eq=False)
class OwnCells:
    """Where own parts may be in the grid of one camera, (h, w) each.

    may_be: inside a silhouette, or beside one, where a stereo camera measures nothing.
    inverse: 1/m, of the far side of the part; 0 outside of the silhouettes.
    hidden_m: forward distance up to which floor may be hidden; 0.0: none.
    """

    may_be: BoolGrid
    inverse: FloatGrid
    hidden_m: float


def with_own(grid: DepthGrid, own: OwnCells) -> DepthGrid:
    """grid with the cells marked that show an own part now. What is seen over a part stays as it is."""
    shown = own.may_be & ~grid.valid & ~grid.beyond
    inverse = np.where(shown, own.inverse, grid.inverse_depth)
    return replace(grid, own=shown, inverse_depth=inverse, hidden_m=own.hidden_m)


def hidden_floor_m(may_be: BoolGrid, mount: CameraMount, camera: Intrinsics, y_px: FloatGrid) -> float:
    """OwnCells.hidden_m. y_px (h,): pixel rows of the cells of may_be (h, w).

    It is where the floor comes into view above the silhouettes. Columns in which that is farther than
    MOST_HIDDEN_M do not count: there the floor is a hole, which no assumption covers.
    """
    columns = np.flatnonzero(may_be.any(axis=0))
    above = may_be.argmax(axis=0)[columns] - 1
    above = above[above >= 0]
    if not len(above):
        return 0.0
    ahead, drop = floor_ray((y_px[above].astype(float) - camera.cy) / camera.fy, mount.pitch_rad)
    with np.errstate(divide="ignore"):
        forward_m = np.where(drop > 0.0, mount.height_m * ahead / drop, np.inf)
    near = forward_m <= MOST_HIDDEN_M
    return float(forward_m[near].max()) if near.any() else 0.0
