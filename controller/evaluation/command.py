"""`treadwatch evaluate`: evaluates the simulated set, recordings, or both, and writes one report folder."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence as ReadOnly
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from config.app import ReplayConfig
from config.camera import OdometryChoice
from controller.build import open_replay
from controller.errors import UserError
from controller.evaluation.methods.timed_methods import OURS, OURS_ALONE
from controller.evaluation.recordings import RecordingRecord, distinct_names, evaluate_recording
from controller.evaluation.report.folder import prepare_folder, write_failures, write_figures, write_texts
from controller.evaluation.report.markdown import fixed
from controller.evaluation.report.recordings_part import (
    recording_lines,
    recordings_json,
    write_recording_pictures,
)
from controller.evaluation.report.simulated_part import simulated_lines
from controller.evaluation.report.summary import Summary, as_json, summarise
from controller.evaluation.report.targets import TARGETS
from controller.evaluation.run_sequence import SequenceRecord
from controller.evaluation.run_set import Baselines, plan, run_set
from controller.evaluation.simulated_set.sequences import Sequence, sequences
from controller.terminal.outlet import say


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """The command line of `treadwatch evaluate`. only: names of sequences; empty: all of them."""

    recordings: tuple[Path, ...]
    simulated: bool
    report: Path
    odometry: OdometryChoice = "auto"
    static: bool = False
    baselines: Baselines = "some"
    only: tuple[str, ...] = ()
    workers: int = 2
    quiet: bool = False


def run_evaluation(options: EvaluationOptions) -> None:
    """Evaluate, and write the report.

    Raises UserError or HalError: nothing to evaluate, an unknown sequence, a bad recording, or a report
    folder that cannot be written.
    """
    if not options.recordings and not options.simulated:
        raise UserError("there is nothing to evaluate; give recordings, or --sim for the simulated set")
    if options.only and not options.simulated:
        raise UserError("--only chooses among the simulated sequences; give --sim with it")
    if options.static and not options.recordings:
        raise UserError("--static says that nothing moves in the recordings; give recordings with it")
    selected = choose(options.only)
    for folder in options.recordings:
        open_replay(folder, options.odometry)  # reports a bad recording now, not after minutes
    names = distinct_names(options.recordings)
    prepare_folder(options.report)
    result: dict[str, Any] = {}
    lines: list[str] = []
    if options.simulated:
        records = _simulated(options, selected)
        summary = summarise(records)
        write_figures(options.report, summary, records)
        failures = write_failures(options.report, records)
        result.update(as_json(summary))
        lines.extend(simulated_lines(summary, records, failures, command_of(options)))
        _print_figures(summary)
    if options.recordings:
        recording_records = [
            _recording(options, path, name) for path, name in zip(options.recordings, names, strict=True)
        ]
        write_recording_pictures(options.report, recording_records)
        result["recordings"] = recordings_json(recording_records)
        lines.extend(recording_lines(recording_records, command_of(options)))
        _print_recordings(recording_records)
    write_texts(options.report, result, lines)
    say(f"report        {options.report / 'report.md'}")


def choose(names: tuple[str, ...]) -> tuple[Sequence, ...]:
    """The named sequences, or all if there are no names. Raises UserError for an unknown name."""
    available = sequences()
    unknown = sorted(set(names) - {sequence.name for sequence in available})
    if unknown:
        known = ", ".join(sequence.name for sequence in available)
        raise UserError(f"--only {unknown[0]}: there is no such sequence; choose among {known}")
    return tuple(sequence for sequence in available if not names or sequence.name in names)


def _simulated(options: EvaluationOptions, selected: tuple[Sequence, ...]) -> tuple[SequenceRecord, ...]:
    tasks = plan(selected, options.baselines)
    with click.progressbar(
        length=len(tasks), label="simulated sequences", file=sys.stderr, hidden=_hidden(options)
    ) as bar:
        return run_set(tasks, options.workers, lambda _: bar.update(1))


def _recording(options: EvaluationOptions, folder: Path, name: str) -> RecordingRecord:
    source, _ = open_replay(folder, options.odometry)
    with click.progressbar(
        length=source.frame_count, label=name, file=sys.stderr, hidden=_hidden(options)
    ) as bar:
        return evaluate_recording(
            folder, options.odometry, options.static, ReplayConfig(), lambda: bar.update(1), name
        )


def _hidden(options: EvaluationOptions) -> bool:
    return options.quiet or not sys.stderr.isatty()


def command_of(options: EvaluationOptions) -> str:
    """The command that makes this report again."""
    parts = ["treadwatch", "evaluate", *map(str, options.recordings)]
    if options.recordings and options.odometry != "auto":
        parts.extend(("--odometry", options.odometry))
    if options.static:
        parts.append("--static")
    if options.simulated:
        parts.append("--sim")
    if options.baselines != "some":
        parts.extend(("--baselines", options.baselines))
    for name in options.only:
        parts.extend(("--only", name))
    return shlex.join([*parts, "--report", str(options.report)])


def _print_figures(summary: Summary) -> None:
    """Print the figures that have targets, on one screen."""
    for split in ("reporting", "tuning"):
        methods = summary.splits[split]
        for name, without_odometry in ((OURS, False), (OURS_ALONE, True)):
            if name not in methods:
                continue
            figures = methods[name].figures
            objects = figures.objects
            found = f"{objects.correct} of {objects.correct + objects.missed} found, {objects.wrong} wrong"
            say(f"{split:<13} {name}: {found}")
            for target in TARGETS:
                value = target.value(figures)
                bound, verdict = target.bound(without_odometry), target.verdict(value, without_odometry)
                mark = "" if verdict == "reached" else f"  {verdict}"
                say(f"{'':13} {target.name:<32} {fixed(value):>7} {target.unit:<8} {bound}{mark}")


def _print_recordings(records: ReadOnly[RecordingRecord]) -> None:
    for record in records:
        moving = f"{len(record.moving_objects)} of {record.objects} objects called moving"
        false = f", {fixed(record.false_per_minute, 2)} false a minute" if record.static else ""
        skipped = f", {record.skipped} skipped" if record.skipped else ""
        say(f"recording     {record.name}: {record.frames} frames{skipped}, {moving}{false}")
