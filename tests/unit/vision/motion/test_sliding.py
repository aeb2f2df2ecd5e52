"""The speed along the line of sight, by few fragments of a body that the border of the image cuts."""

from __future__ import annotations

import numpy as np
import pytest

from hal.types import FloatArray
from vision.motion import sliding
from vision.motion.least_squares import BodyVelocities

SIGHT = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]])
USE = np.array([1], np.intp)
AGREES = np.array([1.0, 0.7, 1.0])


def body(ends: int, agreement: FloatArray = AGREES) -> BodyVelocities:
    """Of three tracks."""
    return BodyVelocities(
        velocity_mps=np.zeros((3, 3)),
        covariance=np.tile(0.01 * np.eye(3), (3, 1, 1)),
        agreement=agreement,
        ends=np.full(3, ends),
        contradicts_static=np.ones(3),
    )


def added(ends: int, cut: bool) -> FloatArray:
    (variance,) = sliding.variance(body(ends), np.array([not cut, cut, not cut]), USE, SIGHT)
    result: FloatArray = variance
    return result


def test_few_fragments_of_a_cut_body_tell_no_speed_along_the_sight() -> None:
    along, across = SIGHT[1], np.array([0.8, 0.0, -0.6])
    variance = added(4, cut=True)
    assert along @ variance @ along == pytest.approx(3.0**2)
    np.testing.assert_allclose(variance @ across, 0.0, atol=1e-12)
    np.testing.assert_allclose(variance[:, 1], 0.0)


@pytest.mark.parametrize(("ends", "unsure"), [(2, True), (10, True), (12, False)])
def test_eight_ends_that_agree_are_enough(ends: int, unsure: bool) -> None:
    """Of twelve, 8.4 agree."""
    assert added(ends, cut=True).any() == unsure


def test_of_a_body_seen_from_side_to_side_the_centre_tells_as_well() -> None:
    assert not added(2, cut=False).any()
