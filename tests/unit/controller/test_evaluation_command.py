"""`treadwatch evaluate` from the outside: recordings, and mistakes in one line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from config.app import ReplayConfig
from controller.cli import cli
from controller.errors import UserError
from controller.evaluation.evaluate import EvaluationOptions, choose, run_evaluation
from controller.evaluation.recordings import evaluate_recording
from controller.evaluation.sequences import sequences
from hal.errors import BadRecording

DESK = Path(__file__).parents[2] / "recordings" / "desk_rpy"


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
    assert "| desk_rpy | none | 10 |" in text
    assert (tmp_path / "out" / "recording-desk_rpy-none.png").exists()


def test_without_static_nothing_is_called_false() -> None:
    frames: list[None] = []
    record = evaluate_recording(DESK, "none", False, ReplayConfig(), lambda: frames.append(None))
    assert math.isnan(record.false_per_minute)
    assert len(frames) == record.frames


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


def test_only_without_sim(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="give --sim with it"):
        run_evaluation(EvaluationOptions((DESK,), False, tmp_path, only=("walk-plain",)))


def test_static_without_a_recording(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--static says that nothing moves in the recordings"):
        run_evaluation(EvaluationOptions((), True, tmp_path, static=True))


def test_a_bad_recording_is_told_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match="no such folder"):
        run_evaluation(EvaluationOptions((DESK, tmp_path / "none"), False, tmp_path / "out"))
    assert not (tmp_path / "out").exists()
