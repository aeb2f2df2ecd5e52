"""`treadwatch evaluate` from the outside: recordings, and mistakes in one line."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from config.app import ReplayConfig
from controller.cli.commands import cli
from controller.errors import UserError
from controller.evaluation.command import EvaluationOptions, choose, command_of, run_evaluation
from controller.evaluation.recordings import distinct_names, evaluate_recording
from controller.evaluation.report.pictures import result_picture
from controller.evaluation.report.recordings_part import recording_lines, write_recording_pictures
from controller.evaluation.simulated_set.sequences import sequences
from hal.errors import BadRecording

DESK = Path(__file__).parents[3] / "recordings" / "desk_rpy"


def test_a_recording_without_truth_is_reported_by_what_is_called_moving(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        cli, ["evaluate", str(DESK), "--static", "--odometry", "none", "--report", str(tmp_path / "out")]
    )
    assert result.exit_code == 0, result.output
    (entry,) = json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
    assert entry["recording"] == "desk_rpy"
    assert entry["frames"] + entry["skipped"] == 10
    assert entry["assumed_static"] is True
    assert entry["false_moving_per_minute"] == pytest.approx(
        entry["moving_objects"] * 60.0 / entry["seconds"], rel=1e-3
    )
    assert entry["ms_per_frame"]["median"] > 0.0
    text = (tmp_path / "out" / "report.md").read_text()
    assert "| desk_rpy | none | 10 | 0 |" in text
    assert (tmp_path / "out" / "recording-desk_rpy-none.png").exists()


def test_two_folders_of_one_name_are_told_apart_and_what_was_skipped_is_told(tmp_path: Path) -> None:
    for parent in ("one", "other"):
        shutil.copytree(DESK, tmp_path / parent / "walk")
    broken = sorted((tmp_path / "other" / "walk" / "rgb").iterdir())[2]
    broken.write_bytes(broken.read_bytes()[:20_000])
    folders = [str(tmp_path / parent / "walk") for parent in ("one", "other")]
    out = tmp_path / "out"
    result = CliRunner().invoke(cli, ["evaluate", *folders, "--odometry", "none", "--report", str(out)])
    assert result.exit_code == 0, result.output
    assert "recording     one/walk: 10 frames, " in result.output
    assert "recording     other/walk: 9 frames, 1 skipped, " in result.output
    entries = json.loads((out / "summary.json").read_text())["recordings"]
    assert [entry["recording"] for entry in entries] == ["one/walk", "other/walk"]
    assert "| other/walk | none | 9 | 1 |" in (out / "report.md").read_text()
    assert (out / "recording-one-walk-none.png").exists()
    assert (out / "recording-other-walk-none.png").exists()


def test_names_are_as_long_as_it_takes_and_a_recording_given_twice_is_refused() -> None:
    folders = [Path("/a/b/x"), Path("/c/b/x"), Path("/a/b/y")]
    assert distinct_names(folders) == ["a/b/x", "c/b/x", "y"]
    with pytest.raises(UserError, match="/a/b/x: is given twice; once is enough"):
        distinct_names([Path("/a/b/x"), Path("/a/../a/b/x")])


def test_each_recording_has_a_picture_of_its_own(tmp_path: Path) -> None:
    """The name of the folder a/b reads like that of the folder a-b."""
    one = evaluate_recording(DESK, "none", False, ReplayConfig())
    records = [replace(one, name=name) for name in ("a/b", "a-b", "c", "a/b")]
    write_recording_pictures(tmp_path, records)
    files = [f"recording-{stem}.png" for stem in ("a-b-none", "a-b-none-2", "c-none", "a-b-none-3")]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)
    shown = [line for line in recording_lines(records, "") if line.startswith("![")]
    assert shown == [f"![{record.name}]({file})" for record, file in zip(records, files, strict=True)]


def test_without_static_nothing_is_called_false() -> None:
    frames: list[None] = []
    record = evaluate_recording(DESK, "none", False, ReplayConfig(), lambda: frames.append(None))
    assert math.isnan(record.false_per_minute)
    assert len(frames) == record.frames


def test_a_report_says_what_makes_it_again() -> None:
    recordings = (Path("/data/my walk"), Path("b"))
    options = EvaluationOptions(recordings, False, Path("out"), odometry="none", static=True)
    command = "treadwatch evaluate '/data/my walk' b --odometry none --static --report out"
    assert command_of(options) == command
    assert any(f"Made by `{command}`." in line for line in recording_lines([], command))
    simulated = EvaluationOptions((), True, Path("out"), baselines="all", only=("bend-group",))
    assert command_of(simulated) == (
        "treadwatch evaluate --sim --baselines all --only bend-group --report out"
    )


def test_nothing_to_evaluate(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="nothing to evaluate; give recordings, or --sim"):
        run_evaluation(EvaluationOptions((), False, tmp_path))


def test_an_unknown_sequence_is_named_with_those_that_exist() -> None:
    with pytest.raises(
        UserError, match="--only nonsense: there is no such sequence; choose among still-cross"
    ):
        choose(("nonsense",))
    assert [one.name for one in choose(("walk-plain",))] == ["walk-plain"]
    assert choose(()) == sequences()


def test_only_is_refused_without_sim(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="give --sim with it"):
        run_evaluation(EvaluationOptions((DESK,), False, tmp_path, only=("walk-plain",)))


def test_static_without_a_recording(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--static says that nothing moves in the recordings"):
        run_evaluation(EvaluationOptions((), True, tmp_path, static=True))


def test_a_bad_recording_is_told_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match="no such folder"):
        run_evaluation(EvaluationOptions((DESK, tmp_path / "none"), False, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_the_picture_of_a_recording_is_the_frame_with_most_objects() -> None:
    """Also where nothing moves, as here."""
    one = evaluate_recording(DESK, "none", False, ReplayConfig())
    first = one.pictures[0]
    assert first.index > 2
    assert len(first.detections) >= 5
    plain = np.asarray(cv2.convertScaleAbs(first.colour, alpha=0.8))
    only_boxes = result_picture(replace(first, fragments=None))
    assert (only_boxes != plain).any()
