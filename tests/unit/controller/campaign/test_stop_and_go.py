"""Nav2's bag metrics: the arithmetic on made-up recordings, and a few drives of our own."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.loader import CONFIG_DIR
from config.robot import Robot
from controller import braking
from controller.campaign.stop_and_go import DriveRecording, StopAndGo, measure, read, write
from controller.campaign.stop_and_go_command import TARGETS, StopAndGoOptions, run_stop_and_go
from controller.cli.commands import cli
from controller.errors import UserError

DT_S = 0.02
ROBOT, DECISION = Robot(), DecisionConfig()


def made_up(
    stops_s: float = 14.0, goes_s: float = 21.0, clears_s: float = 20.0, blip: bool = False
) -> DriveRecording:
    """Drives at 1 m/s from 1 s on; a wall in the way from 10 s until clears_s; stands from stops_s until
    goes_s, then drives to 30 s. blip: stands for 1 s at 5 s, for nothing."""
    t = np.arange(0.0, 31.0, DT_S)
    v = np.where((t >= 1.0) & (t < stops_s), 1.0, 0.0)
    v = np.where((t >= goes_s) & (t < 30.0), 1.0, v)
    if blip:
        v = np.where((t >= 5.0) & (t < 6.0), 0.0, v)
    free = np.where((t >= 10.0) & (t < clears_s), 1.5, np.inf)
    return DriveRecording(t, np.cumsum(v) * DT_S, v, (v > 0.0) & (t >= goes_s - 0.5), free)


def measured(recording: DriveRecording) -> StopAndGo:
    return measure(recording, ROBOT, DECISION)


def test_the_times_and_shares_of_a_made_up_drive() -> None:
    found = measured(made_up())
    assert found.to_stop_s == pytest.approx(4.0)
    # 1 / 0.3 + 0.3 / 0.6 s to rest, of which the last 0.02 m/s take sqrt(2 0.02 / 0.6) s.
    assert found.braking_s == pytest.approx(3.8333 - 0.2582, abs=1e-4)
    assert found.hold_share == 1.0
    assert found.to_resume_s == pytest.approx(1.0)
    assert found.starting_s == pytest.approx(math.sqrt(2.0 * 0.1 / 0.6))
    assert found.to_decide_s == pytest.approx(1.0)
    assert found.false_stop_share == 0.0


def test_an_acceleration_has_to_end_before_the_robot_brakes() -> None:
    recording = made_up()
    t, v = recording.times_s, recording.v_mps.copy()
    v[(t >= 8.0) & (t < 14.0)] += 0.1 * (t[(t >= 8.0) & (t < 14.0)] - 10.0)
    comfort = braking.comfort(ROBOT.limits)
    expected_s = braking.stop(1.0, 0.1, comfort).time_s - math.sqrt(2.0 * 0.02 / 0.6)
    assert measured(replace(recording, v_mps=v)).braking_s == pytest.approx(expected_s)
    assert expected_s > 3.8333 - 0.2582


def test_going_on_too_early_is_no_hold() -> None:
    recording = made_up()
    v = recording.v_mps.copy()
    v[(recording.times_s >= 15.0) & (recording.times_s < 16.5)] = 0.05
    assert measured(replace(recording, v_mps=v)).hold_share == pytest.approx(0.75)


def test_a_stop_for_nothing_is_counted_and_standing_at_the_end_is_not() -> None:
    # One second of the 29 - 11 in which no stop was right.
    assert measured(made_up(blip=True)).false_stop_share == pytest.approx(1.0 / 18.0, abs=0.002)


def test_drive_that_never_stops_or_never_goes_on() -> None:
    never = measured(made_up(stops_s=29.0, goes_s=29.0))
    assert (never.to_stop_s, never.hold_share) == (math.inf, 0.0)
    assert [one.missed(never) for one in TARGETS] == [True, True, False, False]
    stays = measured(made_up(goes_s=28.0))
    assert stays.to_stop_s == pytest.approx(4.0)
    assert [one.missed(stays) for one in TARGETS] == [False, False, True, False]


def test_a_way_that_is_never_blocked_has_no_stop() -> None:
    recording = made_up(stops_s=30.0, goes_s=30.0)
    free = DriveRecording(
        recording.times_s,
        recording.s_m,
        recording.v_mps,
        recording.faster,
        np.full(len(recording.times_s), np.inf),
    )
    found = measured(free)
    assert math.isnan(found.to_stop_s)
    assert found.false_stop_share == 0.0
    assert found.as_dict()["to_stop_s"] is None


def test_slowing_down_early_puts_the_stop_off() -> None:
    """At 1 m/s with 1.9 m free a stop is due; at 0.2 m/s it is not, until the wall is near."""
    t = np.arange(0.0, 30.0, DT_S)
    v = np.where(t < 10.2, 1.0, np.where(t < 18.0, 0.2, 0.0))
    free = np.where(t < 10.0, np.inf, np.where(t < 10.2, 1.9, np.maximum(1.9 - 0.2 * (t - 10.2), 0.45)))
    found = measured(DriveRecording(t, np.cumsum(v) * DT_S, v, v > 1.0, free))
    needs_m = braking.required_distance(
        0.2, 0.0, 0.0, DECISION.chassis_delay_s, braking.comfort(ROBOT.limits), 0.45
    )
    assert found.to_stop_s == pytest.approx(18.0 - 10.2 - (1.9 - needs_m) / 0.2, abs=0.05)


def test_a_recording_survives_its_file(tmp_path: Path) -> None:
    recording = made_up()
    write(tmp_path / "drive.csv", recording)
    back = read(tmp_path / "drive.csv")
    for name in ("times_s", "s_m", "v_mps", "faster", "free_m"):
        assert np.allclose(getattr(back, name), getattr(recording, name), atol=1e-3)
    assert measured(back) == measured(recording)


@pytest.mark.parametrize(
    "text", ["", "t_s,s_m\n1,2\n", "t_s,s_m,v_mps,action,free_m\n0,0,nan,0,inf\n", "\x00"]
)
def test_a_file_that_is_no_recording(tmp_path: Path, text: str) -> None:
    (tmp_path / "drive.csv").write_text(text)
    with pytest.raises(UserError, match="is no recording of a drive"):
        read(tmp_path / "drive.csv")
    with pytest.raises(UserError, match="cannot be read"):
        read(tmp_path / "none.csv")


def options(report: Path) -> StopAndGoOptions:
    return StopAndGoOptions(CONFIG_DIR / "sim.yaml", 1, 3, "noise", report, quiet=True)


def test_our_drives_reach_the_targets_and_the_report_is_the_same_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_stop_and_go(options(tmp_path / "a")) == 0
    said = capsys.readouterr().out
    assert said.count("all reach it") == len(TARGETS)
    assert run_stop_and_go(options(tmp_path / "b")) == 0
    drive = "drives/3.csv"
    assert (tmp_path / "a" / drive).read_bytes() == (tmp_path / "b" / drive).read_bytes()
    summary = json.loads((tmp_path / "a" / "summary.json").read_text())
    assert set(summary["drives"]) == {"3"}
    report = (tmp_path / "a" / "report.md").read_text()
    assert "| 3 | " in report
    assert "| hold, share | median 1.000" in report


def test_the_report_gives_the_command_that_repeats_it(tmp_path: Path) -> None:
    config = tmp_path / "my robot.yaml"
    config.write_text((CONFIG_DIR / "sim.yaml").read_text())
    run_stop_and_go(replace(options(tmp_path / "out"), config_path=config))
    given = shlex.split(json.loads((tmp_path / "out" / "summary.json").read_text())["command"])
    again = cli.commands["stop-and-go"].make_context("stop-and-go", given[2:]).params
    assert again["config_path"] == config
    assert (again["drives"], again["seed"], again["mode"]) == (1, 3, "noise")
    assert again["report"] == tmp_path / "out"


def test_a_robot_without_a_simulation_cannot_be_measured(tmp_path: Path) -> None:
    wrong = StopAndGoOptions(CONFIG_DIR / "robot-bunker.yaml", 1, 0, "noise", tmp_path / "out")
    with pytest.raises(UserError, match=r"camera\.kind 'simulated'"):
        run_stop_and_go(wrong)


def test_frames_can_only_be_kept_of_a_camera(tmp_path: Path) -> None:
    wrong = StopAndGoOptions(CONFIG_DIR / "sim.yaml", 1, 0, "noise", tmp_path / "out", keep=True)
    with pytest.raises(UserError, match="--keep needs --mode camera"):
        run_stop_and_go(wrong)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("earlier", ["drives", "report.md"])
def test_an_earlier_report_is_not_overwritten(tmp_path: Path, earlier: str) -> None:
    (tmp_path / earlier).mkdir()
    with pytest.raises(UserError, match=f"{earlier} exists: give another --report folder"):
        run_stop_and_go(options(tmp_path))
