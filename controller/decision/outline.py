"""How far beside the corridor a body stands, by the outline that depth shows of it.

A body's box is aligned with the direction of view. In a bend, the box of something seen corner-on may reach
into the corridor although the body does not. On a straight path the box is only some centimetres too wide.
controller/decision/standing_limits.py asks for the outlines of bodies close beside the corridor.
"""

from __future__ import annotations

import math

import numpy as np

from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor
from controller.decision.surfaces import Surfaces
from hal.records import record
from hal.types import Flags, FloatArray

# If the outline has a wider gap, in bands, some part of the body was not seen.
_GAP_BANDS = 2.5
# Beside a nearer object, a stereo camera measures nothing for up to this many bands.
_SHADOW_BANDS = 2
# If the outline begins farther than this behind the near side of the box, it belongs to something else behind
# the body, and the body itself gives no depth.
_BEHIND_M = 0.15


@record(frozen=True, slots=True)
class Outline:
    """What depth shows of one body.

    clearance_m: free floor between the visible part of the body and the corridor; negative: inside it; inf:
    nothing of it is visible. whole: the body is visible from end to end.
    """

    clearance_m: float
    whole: bool


def outline_of(
    bodies: Bodies,
    k: int,
    own: Flags,
    surfaces: Surfaces,
    corridor: Corridor,
    stretch_m: tuple[float, float],
    depth_m: float,
) -> Outline:
    """The outline of body k.

    own: (P,) which of the surfaces of the same scene belong to it. stretch_m: the path is searched from the
    first to the second of these. depth_m: least depth of a body, from its nearest point on, since its back is
    hidden.
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
    _, d_m, half_width_m = corridor.locate(outline, *stretch_m)
    clear = np.abs(d_m) - half_band_m - half_width_m
    return Outline(float(clear.min()), whole)


def _seen_throughout(across_m: FloatArray, half_band_m: FloatArray, half_m: float) -> bool:
    """Whether points at across_m (P,) cover the width from -half_m to half_m without a gap."""
    edges = np.concatenate(((-half_m,), np.sort(across_m), (half_m,)))
    return bool(np.diff(edges).max() <= _GAP_BANDS * 2.0 * float(half_band_m.max()))


def _ends_in_view(surfaces: Surfaces, own: Flags) -> bool:
    """Whether farther things are seen beside both ends of the surfaces own (P,).

    Else the body may go on: beyond the edge of the view, where nothing was measured, or behind something
    nearer.
    """
    bands, forward_m = surfaces.bands[own], surfaces.forward_m[own]
    left = surfaces.seen_m[max(bands[0] - _SHADOW_BANDS, 0) : bands[0]][::-1]
    right = surfaces.seen_m[bands[-1] + 1 : bands[-1] + 1 + _SHADOW_BANDS]
    return _beyond(left, float(forward_m[0])) and _beyond(right, float(forward_m[-1]))


def _beyond(seen_m: FloatArray, end_m: float) -> bool:
    """Whether the first measured band of those beside an end, seen_m (K,), is seen farther than end_m."""
    measured = seen_m[seen_m > 0.0]
    return bool(len(measured) and measured[0] > end_m)
