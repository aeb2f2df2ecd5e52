"""A path as a chain of pieces of constant curvature; a blend (a clothoid) is a chain of short ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from config.path import ArcSpec, PathSpec
from hal.types import FloatArray

# The body overhangs both ends of the path, so the path is extended straight on for what stands beyond them.
EXTENSION_M = 20.0
_BLEND_PIECES = 16


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


def sinc(angle_rad: FloatArray) -> FloatArray:
    """sin(x) / x for |x| <= pi / 4 (no piece turns by more than 90 degrees), to 1e-11."""
    square = angle_rad * angle_rad
    series: FloatArray = 1.0 - square / 6.0 * (
        1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0 * (1.0 - square / 110.0)))
    )
    return series


def _chain(spec: PathSpec) -> Iterator[Piece]:
    """The pieces, end to end, without the extensions."""
    s = 0.0
    x, y = spec.start.x_m, spec.start.y_m
    heading = math.radians(spec.start.heading_deg)
    for segment in spec.segments:
        steps = _arc_pieces(segment) if isinstance(segment, ArcSpec) else [(segment.length_m, 0.0)]
        for length, curvature in steps:
            yield Piece(s, length, x, y, heading, curvature)
            half_turn = 0.5 * curvature * length
            chord = length * float(sinc(np.array(half_turn)))
            x += chord * math.cos(heading + half_turn)
            y += chord * math.sin(heading + half_turn)
            heading += 2.0 * half_turn
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
    return Piece(
        -EXTENSION_M,
        EXTENSION_M,
        piece.x_m - EXTENSION_M * math.cos(piece.heading_rad),
        piece.y_m - EXTENSION_M * math.sin(piece.heading_rad),
        piece.heading_rad,
        0.0,
    )


def _extension_ahead(piece: Piece) -> Piece:
    turn = piece.curvature_1pm * piece.length_m
    chord = piece.length_m * float(sinc(np.array(turn / 2.0)))
    return Piece(
        piece.s_m + piece.length_m,
        EXTENSION_M,
        piece.x_m + chord * math.cos(piece.heading_rad + turn / 2.0),
        piece.y_m + chord * math.sin(piece.heading_rad + turn / 2.0),
        piece.heading_rad + turn,
        0.0,
    )
