"""Boxes around what is measured, and how far they are apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.grids import grid_of, labelled, plate
from tests.support.parts import Body, regions
from vision.bodies.boxes import Boxes, boxes, gaps_m
from vision.depth.regions import measure

ALL = np.array


def test_gaps_between_boxes_by_hand() -> None:
    box = boxes(regions(Body(0.0), Body(0.7), Body(0.7, z=4.5), Body(0.1)))
    first, second = ALL([0, 0, 0]), ALL([1, 2, 3])
    # 0.7 - 0.4 across; then 0.5 - 0.2 in depth with it; overlapping boxes touch.
    np.testing.assert_allclose(gaps_m(box, first, box, second), [0.3, np.hypot(0.3, 0.3), 0.0], atol=1e-12)
    other = Boxes(ALL([[1.2, 0.0, 4.0]]), ALL([[1.4, 0.1, 4.1]]))
    assert gaps_m(box, ALL([0]), other, ALL([0]))[0] == pytest.approx(1.0)


def test_what_is_measured_of_a_grid_agrees_with_its_boxes() -> None:
    depth_m = plate(3.0, (-0.5, 0.1), (-0.4, 0.6))
    box = boxes(measure(grid_of(depth_m), labelled(depth_m > 0.0), 1))
    np.testing.assert_allclose(box.low_m[0], [-0.5, -0.4, 3.0], atol=0.06)
    np.testing.assert_allclose(box.high_m[0], [0.1, 0.6, 3.0], atol=0.06)
