"""Writes the report folder: report.md, summary.json and the pictures."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2

from controller.errors import UserError
from controller.evaluation.methods.timed_methods import OURS
from controller.evaluation.report import figures, pictures
from controller.evaluation.report.summary import Summary
from controller.evaluation.run_sequence import SequenceRecord, Snapshot
from controller.evaluation.simulated_set.sequences import sequences
from controller.video.style import Image

MAX_FAILURES = 24
_FIGURES = (
    "fig4-precision-recall.png",
    "fig5-endpoint-error.png",
    "fig6-scene-depth-result.png",
    "speed-error.png",
    "latency.png",
    "found-by-distance.png",
    "table1-measured.png",
)
# As recordings_part.py names them.
_RECORDING = re.compile(r"recording-.+-(file|none|groundtruth)(-\d+)?\.png")


def prepare_folder(folder: Path) -> None:
    """Make the folder before the run, so that a long run does not fail at its end.

    Deletes what an earlier run left there, and nothing else. Raises UserError.
    """
    simulated_names = {sequence.name for sequence in sequences()}
    try:
        (folder / "failures").mkdir(parents=True, exist_ok=True)
        for name in (*_FIGURES, "summary.json"):
            (folder / name).unlink(missing_ok=True)
        for old in folder.glob("recording-*.png"):
            if _RECORDING.fullmatch(old.name):
                old.unlink()
        for old in (folder / "failures").glob("*-[0-9][0-9][0-9].png"):
            if old.stem[:-4] in simulated_names:
                old.unlink()
        (folder / "report.md").write_text("The evaluation is still running, or was broken off.\n", "utf-8")
    except OSError as error:
        raise UserError(
            f"{folder}: the report cannot be written there ({error.strerror}); choose another folder"
        ) from error


def write_figures(folder: Path, summary: Summary, records: Sequence[SequenceRecord]) -> None:
    """Write the diagrams, and Fig. 6. Raises UserError."""
    reporting = summary.splits["reporting"]
    if summary.has_moving_objects:
        write_picture(folder / "fig4-precision-recall.png", figures.precision_recall(summary))
        write_picture(folder / "speed-error.png", figures.speed_error(reporting))
        write_picture(folder / "latency.png", figures.latency(reporting))
        write_picture(folder / "found-by-distance.png", figures.found_by_distance(reporting[OURS]))
    if any(summary.endpoint.count):
        write_picture(folder / "fig5-endpoint-error.png", figures.endpoint_error(summary.endpoint))
    shown = [snapshot for record in records for snapshot in record.shown]
    if shown:
        write_picture(folder / "fig6-scene-depth-result.png", pictures.scene_depth_result(shown))
    if summary.splits["baselines"]:
        write_picture(folder / "table1-measured.png", figures.table_one(summary.splits["baselines"]))


def write_failures(folder: Path, records: Sequence[SequenceRecord]) -> list[tuple[Snapshot, str]]:
    """Write pictures of the worst frames; gives the frames with the picture's path in the folder.

    Raises UserError.
    """
    failing = [snapshot for record in records for snapshot in record.failures]
    failing.sort(key=lambda snapshot: (-snapshot.score.error_count, snapshot.sequence, snapshot.index))
    worst = sorted(failing[:MAX_FAILURES], key=lambda snapshot: (snapshot.sequence, snapshot.index))
    named = [(snapshot, f"failures/{snapshot.sequence}-{snapshot.index:03d}.png") for snapshot in worst]
    for snapshot, file in named:
        write_picture(folder / file, pictures.failure_picture(snapshot))
    return named


def write_texts(folder: Path, result: dict[str, Any], lines: Sequence[str]) -> None:
    """Write summary.json and report.md. Raises UserError."""
    text = json.dumps(result, indent=1, allow_nan=False)
    try:
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
        (folder / "report.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror}); is the disk full?") from error


def write_picture(path: Path, image: Image) -> None:
    """Write an image as PNG. Raises UserError."""
    if not cv2.imwrite(str(path), image):
        raise UserError(f"{path}: cannot be written; is the disk full?")
