"""A short campaign from rendering to the report folder."""

from __future__ import annotations

import json
import math
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from controller.errors import UserError
from controller.evaluation.methods.timed_methods import ALWAYS, BASELINES, LIDAR, OURS, OURS_ALONE
from controller.evaluation.report.folder import prepare_folder, write_failures, write_figures, write_texts
from controller.evaluation.report.markdown import fixed, section, table
from controller.evaluation.report.simulated_part import simulated_lines
from controller.evaluation.report.summary import as_json, summarise
from controller.evaluation.report.targets import TARGETS
from controller.evaluation.run_sequence import SequenceRecord, run_sequence
from controller.evaluation.run_set import (
    BASELINE_SEQUENCES,
    SHOWN_FRAMES,
    Task,
    plan,
    run_set,
    run_task,
)
from controller.evaluation.simulated_set.sequences import sequences
from tests.support.evaluation_cases import known

SET = {one.name: one for one in sequences()}
CROSSING = replace(SET["slow-crossing"], duration_s=0.8)
STILL = replace(SET["static-straight"], duration_s=0.3)


def clock() -> Any:
    """Every look at it takes a millisecond."""
    now = iter(range(0, 10**12, 1_000_000))
    return lambda: next(now)


@pytest.fixture(scope="module")
def records() -> tuple[SequenceRecord, ...]:
    crossing = run_sequence(CROSSING, ALWAYS + BASELINES, (10,), clock())
    return crossing, run_sequence(STILL, ALWAYS, (), clock())


def test_every_method_answers_every_frame(records: tuple[SequenceRecord, ...]) -> None:
    crossing, still = records
    assert len(crossing.truths) == 24
    assert set(crossing.methods) == set(ALWAYS + BASELINES)
    assert {len(one.answers) for one in crossing.methods.values()} == {24}
    assert {len(one.answers) for one in still.methods.values()} == {9}


def test_truth_is_that_of_the_walker(records: tuple[SequenceRecord, ...]) -> None:
    walker = records[0].truths[-1].objects[0]
    assert walker.kind == "person"
    assert walker.speed_mps == pytest.approx(1.2)
    # The camera looks 4 degrees down, so a level velocity has a small share upward; to the right it is.
    assert walker.velocity_mps[0] == pytest.approx(1.2, abs=0.01)
    assert walker.visible_px > 400
    assert records[1].truths[0].objects == ()


def test_endpoint_errors_come_from_still_scenes_alone(records: tuple[SequenceRecord, ...]) -> None:
    assert len(records[0].endpoint.error_px) == 0
    assert len(records[1].endpoint.error_px) > 50


def test_durations_are_those_of_the_stopwatch(records: tuple[SequenceRecord, ...]) -> None:
    figures = summarise(records).splits["reporting"][OURS].figures
    assert figures.ms_per_frame == 1.0


def test_two_runs_see_the_same(records: tuple[SequenceRecord, ...]) -> None:
    again = run_sequence(CROSSING, (OURS, LIDAR), (), clock())
    for name in (OURS, LIDAR):
        assert any(answer.detections for answer in again.methods[name].answers)
        for first, second in zip(records[0].methods[name].answers, again.methods[name].answers, strict=True):
            assert [one.id for one in first.detections] == [one.id for one in second.detections]
            for a, b in zip(first.detections, second.detections, strict=True):
                assert np.array_equal(a.position_m, b.position_m, equal_nan=True)
                assert a.confidence == b.confidence


def test_a_worker_says_what_a_direct_call_says() -> None:
    task = Task(STILL, (LIDAR,))
    told: list[str] = []
    (record,) = run_set((task,), 1, lambda one: told.append(one.name))
    direct = run_task(task)
    assert told == [STILL.name]
    positions = [
        [
            one.position_m[[0, 2]].tolist()
            for answer in each.methods[LIDAR].answers
            for one in answer.detections
        ]
        for each in (record, direct)
    ]
    assert positions[0] == positions[1]
    assert positions[0]


def test_summary_has_stable_keys(records: tuple[SequenceRecord, ...]) -> None:
    result = json.loads(json.dumps(as_json(summarise(records)), allow_nan=False))
    assert set(result) == {"version", "splits", "curves", "endpoint_error_px", "sequences"}
    assert set(result["splits"]) == {"reporting", "tuning", "baselines"}
    assert set(result["splits"]["reporting"]) == {OURS, OURS_ALONE, LIDAR}
    assert set(result["splits"]["baselines"]) == set(ALWAYS + BASELINES)
    ours = result["splits"]["reporting"][OURS]
    assert set(ours) == {
        "sequences", "minutes", "object", "frame", "frame_with_first_half_second", "pixel", "ms_per_frame",
        "false_moving_per_minute", "speed_error_mps", "objects_by_distance", "first_detection_s",
    }  # fmt: skip
    assert known(ours["minutes"]) == pytest.approx((0.8 + 0.3) / 60.0, abs=1e-4)
    walker = result["sequences"]["slow-crossing"]["methods"][OURS]["objects"]
    assert all(one["kind"] == "person" for one in walker)
    assert result["endpoint_error_px"]["beyond_2_m_median"] > 0.0


