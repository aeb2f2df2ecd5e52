"""Boxes around what is measured, and how far they are apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.grids import grid_of, labelled, plate
from tests.support.parts import Body, regions
from vision.bodies.boxes import boxes, relations
from vision.depth.regions import Regions, measure

ALL = np.array


def test_gaps_between_boxes_by_hand() -> None:
    parts = regions(Body(0.0), Body(0.7), Body(0.7, z=4.5), Body(0.1))
    gap_m = relations(parts, ALL([0, 0, 0, 2]), ALL([1, 2, 3, 0])).gap_m
    # 0.7 - 0.4 across; then 0.5 - 0.2 in depth with it, either way; overlapping boxes touch.
    np.testing.assert_allclose(gap_m, [0.3, np.hypot(0.3, 0.3), 0.0, np.hypot(0.3, 0.3)], atol=1e-12)


def at(*bbox_px: tuple[float, float, float, float]) -> Regions:
    return replace(regions(*(Body(0.0) for _ in bbox_px)), bbox_px=ALL(bbox_px))


@pytest.mark.parametrize(
    ("small", "overlap", "stacked", "within"),
    [
        ((100.0, 60.0, 120.0, 100.0), 0.0, True, False),  # on top
        ((100.0, 60.0, 120.0, 116.0), 16.0 / 56.0, True, False),  # reaches down by four cells
        ((100.0, 60.0, 120.0, 117.0), 17.0 / 57.0, False, False),
        ((94.0, 60.0, 114.0, 100.0), 0.0, True, False),  # 14 of 20 px are above it
        ((93.0, 60.0, 113.0, 100.0), 0.0, False, False),
        ((100.0, 150.0, 120.0, 200.0), 1.0, False, True),  # half as tall
        ((100.0, 150.0, 120.0, 201.0), 50.0 / 51.0, False, False),
        ((98.0, 150.0, 118.0, 200.0), 0.9, False, True),
        ((97.0, 150.0, 117.0, 200.0), 0.85, False, False),
        ((150.0, 150.0, 150.0, 150.0), 0.0, False, False),  # of no size: nothing of it is covered
    ],
)
def test_how_one_box_lies_to_another_in_the_image(
    small: tuple[float, float, float, float], overlap: float, stacked: bool, within: bool
) -> None:
    lie = relations(at(small, (100.0, 100.0, 160.0, 200.0)), ALL([0]), ALL([1]))
    assert lie.overlap[0] == pytest.approx(overlap)
    assert (lie.stacked[0], lie.within[0]) == (stacked, within)


def test_boxes_agree_with_the_measured_regions() -> None:
    depth_m = plate(3.0, (-0.5, 0.1), (-0.4, 0.6))
    box = boxes(measure(grid_of(depth_m), labelled(depth_m > 0.0), 1))
    np.testing.assert_allclose(box.low_m[0], [-0.5, -0.4, 3.0], atol=0.06)
    np.testing.assert_allclose(box.high_m[0], [0.1, 0.6, 3.0], atol=0.06)
