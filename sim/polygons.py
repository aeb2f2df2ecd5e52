"""Distances of convex polygons on the floor, many pairs at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray


def _check_pairs(a: FloatArray, b: FloatArray) -> None:
    if len(a) != len(b):
        raise ValueError(f"{len(a)} polygons cannot be paired with {len(b)}")


def separation(a: FloatArray, b: FloatArray) -> FloatArray:
    """Distances (P,) of pairs of convex polygons a (P, K, 2) and b (P, L, 2), counter-clockwise.

    If they overlap: minus the smallest translation that separates them (separating axis theorem). A repeated
    corner does not matter. Raises ValueError if the numbers of polygons differ.
    """
    _check_pairs(a, b)
    return _separation(a, b)


def overlap(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """Whether separation() is 0 or less (P,). Raises ValueError as separation() does."""
    _check_pairs(a, b)
    return _overlap(a, b)


@inlined
def _widest_gap(a: FloatArray, b: FloatArray) -> float:
    """The widest gap between polygons (K, 2) and (L, 2) along the normals of the first one's edges."""
    widest = -math.inf
    for k in range(len(a)):
        next_corner = (k + 1) % len(a)
        edge_x, edge_y = a[next_corner, 0] - a[k, 0], a[next_corner, 1] - a[k, 1]
        length = math.hypot(edge_x, edge_y)
        if length <= 1e-12:
            continue
        normal_x, normal_y = edge_y / length, -edge_x / length
        nearest = math.inf
        for j in range(len(b)):
            nearest = min(nearest, b[j, 0] * normal_x + b[j, 1] * normal_y)
        widest = max(widest, nearest - (a[k, 0] * normal_x + a[k, 1] * normal_y))
    return widest


@inlined
def _corner_distance(corners: FloatArray, polygon: FloatArray) -> float:
    """The smallest distance of corners (K, 2) from the edges of a polygon (L, 2)."""
    nearest = math.inf
    for j in range(len(polygon)):
        next_corner = (j + 1) % len(polygon)
        edge_x, edge_y = polygon[next_corner, 0] - polygon[j, 0], polygon[next_corner, 1] - polygon[j, 1]
        square = max(edge_x * edge_x + edge_y * edge_y, 1e-24)
        for k in range(len(corners)):
            dx, dy = corners[k, 0] - polygon[j, 0], corners[k, 1] - polygon[j, 1]
            fraction = min(max((dx * edge_x + dy * edge_y) / square, 0.0), 1.0)
            dx, dy = dx - fraction * edge_x, dy - fraction * edge_y
            nearest = min(nearest, dx * dx + dy * dy)
    return math.sqrt(nearest)


@compiled("float64[:, :, :], float64[:, :, :]")
def _separation(a: FloatArray, b: FloatArray) -> FloatArray:
    gaps = np.empty(len(a))
    for p in range(len(a)):
        first, second = a[p], b[p]
        gaps[p] = max(_widest_gap(first, second), _widest_gap(second, first))
        if gaps[p] > 0.0:
            gaps[p] = min(_corner_distance(first, second), _corner_distance(second, first))
    return gaps


@compiled("float64[:, :, :], float64[:, :, :]")
def _overlap(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    touching = np.empty(len(a), np.bool_)
    for p in range(len(a)):
        first, second = a[p], b[p]
        touching[p] = _widest_gap(first, second) <= 0.0 and _widest_gap(second, first) <= 0.0
    return touching
