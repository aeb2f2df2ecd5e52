"""A path as a chain of pieces of constant curvature; a blend (a clothoid) is a chain of short ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from config.path import ArcSpec, PathSpec

# The body overhangs both ends of the path, so the path is extended straight on for what stands beyond them.
EXTENSION_M = 20.0
_BLEND_PIECES = 16
# The chord of an arc that turns by less is as long as the arc, to a double's precision.
_STRAIGHT_RAD = 1e-7


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of constant curvature that begins at s_m along the path, at the pose x_m, y_m, heading_rad."""

    s_m: float
    length_m: float
    x_m: float
    y_m: float
    heading_rad: float
    curvature_1pm: float


def pieces_of(spec: PathSpec) -> list[Piece]:
    """The pieces of a path, end to end, with a straight extension at either end."""
    chain = list(_chain(spec))
    return [_extension_back(chain[0]), *chain, _extension_ahead(chain[-1])]


def along_arc(
    x_m: float, y_m: float, heading_rad: float, curvature_1pm: float, along_m: float
) -> tuple[float, float, float]:
    """x_m, y_m and heading_rad (not wrapped) along_m after this pose, on an arc of this curvature."""
    half_turn = 0.5 * curvature_1pm * along_m
    chord = along_m * (math.sin(half_turn) / half_turn if abs(half_turn) > _STRAIGHT_RAD else 1.0)
    middle = heading_rad + half_turn
    return x_m + chord * math.cos(middle), y_m + chord * math.sin(middle), middle + half_turn


def _chain(spec: PathSpec) -> Iterator[Piece]:
    """The pieces, end to end, without the extensions."""
    s = 0.0
    x, y = spec.start.x_m, spec.start.y_m
    heading = math.radians(spec.start.heading_deg)
    for segment in spec.segments:
        steps = _arc_pieces(segment) if isinstance(segment, ArcSpec) else [(segment.length_m, 0.0)]
        for length, curvature in steps:
            yield Piece(s, length, x, y, heading, curvature)
            x, y, heading = along_arc(x, y, heading, curvature, length)
            s += length


def _arc_pieces(arc: ArcSpec) -> list[tuple[float, float]]:
    """(length, curvature) of blend in, circle and blend out; a blend turns as an arc of half its length."""
    curvature = math.copysign(1.0 / arc.radius_m, arc.angle_deg)
    circle_m = arc.length_m - 2.0 * arc.blend_m
    # No piece turns by more than 90 degrees, so the angle of a point about its centre is never ambiguous.
    parts = max(1, math.ceil(circle_m * abs(curvature) / (math.pi / 2.0) - 1e-9))
    circle = [(circle_m / parts, curvature)] * parts if circle_m > 0.0 else []
    if arc.blend_m == 0.0:
        return circle
    step_m = arc.blend_m / _BLEND_PIECES
    rise = [(step_m, curvature * (k + 0.5) / _BLEND_PIECES) for k in range(_BLEND_PIECES)]
    return [*rise, *circle, *reversed(rise)]


def _extension_back(piece: Piece) -> Piece:
    x, y, heading = along_arc(piece.x_m, piece.y_m, piece.heading_rad, 0.0, -EXTENSION_M)
    return Piece(-EXTENSION_M, EXTENSION_M, x, y, heading, 0.0)


def _extension_ahead(piece: Piece) -> Piece:
    x, y, heading = along_arc(piece.x_m, piece.y_m, piece.heading_rad, piece.curvature_1pm, piece.length_m)
    return Piece(piece.s_m + piece.length_m, EXTENSION_M, x, y, heading, 0.0)
