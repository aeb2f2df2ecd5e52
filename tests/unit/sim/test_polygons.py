from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from hal.types import FloatArray
from sim.polygons import overlap, separation


def square(x: float, y: float, side: float = 1.0) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    h = 0.5 * side
    return np.array([[x + h, y - h], [x + h, y + h], [x - h, y + h], [x - h, y - h]])


def distance(a: FloatArray, b: FloatArray) -> float:
    return float(separation(a[None], b[None])[0])


def test_distance_between_squares_side_by_side() -> None:
    assert distance(square(0, 0), square(3, 0)) == pytest.approx(2.0)


def test_distance_from_corner_to_corner() -> None:
    assert distance(square(0, 0), square(4, 5)) == pytest.approx(5.0)  # 3 and 4 apart


def test_distance_from_corner_to_side() -> None:
    diamond = np.array([[3.0, -1.0], [4.0, 0.0], [3.0, 1.0], [2.0, 0.0]])
    assert distance(square(0, 0), diamond) == pytest.approx(1.5)
    assert distance(diamond, square(0, 0)) == pytest.approx(1.5)


def test_overlap_is_the_shortest_way_out() -> None:
    assert distance(square(0, 0), square(0.9, 0.3)) == pytest.approx(-0.1)


def test_touching_sides_have_no_distance() -> None:
    assert distance(square(0, 0), square(1, 0)) == pytest.approx(0.0)


def reference(a: FloatArray, b: FloatArray) -> float:
    """The same for one pair, in array operations."""
    separation = max(_separation(a, b), _separation(b, a))
    if separation <= 0.0:
        return separation
    return min(_corner_distance(a, b), _corner_distance(b, a))


def _separation(a: FloatArray, b: FloatArray) -> float:
    """The largest gap over the directions of a's outward normals; negative: overlap in all of them."""
    edges = _sides(a)
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    gaps = (b @ normals.T).min(axis=0) - (a * normals).sum(axis=1)
    return float(gaps.max())


def _corner_distance(corners: FloatArray, polygon: FloatArray) -> float:
    """The smallest distance from any corner (K, 2) to any edge of polygon (L, 2)."""
    edge = _sides(polygon)
    to_corner = corners[:, None] - polygon[None]
    fraction = np.clip((to_corner * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
    offset = to_corner - fraction[:, :, None] * edge
    return float(np.sqrt((offset * offset).sum(axis=2).min()))


def _sides(polygon: FloatArray) -> FloatArray:
    """Vectors (K, 2) from each corner to the next."""
    return np.concatenate([polygon[1:], polygon[:1]]) - polygon


def test_separation_is_the_exact_distance_of_every_pair() -> None:
    random = np.random.default_rng(3)

    def box(count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        angle = random.uniform(0.0, math.tau, count)
        half = random.uniform(0.1, 1.0, (count, 2))
        corners = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]) * half[:, None]
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        turned = np.stack(
            (cos * corners[..., 0] - sin * corners[..., 1], sin * corners[..., 0] + cos * corners[..., 1]), 2
        )
        return turned + random.uniform(-1.5, 1.5, (count, 1, 2))

    a, b = box(200), box(200)
    padded = np.concatenate((b, np.repeat(b[:, -1:], 3, axis=1)), axis=1)
    exact = [reference(one, other) for one, other in zip(a, b, strict=True)]
    assert min(exact) < -0.1
    assert max(exact) > 0.5
    assert separation(a, padded) == pytest.approx(np.array(exact), abs=1e-9)
    assert overlap(a, padded).tolist() == [distance <= 0.0 for distance in exact]


@pytest.mark.parametrize("measure", [separation, overlap])
def test_polygons_without_a_partner_are_refused(measure: Callable[[FloatArray, FloatArray], object]) -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    with pytest.raises(ValueError, match="2 polygons cannot be paired with 1"):
        measure(np.stack((square, square)), square[None])
