"""How far beside the corridor something stands, by the outline that depth shows of it.

An obstacle's box lies along the view. On a straight path that is as good as any, but in a bend the corners of
the box of something seen corner-on reach into a corridor that it leaves free.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.bodies import Bodies
from controller.corridor import Corridor
from controller.surfaces import Surfaces
from hal.types import FloatArray

# Points so far beside a box are still its own: noise of depth, a box that lags a little.
_AROUND_M = 0.15
# The outline may have no wider gap, in bands, or something of the body was not seen.
_GAP_BANDS = 2.5


def outline_clear_m(
    bodies: Bodies,
    k: int,
    surfaces: Surfaces,
    corridor: Corridor,
    stretch_m: tuple[float, float],
    depth_m: float,
) -> float:
    """Free floor between the outline of body k and the swept corridor; negative: inside it; -inf: its outline
    was not seen from end to end, or may go on outside of the view.

    surfaces: of the same scene. stretch_m: the path is looked at from there to there. depth_m: how deep a
    body is at least, from the nearest point of it on; its back is hidden.
    """
    view_rad = float(bodies.view_rad[k])
    ahead = np.array([math.cos(view_rad), math.sin(view_rad)])
    offset = surfaces.points_m - bodies.xy_m[k]
    along, across = offset @ ahead, offset @ (-ahead[1], ahead[0])
    across_m = float(bodies.half_across_m[k])
    own = (np.abs(along) <= bodies.half_view_m[k] + _AROUND_M) & (np.abs(across) <= across_m + _AROUND_M)
    half_band_m = surfaces.half_band_m[own]
    if not _seen_throughout(across[own], half_band_m, across_m) or _cut_off(surfaces, own):
        return -math.inf
    outline = surfaces.points_m[own]
    hidden_m = max(depth_m - float(np.ptp(along[own])), 0.0)
    points = np.concatenate((outline, outline + hidden_m * ahead))
    s, d = corridor.path.project_points(points, *stretch_m)
    clear = np.abs(d) - np.concatenate((half_band_m, half_band_m)) - corridor.half_width(s)
    return float(clear.min())


def _seen_throughout(across_m: FloatArray, half_band_m: FloatArray, half_m: float) -> bool:
    """Whether points at across_m (P,) cover the width from -half_m to half_m without a gap."""
    if not len(across_m):
        return False
    edges = np.concatenate(((-half_m,), np.sort(across_m), (half_m,)))
    return bool(np.diff(edges).max() <= _GAP_BANDS * 2.0 * float(half_band_m.max()))


def _cut_off(surfaces: Surfaces, own: NDArray[np.bool_]) -> bool:
    """Whether the own ones of the points reach an edge of the view."""
    bands = surfaces.bands[own]
    return bool(bands[0] == 0 or bands[-1] == surfaces.count - 1)
