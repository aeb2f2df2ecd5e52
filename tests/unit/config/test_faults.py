"""The section `faults` of a scenario."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.faults import NO_FAULTS, Faults
from config.loader import ConfigError
from config.scenario import load_scenario, scenario_names

EVERY_FAULT = Path(__file__).parents[2] / "scenarios" / "faults.yaml"


def test_a_scenario_says_every_fault() -> None:
    scenario = load_scenario(EVERY_FAULT)
    faults = scenario.faults
    assert all(getattr(faults, name) for name in Faults.model_fields), "one key each"
    assert [faults.is_silent(t_s) for t_s in (0.99, 1.0, 1.49, 1.5, 3.1)] == [False, True, True, False, True]
    assert [faults.is_frozen(t_s) for t_s in (1.99, 2.0, 2.5)] == [False, True, False]
    assert [faults.late_by(t_s) for t_s in (3.9, 4.0, 6.0)] == [0.0, 0.2, 0.0]
    assert scenario.bodies[0].glass


def test_the_scenarios_that_ship_have_none() -> None:
    assert all(load_scenario(name).faults == NO_FAULTS for name in scenario_names())


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            "no_frames: [{start_s: 2.0, end_s: 1.0}]",
            r"no_frames.0: end_s \(1\) must be more than start_s",
        ),
        ("no_frames: {start_s: 1.0, end_s: 2.0}", "faults.no_frames: Input should be a list"),
        ("late_frames: [{start_s: 1.0, end_s: 2.0}]", "faults.late_frames.0.delay_s: missing key"),
        ("yaw_slip: 0.9", "faults.yaw_slip: Input should be less than or equal to 0.5"),
        ("frozen_frame: []", "faults.frozen_frame: unknown key; did you mean frozen_frames"),
        ("vibration: {frequency_hz: 8.0}", "faults.vibration.amplitude_deg: missing key"),
    ],
)
def test_a_wrong_fault_is_refused_with_its_key(said: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "wrong.yaml"
    path = "path: {segments: [{kind: line, length_m: 4.0}]}"
    file.write_text(f"name: wrong\n{path}\nfaults:\n  {said}\n")
    with pytest.raises(ConfigError, match=told):
        load_scenario(file)
