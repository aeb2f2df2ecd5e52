"""The report's part about recordings."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from controller.evaluation.recordings import RecordingRecord
from controller.evaluation.report import pictures
from controller.evaluation.report.folder import write_picture
from controller.evaluation.report.markdown import fixed, picture, table
from controller.evaluation.report.summary import number

_WHAT = """Nobody has written down what moves in them. Where nothing but the camera does (--static), every
    object that is called moving in three frames or more is false."""


def recordings_json(records: Sequence[RecordingRecord]) -> list[dict[str, Any]]:
    """Plain JSON values, one entry a recording."""
    return [
        {
            "recording": record.name,
            "odometry": record.odometry,
            "assumed_static": record.static,
            "frames": record.frames,
            "skipped": record.skipped,
            "seconds": number(record.seconds, 3),
            "objects": record.objects,
            "moving_objects": len(record.moving_objects),
            "frames_with_moving": record.frames_with_moving,
            "false_moving_per_minute": number(record.false_per_minute, 3),
            "ms_per_frame": {
                "median": number(_percentile(record, 50), 2),
                "p99": number(_percentile(record, 99), 2),
            },
            "camera": record.conditions,
            "ego_motion": record.ego_sources,
        }
        for record in records
    ]


def write_recording_pictures(folder: Path, records: Sequence[RecordingRecord]) -> None:
    """One picture a recording: scene, depth, result. Raises UserError."""
    for record, file in zip(records, _files(records), strict=True):
        if record.pictures:
            image = pictures.scene_depth_result(record.pictures)
            write_picture(folder / file, image)


def recording_lines(records: Sequence[RecordingRecord], command: str) -> list[str]:
    """The lines of report.md about recordings. command: the one that made this report."""
    rows = [
        (
            record.name,
            record.odometry,
            str(record.frames),
            str(record.skipped),
            fixed(record.seconds, 1),
            str(record.objects),
            str(len(record.moving_objects)),
            str(record.frames_with_moving),
            fixed(record.false_per_minute, 2),
            fixed(_percentile(record, 50), 1),
            fixed(_percentile(record, 99), 1),
        )
        for record in records
    ]
    head = (
        "recording", "odometry", "frames", "skipped", "seconds", "objects", "called moving",
        "frames with a moving one", "false a minute", "ms a frame, median", "p99",
    )  # fmt: skip
    made = f"Made by `{command}`. {' '.join(_WHAT.split())}"
    lines = ["# Recordings", "", made, "", *table(head, rows)]
    for record, file in zip(records, _files(records), strict=True):
        if record.pictures:
            lines += [
                f"{record.name}: the frame with most objects, and frames with something called moving.",
                "",
            ]
            lines += picture(record.name, file)
    return lines


def _files(records: Sequence[RecordingRecord]) -> list[str]:
    """A file name for each record. A name that is taken gets a number: a/b and a-b would be the same."""
    files: list[str] = []
    for record in records:
        stem = f"recording-{record.name.replace('/', '-')}-{record.odometry}"
        names = chain([stem], (f"{stem}-{index}" for index in count(2)))
        files.append(next(f"{name}.png" for name in names if f"{name}.png" not in files))
    return files


def _percentile(record: RecordingRecord, percent: float) -> float:
    return float(np.percentile(record.ms, percent)) if record.ms else float("nan")
