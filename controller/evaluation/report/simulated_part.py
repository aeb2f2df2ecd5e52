"""The text of report.md about the simulated set."""

from __future__ import annotations

import math
from collections.abc import Sequence

from controller.evaluation.methods.timed_methods import LIDAR, OURS, OURS_ALONE
from controller.evaluation.report import pictures
from controller.evaluation.report.figures import TARGET_ENDPOINT_PX
from controller.evaluation.report.markdown import fixed, picture, section, table
from controller.evaluation.report.paper import PAPER_LIDAR, PAPER_OURS
from controller.evaluation.report.summary import MethodSummary, Summary
from controller.evaluation.report.targets import TARGETS, Target
from controller.evaluation.run_sequence import SequenceRecord, Snapshot
from controller.evaluation.scores.totals import Counts

_RULES = """A moving object is found when it is matched (IoU >= 0.3, or middles within 0.5 m, one to one) in
    at least half of its eligible frames (>= 400 visible pixels, within 10 m, >= 30 % visible, faster than
    0.1 m/s) after its first 0.5 s. An identity that is called moving in three frames or more without being a
    moving object is a wrong object. Per frame, a second detection of one object counts as false too. What
    has just stopped (0.5 s ago at most), or is too small or too hidden to be eligible, may be called
    moving and need not be."""
_LIDAR = """The paper's precision of 0.96 is 40 / 42 = 0.952. The lidar baseline sees the same scenes at 15 Hz
    with a planar scanner 0.3 m above the floor (270 deg in steps of 0.33 deg, 3 cm of noise). It tracks
    clusters without a model of the background, and gets the same odometry."""
_TABLE_ONE = """One runnable representative of each category of the paper, with the same scores, on {} of the
    sequences. Object tracking is told the first true box of every object; all others are told nothing."""
_FIG_FOUR = """Over the confidence that a thing moves. At pixel level an obstacle claims the pixels in its box
    whose depth lies within its visible surface; true are the pixels of moving bodies within 10 m."""
_SPEED = "Velocity error: norm of the difference of the velocities over ground, on matched moving objects."
_OBJECT_HEAD = ("objects", "correct", "wrong", "precision", "recall")


def simulated_lines(
    summary: Summary,
    records: Sequence[SequenceRecord],
    failures: Sequence[tuple[Snapshot, str]],
    command: str,
) -> list[str]:
    """The lines of report.md. command: the one that made it. failures: frames with their picture files."""
    reporting = summary.splits["reporting"]
    count = {split: sum(record.split == split for record in records) for split in ("reporting", "tuning")}
    lines = ["# Evaluation on the simulated set", ""]
    lines.append(
        f"Made by `{command}`. {len(records)} sequences with fixed seeds, 640x480 at 30 frames a second: "
        f"{count['tuning']} that the detector may be tuned on, {count['reporting']} to report on. "
        "Every figure is of the reporting split unless it says otherwise. Times are medians on one core of "
        "the machine that made this page."
    )
    lines.extend(("", " ".join(_RULES.split()), ""))
    if OURS in reporting:
        lines.extend(_targets(reporting))
        lines.extend(_table_two(reporting))
    lines.extend(_table_one(summary.splits["baselines"]))
    lines.extend(_figures(summary, any(record.shown for record in records)))
    lines.extend(_by_split(summary))
    lines.extend(_by_sequence(summary))
    lines.extend(_failing(failures))
    return lines


def _targets(reporting: dict[str, MethodSummary]) -> list[str]:
    rows = [
        (
            f"{target.name}{f' ({target.unit})' if target.unit else ''}",
            *_verdict(target, reporting.get(OURS), without_odometry=False),
            *_verdict(target, reporting.get(OURS_ALONE), without_odometry=True),
        )
        for target in TARGETS
    ]
    head = ("figure", "with odometry", "target", "", "without odometry", "target", "")
    return section("Targets") + table(head, rows)


def _verdict(
    target: Target, method_summary: MethodSummary | None, without_odometry: bool
) -> tuple[str, str, str]:
    value = math.nan if method_summary is None else target.value(method_summary.figures)
    verdict = target.verdict(value, without_odometry)
    return fixed(value), target.bound(without_odometry), "**missed**" if verdict == "missed" else verdict


def _table_two(reporting: dict[str, MethodSummary]) -> list[str]:
    reported = (("the paper's lidar [20]", PAPER_LIDAR), ("the paper's method", PAPER_OURS))
    rows = [
        (name, str(paper.objects), str(paper.correct), str(paper.wrong), fixed(paper.precision),
         fixed(paper.recall), f"{paper.seconds_per_frame:.2f}")
        for name, paper in reported
    ]  # fmt: skip
    names = (("our lidar baseline", LIDAR), ("treadwatch", OURS), ("treadwatch, no odometry", OURS_ALONE))
    for label, name in names:
        if name in reporting:
            figures = reporting[name].figures
            rows.append((label, *_objects(figures.objects), fixed(figures.ms_per_frame / 1000.0, 4)))
    return section("Table 2, side by side", _LIDAR) + table(("", *_OBJECT_HEAD, "s a frame"), rows)