def test_the_report_has_its_sections_figures_and_json(
    records: tuple[SequenceRecord, ...], tmp_path: Path
) -> None:
    prepare_folder(tmp_path)
    summary = summarise(records)
    write_figures(tmp_path, summary, records)
    failures = write_failures(tmp_path, records)
    lines = simulated_lines(summary, records, failures, "treadwatch evaluate --sim")
    write_texts(tmp_path, as_json(summary), lines)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    for title in (
        "## Targets",
        "## Table 2",
        "## Table 1",
        "## Fig. 4",
        "## Fig. 5",
        "## Fig. 6",
        "## By sequence",
    ):
        assert title in text
    assert "| the paper's method | 50 | 40 | 2 | 0.960 | 0.800 | 0.30 |" in text
    assert "| the paper's lidar [20] | 52 | 48 | 0 | 1.000 | 0.923 | 0.26 |" in text
    pictures = [line.split("](")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]
    assert len(pictures) >= 6
    for name in pictures:
        image = cv2.imread(str(tmp_path / name))
        assert image is not None, name
        assert image.std() > 5.0
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["version"] == 1


def test_without_moving_objects_there_are_no_empty_diagrams(
    records: tuple[SequenceRecord, ...], tmp_path: Path
) -> None:
    still = records[1:]
    summary = summarise(still)
    write_figures(tmp_path, summary, still)
    text = "\n".join(simulated_lines(summary, still, [], "treadwatch evaluate --sim"))
    assert {file.name for file in tmp_path.iterdir()} == {"fig5-endpoint-error.png"}
    assert text.count("![") == 1


def test_preparing_removes_what_an_earlier_run_left_and_nothing_else(tmp_path: Path) -> None:
    prepare_folder(tmp_path)
    old = (
        "failures/slow-crossing-012.png",
        "latency.png",
        "recording-desk-none.png",
        "recording-a-file-2.png",
    )
    mine = ("holiday.png", "failures/mine-012.png", "recording-session.png")
    for name in (*old, *mine):
        (tmp_path / name).write_bytes(b"x")
    prepare_folder(tmp_path)
    left = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*")}
    assert left == {*mine, "report.md"}


def test_a_folder_that_cannot_be_made_is_told_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="choose another folder"):
        prepare_folder(tmp_path / "file" / "report")


def test_baselines_look_at_some_sequences_that_exist() -> None:
    assert set(SET) >= BASELINE_SEQUENCES
    assert set(SET) >= set(SHOWN_FRAMES)
    counts = {
        choice: sum(BASELINES[0] in task.methods for task in plan(sequences(), choice))
        for choice in ("none", "some", "all")
    }  # fmt: skip
    assert counts == {"none": 0, "some": len(BASELINE_SEQUENCES), "all": len(SET)}


@pytest.mark.parametrize("without_odometry", [True, False])
def test_a_target_is_reached_missed_or_not_measured(without_odometry: bool) -> None:
    for target in TARGETS:
        verdicts = [target.verdict(value, without_odometry) for value in (0.0, 2.0, math.inf, math.nan)]
        met, not_met = ("missed", "reached") if target.is_minimum else ("reached", "missed")
        assert verdicts == [met, not_met, not_met, "not measured"], target.name


def test_tables_have_three_decimals_and_say_what_is_unknown() -> None:
    assert [fixed(value) for value in (0.12345, float("nan"), float("inf"))] == ["0.123", "n/a", "never"]
    assert table(("a", "b"), [("1", "2")]) == ["| a | b |", "|---|---|", "| 1 | 2 |", ""]
    assert section("T", "two\n   lines") == ["## T", "", "two lines", ""]
    with pytest.raises(ValueError, match="row of 1"):
        table(("a", "b"), [("1",)])


def killed(_: Task) -> SequenceRecord:
    """A worker that the system ends for want of memory."""
    signal.raise_signal(signal.SIGKILL)
    raise AssertionError("nobody is there to raise this")


def test_a_worker_that_died_is_told_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("controller.evaluation.run_set.run_task", killed)
    with pytest.raises(UserError, match="--workers 1"):
        run_set((Task(STILL, (LIDAR,)),), 2, lambda _: None)
