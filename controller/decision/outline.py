"""How far beside the corridor something stands, by the outline that depth shows of it.

An obstacle's box lies along the view. On a straight path that is as good as any, but in a bend the corners of
the box of something seen corner-on reach into a corridor that it leaves free.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor
from controller.decision.surfaces import Surfaces
from hal.records import record
from hal.types import FloatArray

# The outline may have no wider gap, in bands, or something of the body was not seen.
_GAP_BANDS = 2.5
# Beside whatever stands nearer, a stereo camera measures nothing for so many bands.
_SHADOW_BANDS = 2
# Nor may it begin farther behind the near side of the box: then it is something else, behind what gives none.
_BEHIND_M = 0.15


@record(frozen=True, slots=True)
class Outline:
    """clear_m: free floor between what is in view of a body and the swept corridor; negative: inside it; inf:
    nothing is in view. whole: it was seen from end to end, and all of it is in view."""

    clear_m: float
    whole: bool


def outline_of(
    bodies: Bodies,
    k: int,
    own: NDArray[np.bool_],
    surfaces: Surfaces,
    corridor: Corridor,
    stretch_m: tuple[float, float],
    depth_m: float,
) -> Outline:
    """The outline of body k, whose are the own (P,) of the surfaces, which are of the same scene.

    stretch_m: the path is looked at from there to there. depth_m: how deep a body is at least, from the
    nearest point of it on; its back is hidden.
    """
    if not own.any():
        return Outline(math.inf, whole=False)
    view_rad = float(bodies.view_rad[k])
    ahead = np.array([math.cos(view_rad), math.sin(view_rad)])
    outline, half_band_m = surfaces.points_m[own], surfaces.half_band_m[own]
    offset = outline - bodies.xy_m[k]
    along, across = offset @ ahead, offset @ (-ahead[1], ahead[0])
    whole = _seen_throughout(across, half_band_m, float(bodies.half_across_m[k]))
    whole &= float(along.min()) <= _BEHIND_M - float(bodies.half_view_m[k]) and _ends_in_view(surfaces, own)
    if whole:
        hidden_m = max(depth_m - float(np.ptp(along)), 0.0)
        outline = np.concatenate((outline, outline + hidden_m * ahead))
        half_band_m = np.concatenate((half_band_m, half_band_m))
    s, d = corridor.path.project_points(outline, *stretch_m)
    clear = np.abs(d) - half_band_m - corridor.half_width(s)
    return Outline(float(clear.min()), whole)


def _seen_throughout(across_m: FloatArray, half_band_m: FloatArray, half_m: float) -> bool:
    """Whether points at across_m (P,) cover the width from -half_m to half_m without a gap."""
    edges = np.concatenate(((-half_m,), np.sort(across_m), (half_m,)))
    return bool(np.diff(edges).max() <= _GAP_BANDS * 2.0 * float(half_band_m.max()))


def _ends_in_view(surfaces: Surfaces, own: NDArray[np.bool_]) -> bool:
    """Whether farther things are seen beside both ends of the own ones of the points: at the edge of the
    view, beside what was not measured, or behind something nearer, the body may go on."""
    bands, forward_m = surfaces.bands[own], surfaces.forward_m[own]
    left = surfaces.seen_m[max(bands[0] - _SHADOW_BANDS, 0) : bands[0]][::-1]
    right = surfaces.seen_m[bands[-1] + 1 : bands[-1] + 1 + _SHADOW_BANDS]
    return _beyond(left, float(forward_m[0])) and _beyond(right, float(forward_m[-1]))


def _beyond(seen_m: FloatArray, end_m: float) -> bool:
    """Whether the first band that was measured of those beside an end, seen_m (K,), was seen beyond end_m."""
    measured = seen_m[seen_m > 0.0]
    return bool(len(measured) and measured[0] > end_m)