def _table_one(methods: dict[str, MethodSummary]) -> list[str]:
    if not methods:
        return []
    rows = [
        (
            name,
            *_objects(method_summary.figures.objects),
            *_shares(method_summary.figures.settled),
            *_shares(method_summary.pixel_counts),
            fixed(method_summary.figures.wrong_per_minute, 1),
            fixed(method_summary.figures.ms_per_frame, 1),
        )
        for name, method_summary in methods.items()
    ]
    sequences = max(method_summary.sequences for method_summary in methods.values())
    head = ("method", *_OBJECT_HEAD, "per frame P", "R", "pixel P", "R", "false a minute", "ms a frame")
    return (
        section("Table 1, measured", _TABLE_ONE.format(sequences))
        + table(head, rows)
        + picture("Table 1, measured", "table1-measured.png")
    )


def _figures(summary: Summary, shown: bool) -> list[str]:
    lines = []
    if summary.has_moving_objects:
        lines += section("Fig. 4: precision and recall", _FIG_FOUR)
        lines += picture("Precision and recall", "fig4-precision-recall.png")
    if any(summary.endpoint.count):
        median, mean = (fixed(value) for value in summary.endpoint_beyond)
        lines += section(
            "Fig. 5: endpoint error against distance",
            f"Static scenes, moving camera. Beyond 2 m: median {median} px, mean {mean} px "
            f"(target: median <= {TARGET_ENDPOINT_PX} px).",
        )
        lines += picture("Endpoint error", "fig5-endpoint-error.png")
    if shown:
        lines += section("Fig. 6: scene, depth as a picture, result")
        lines += picture("Scene, depth, result", "fig6-scene-depth-result.png")
    if summary.has_moving_objects:
        lines += section("Velocity error, latency, distance", _SPEED)
        lines += picture("Velocity error", "speed-error.png") + picture("Latency", "latency.png")
        lines += picture("Found by distance", "found-by-distance.png")
    return lines


def _by_split(summary: Summary) -> list[str]:
    rows = []
    for split in ("reporting", "tuning"):
        for name, method_summary in summary.splits[split].items():
            f = method_summary.figures
            error = f"{fixed(f.speed_error_median_mps)} / {fixed(f.speed_error_p90_mps)}"
            rows.append(
                (split, name, *_objects(f.objects), *_shares(f.settled), fixed(f.frames.recall),
                 fixed(f.wrong_per_minute, 2), error, fixed(f.latency_median_s, 2))
            )  # fmt: skip
    head = (
        "split", "method", *_OBJECT_HEAD, "per frame P", "R", "R with the first 0.5 s", "false a minute",
        "velocity error median / p90 m/s", "first detection s",
    )  # fmt: skip
    return section("By split") + table(head, rows)


def _by_sequence(summary: Summary) -> list[str]:
    rows = []
    for name, methods in summary.scores.items():
        for method in (OURS, OURS_ALONE):
            if method not in methods:
                continue
            sequence_score = methods[method]
            rows.append(
                (
                    name,
                    summary.split_of[name],
                    method,
                    f"{sum(true.found for true in sequence_score.objects)} of {len(sequence_score.objects)}",
                    str(len(sequence_score.wrong_objects)),
                    str(sum(len(frame.wrong) for frame in sequence_score.frames)),
                    str(sum(len(frame.duplicates) for frame in sequence_score.frames)),
                    str(sum(len(frame.missed_settled) for frame in sequence_score.frames)),
                )
            )
    head = (
        "sequence",
        "split",
        "method",
        "found",
        "wrong",
        "false in frames",
        "second boxes",
        "missed in frames",
    )
    return section("By sequence") + table(head, rows)


def _failing(failures: Sequence[tuple[Snapshot, str]]) -> list[str]:
    if not failures:
        return section("Failing frames", "None.")
    lines = section("Failing frames", "The worst frames of the sequences (treadwatch, with odometry).")
    for snapshot, file in failures:
        words = f"{snapshot.sequence}, frame {snapshot.index}: {pictures.describe_errors(snapshot)}"
        lines += [words, "", *picture(snapshot.sequence, file)]
    return lines


def _objects(counts: Counts) -> tuple[str, str, str, str, str]:
    total = counts.correct + counts.missed
    return str(total), str(counts.correct), str(counts.wrong), *_shares(counts)


def _shares(counts: Counts) -> tuple[str, str]:
    return fixed(counts.precision), fixed(counts.recall)
