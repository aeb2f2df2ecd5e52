"""Summary of all results of the simulated set, also as plain JSON values under stable keys."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.evaluation.methods.timed_methods import ALWAYS, BASELINES, OURS
from controller.evaluation.run_sequence import SequenceRecord
from controller.evaluation.scores import endpoint_error
from controller.evaluation.scores.endpoint_error import EndpointErrors
from controller.evaluation.scores.scoring import SequenceScore, score
from controller.evaluation.scores.totals import (
    DISTANCE_BINS_M,
    PIXEL_LEVEL,
    ByDistance,
    Counts,
    Curve,
    Figures,
    MethodAnswers,
    PixelCounts,
    bin_by_distance,
    object_curves,
    pixel_curve,
    total,
)

VERSION = 1  # of the JSON layout
BEYOND_M = 2.0  # the target for endpoint errors counts from this distance on


@dataclass(frozen=True, slots=True, eq=False)
class MethodSummary:
    """One method on the sequences of one split that it ran on. sequences: their number."""

    figures: Figures
    pixels: PixelCounts
    sequences: int

    @property
    def pixel_counts(self) -> Counts:
        """Counts at the level from which a pixel is called moving; zeros if the method claims no pixels."""
        claimed = self.pixels.moving[1:].sum() + self.pixels.rest[1:].sum()
        return self.pixels.at(PIXEL_LEVEL) if claimed else Counts(0, 0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """All results of the simulated set.

    splits: "reporting", "tuning" and "baselines" (the sequences that every method ran on), each with its
    methods by name.
    per_object, per_frame, per_pixel: curves of our detector on the reporting split.
    endpoint: endpoint errors by distance.
    endpoint_beyond: their median and mean from BEYOND_M on, in pixels.
    scores: by sequence and method.
    split_of: split by sequence.
    """

    splits: dict[str, dict[str, MethodSummary]]
    per_object: Curve
    per_frame: Curve
    per_pixel: Curve
    endpoint: ByDistance
    endpoint_beyond: tuple[float, float]
    scores: dict[str, dict[str, SequenceScore]]
    split_of: dict[str, str]

    @property
    def has_moving_objects(self) -> bool:
        """Whether the reporting split has any, for our detector: without them its diagrams are empty."""
        ours = self.splits["reporting"].get(OURS)
        return ours is not None and ours.figures.objects.correct + ours.figures.objects.missed > 0


def summarise(records: Sequence[SequenceRecord]) -> Summary:
    """Score all records."""
    scores = {
        record.name: {name: score(record.truths, one.answers) for name, one in record.methods.items()}
        for record in records
    }
    reporting = [record for record in records if record.split == "reporting"]
    splits = {
        "reporting": _by_method(reporting, scores, ALWAYS),
        "tuning": _by_method([record for record in records if record.split == "tuning"], scores, ALWAYS),
        "baselines": _by_method(
            [record for record in records if BASELINES[0] in record.methods], scores, ALWAYS + BASELINES
        ),
    }
    scored_records = [record for record in reporting if OURS in record.methods]
    per_object, per_frame = object_curves(
        [MethodAnswers(record.truths, record.methods[OURS].answers) for record in scored_records]
    )
    pixels = sum((record.methods[OURS].pixels for record in scored_records), PixelCounts.none())
    endpoint = sum((record.endpoint for record in records), EndpointErrors.none())
    beyond = endpoint.error_px[endpoint.distance_m >= BEYOND_M]
    return Summary(
        splits=splits,
        per_object=per_object,
        per_frame=per_frame,
        per_pixel=pixel_curve(pixels),
        endpoint=bin_by_distance(endpoint.distance_m, endpoint.error_px, endpoint_error.DISTANCE_BINS_M),
        endpoint_beyond=(
            (float(np.median(beyond)), float(np.mean(beyond))) if len(beyond) else (math.nan, math.nan)
        ),
        scores=scores,
        split_of={record.name: record.split for record in records},
    )


def _by_method(
    records: Sequence[SequenceRecord], scores: dict[str, dict[str, SequenceScore]], names: tuple[str, ...]
) -> dict[str, MethodSummary]:
    result = {}
    for name in names:
        used_records = [record for record in records if name in record.methods]
        if not used_records:
            continue
        durations = [answer.duration_ms for record in used_records for answer in record.methods[name].answers]
        figures = total([scores[record.name][name] for record in used_records], durations)
        pixels = sum((record.methods[name].pixels for record in used_records), PixelCounts.none())
        result[name] = MethodSummary(figures, pixels, len(used_records))
    return result


def as_json(summary: Summary) -> dict[str, Any]:
    """The summary as JSON values; unknown numbers are null."""
    return {
        "version": VERSION,
        "splits": {
            split: {name: _method(one) for name, one in methods.items()}
            for split, methods in summary.splits.items()
        },
        "curves": {
            "object": _curve(summary.per_object),
            "frame": _curve(summary.per_frame),
            "pixel": _curve(summary.per_pixel),
        },
        "endpoint_error_px": {
            **_by_distance(summary.endpoint),
            f"beyond_{BEYOND_M:g}_m_median": number(summary.endpoint_beyond[0]),
            f"beyond_{BEYOND_M:g}_m_mean": number(summary.endpoint_beyond[1]),
        },
        "sequences": {
            name: {
                "split": summary.split_of[name],
                "methods": {method: _sequence(one) for method, one in methods.items()},
            }
            for name, methods in summary.scores.items()
        },
    }


def number(value: float, digits: int = 4) -> float | None:
    """The value, rounded; None if it is not finite."""
    return round(float(value), digits) if math.isfinite(value) else None


def _method(summary: MethodSummary) -> dict[str, Any]:
    figures = summary.figures
    return {
        "sequences": summary.sequences,
        "minutes": number(figures.minutes),
        "object": _counts(figures.objects),
        "frame": _counts(figures.settled),
        "frame_with_first_half_second": _counts(figures.frames),
        "pixel": _counts(summary.pixel_counts),
        "false_moving_per_minute": number(figures.wrong_per_minute, 3),
        "speed_error_mps": {
            "median": number(figures.speed_error_median_mps),
            "p90": number(figures.speed_error_p90_mps),
            **_by_distance(figures.speed_error),
        },
        "objects_by_distance": {
            "edges_m": list(DISTANCE_BINS_M),
            "correct": [count.correct for count in figures.found_by_distance],
            "missed": [count.missed for count in figures.found_by_distance],
        },
        "first_detection_s": {
            "median": number(figures.latency_median_s),
            "never": sum(not math.isfinite(latency) for latency in figures.latencies_s),
        },
        "ms_per_frame": number(figures.ms_per_frame, 2),
    }


def _counts(counts: Counts) -> dict[str, Any]:
    return {
        "correct": counts.correct,
        "wrong": counts.wrong,
        "missed": counts.missed,
        "precision": number(counts.precision),
        "recall": number(counts.recall),
    }


def _by_distance(by_distance: ByDistance) -> dict[str, Any]:
    return {
        "edges_m": list(by_distance.edges_m),
        "count": list(by_distance.count),
        "median_by_distance": [number(value) for value in by_distance.median],
        "mean_by_distance": [number(value) for value in by_distance.mean],
        "p90_by_distance": [number(value) for value in by_distance.p90],
    }


def _curve(curve: Curve) -> dict[str, Any]:
    return {
        "threshold": [number(value, 3) for value in curve.thresholds],
        "precision": [number(value) for value in curve.precision],
        "recall": [number(value) for value in curve.recall],
    }


def _sequence(score: SequenceScore) -> dict[str, Any]:
    return {
        "objects": [
            {
                "id": true.id,
                "kind": true.kind,
                "judged_frames": true.judged,
                "detected_frames": true.detected,
                "found": true.found,
                "first_detection_s": number(true.latency_s),
                "distance_m": number(true.distance_m, 2),
            }
            for true in score.objects
        ],
        "wrong_objects": list(score.wrong_objects),
        "false_detections": sum(len(frame.wrong) for frame in score.frames),
        "duplicate_detections": sum(len(frame.duplicates) for frame in score.frames),
        "missed_frames": sum(len(frame.missed_settled) for frame in score.frames),
    }
