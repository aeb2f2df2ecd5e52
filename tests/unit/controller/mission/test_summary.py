from dataclasses import replace

import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.build import build_control
from controller.mission.result import MissionResult
from controller.mission.summary import length_text, report, summary_rows
from controller.record.tally import SetpointTally
from controller.shape import SpeedShaper
from controller.terminal.console import Console
from hal.types import ChassisState, Setpoint
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.scenes import scene

CONFIG_PATH = CONFIG_DIR / "sim.yaml"


class WarmChassis(ObedientChassis):
    """Drives, and complains."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        return replace(super().exchange(setpoint, now_ns), faults=("warning: board warm",))


def drive(seconds: float, sees: bool, chassis: ObedientChassis | None = None) -> MissionResult:
    """The first seconds of the simulated mission, with a free way in sight or nothing at all."""
    config = load_app(CONFIG_PATH)
    loop = build_control(config, chassis or ObedientChassis())
    result = MissionResult(loop=loop, setpoints=SetpointTally(config.robot.limits, PERIOD_S))
    console = Console(quiet=False)
    for index in range(round(seconds / PERIOD_S)):
        now_ns = round(index * PERIOD_S * 1e9)
        step = loop.step(scene(now_ns, index, pose=loop.localiser.pose) if sees else None, now_ns)
        result.take(step)
        report(console, result, step)
    return result


def test_a_mission_that_gets_nowhere_tells_why(capsys: pytest.CaptureFixture[str]) -> None:
    result = drive(21.0, sees=False)
    told = [line for line in capsys.readouterr().out.splitlines() if "standing for" in line]
    assert [line.split(":")[0].strip() for line in told] == [
        "10.00 s  standing for 10 s, since 0.00 s",
        "20.00 s  standing for 20 s, since 0.00 s",
    ]
    assert result.last is not None
    reason = result.last.decision.reason.sentence
    assert all(line.endswith(reason) for line in told)
    rows = dict(summary_rows(load_app(CONFIG_PATH), result))
    assert rows["standing"] == f"for the last 21.0 s: {reason}"
    left_m = result.loop.path.length_m - result.last.progress_m
    assert left_m > 1.0
    assert rows["target"].startswith(f"+{left_m:.2f} m to go by odometry, 0.0 cm beside the path")


def test_the_limits_line_tells_of_braking_and_of_jerk_beyond_comfort() -> None:
    result, config = drive(0.1, sees=False), load_app(CONFIG_PATH)
    assert "(comfort 0.3, 0.6; kept by all), 0 reversals" in dict(summary_rows(config, result))["limits"]
    tally = result.setpoints
    tally.emergency_count, tally.hard_braking_count, tally.high_jerk_count = 3, 1, 2
    told = dict(summary_rows(config, result))["limits"]
    assert "(comfort 0.3, 0.6; 3 setpoints beyond: 1 braked harder, 2 had more jerk), 0 reversals" in told


def test_far_is_told_in_metres_and_near_in_centimetres() -> None:
    assert length_text(5.023, "+") == "+5.02 m"
    assert length_text(-1.0, "+") == "-1.00 m"
    assert length_text(0.9996) == "1.00 m"
    assert length_text(0.0213, "+") == "+2.1 cm"
    assert length_text(-0.004, "+") == "-0.4 cm"
    assert length_text(0.994) == "99.4 cm"


def test_a_shaper_that_had_to_brake_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    config = load_app(CONFIG_PATH)
    assert "shaper" not in dict(summary_rows(config, drive(2.0, sees=True)))

    def fail(*_: object) -> tuple[float, float]:
        raise ArithmeticError("no profile")

    monkeypatch.setattr(SpeedShaper, "_follow", fail)
    rows = dict(summary_rows(config, drive(2.0, sees=True)))
    # Armed after three exchanges: the fifth step is the first one that is shaped.
    assert rows["shaper"] == "braked by the stop profile in 96 steps; first: ruckig: no profile"


def test_frames_that_were_left_out_are_told_and_otherwise_nothing_is() -> None:
    config, result = load_app(CONFIG_PATH), drive(1.0, sees=True)
    assert "frames" not in dict(summary_rows(config, result))
    for sequence in (1, 4):
        result.frames.add(sequence)
    assert dict(summary_rows(config, result))["frames"].startswith("2 of the camera's 4 were processed")


def test_a_mission_that_gets_on_says_nothing_of_standing(capsys: pytest.CaptureFixture[str]) -> None:
    result = drive(12.0, sees=True)
    assert "standing" not in capsys.readouterr().out
    assert "standing" not in dict(summary_rows(load_app(CONFIG_PATH), result))


def test_complaint_of_the_base_is_shown_once_and_in_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    assert "base" not in dict(summary_rows(load_app(CONFIG_PATH), drive(1.0, sees=True)))
    result = drive(1.0, sees=True, chassis=WarmChassis())
    assert capsys.readouterr().out.count("the base says: warning: board warm (battery 48.0 V)") == 1
    assert dict(summary_rows(load_app(CONFIG_PATH), result))["base"] == "warning: board warm"
