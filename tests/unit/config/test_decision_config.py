"""The decision's YAML: defaults that fit together, and what is refused."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.decision import DecisionConfig


def test_defaults_are_complete() -> None:
    config = DecisionConfig()
    assert config.margins.stop_m == 0.45
    assert config.sight.stale_s == 0.3
    assert config.release.hold_s == 2.0


@pytest.mark.parametrize(
    ("section", "values", "said"),
    [
        ("margins", {"stop_m": 0.3, "least_m": 0.4}, "least_m must not be greater than stop_m"),
        ("margins", {"stop_m": 0.0}, "greater than or equal to 0.05"),
        ("margins", {"lateral": 0.1}, "Extra inputs"),
        ("prediction", {"horizon_s": 0.5}, "greater than or equal to 2"),
        ("sight", {"stale_s": 0.0}, "greater than 0"),
        ("sight", {"known_share": 1.5}, "less than or equal to 1"),
        ("sight", {"range_m": float("nan")}, "finite number"),
        ("release", {"dead_band_mps": 0.0}, "greater than 0"),
    ],
)
def test_impossible_values_are_refused(section: str, values: dict[str, float], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        DecisionConfig.model_validate({section: values})
