"""What is made of a detection for the verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.support.detections import detection
from tests.support.grids import grid_of, wall
from vision.bodies.motion_evidence import borne_out


@pytest.mark.parametrize(
    ("inlier_ratio", "expected"),
    [(1.0, 1.0), (0.65, 1.0), (0.55, 0.5), (0.50, 0.25), (0.46, 0.2), (0.45, 0.2), (math.nan, 0.2)],
)
def test_without_odometry_the_agreement_of_the_fragments_bears_out_the_cameras_motion(
    inlier_ratio: float, expected: float
) -> None:
    """In full from 0.65 on; no more than 0.2 where hardly more agree than have to."""
    plain = detection(grid_of(wall(3.0)))
    alone = replace(plain, reckoned=False, ego_motion=replace(plain.ego_motion, inlier_ratio=inlier_ratio))
    assert borne_out(alone) == pytest.approx(expected)
    assert borne_out(replace(alone, reckoned=True)) == 1.0, "odometry says it, too"
