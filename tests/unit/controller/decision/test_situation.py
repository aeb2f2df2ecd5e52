"""The speed that a decision is made by."""

from __future__ import annotations

import math

import pytest

from controller.decision.situation import speed_to_decide_by


@pytest.mark.parametrize(
    ("commanded_mps", "measured_mps", "expected_mps"),
    [
        (0.5, 0.6, 0.6),
        (0.5, 0.4, 0.5),
        (0.0, -0.04, 0.0),
        (0.5, -0.06, -0.06),
        (0.5, math.nan, 0.5),
        (0.5, math.inf, 0.5),
    ],
)
def test_the_greater_speed_counts_unless_the_base_goes_back(
    commanded_mps: float, measured_mps: float, expected_mps: float
) -> None:
    assert speed_to_decide_by(commanded_mps, measured_mps) == expected_mps
