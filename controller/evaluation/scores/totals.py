"""Combines the scores of many sequences into one set of figures and into precision-recall curves."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.evaluation.scores.scoring import FrameScore, SequenceScore, score
from controller.evaluation.types import FrameDetections, FrameTruth
from hal.types import FloatArray

DISTANCE_BINS_M = (0.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0)


def ratio(part: float, whole: float) -> float:
    """part / whole; NaN if whole is 0."""
    return part / whole if whole else math.nan


@dataclass(frozen=True, slots=True)
class Counts:
    """Counts for precision and recall."""

    correct: int
    wrong: int
    missed: int

    @property
    def precision(self) -> float:
        """correct / (correct + wrong)."""
        return ratio(self.correct, self.correct + self.wrong)

    @property
    def recall(self) -> float:
        """correct / (correct + missed)."""
        return ratio(self.correct, self.correct + self.missed)


@dataclass(frozen=True, slots=True)
class ByDistance:
    """Statistics of a quantity in bins of the distance from the camera; NaN where a bin is empty."""

    edges_m: tuple[float, ...]
    count: tuple[int, ...]
    median: tuple[float, ...]
    mean: tuple[float, ...]
    p90: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Figures:
    """One method on many sequences.

    objects: counts per object.
    settled: counts per frame, without the first 0.5 s of each object.
    frames: counts per frame, with the first 0.5 s.
    minutes: duration of the sequences.
    latencies_s: one an object, inf if it was never detected.
    speed_error: in m/s, by distance.
    found_by_distance: one a bin of DISTANCE_BINS_M; nothing counts as wrong in it.
    ms_per_frame: median.
    """

    objects: Counts
    settled: Counts
    frames: Counts
    minutes: float
    latencies_s: tuple[float, ...]
    speed_error: ByDistance
    speed_error_median_mps: float
    speed_error_p90_mps: float
    found_by_distance: tuple[Counts, ...]
    ms_per_frame: float

    @property
    def wrong_per_minute(self) -> float:
        """Wrong objects per minute."""
        return ratio(self.objects.wrong, self.minutes)

    @property
    def latency_median_s(self) -> float:
        """Median time from eligible to detected; an object that was never detected counts as infinite."""
        return float(np.median(self.latencies_s)) if self.latencies_s else math.nan


def bin_by_distance(
    distance_m: FloatArray, values: FloatArray, edges_m: tuple[float, ...] = DISTANCE_BINS_M
) -> ByDistance:
    """Median, mean and 90th percentile of values (N,) in bins of distance (N,)."""
    bin_index = np.digitize(distance_m, edges_m) - 1
    groups = [values[bin_index == index] for index in range(len(edges_m) - 1)]
    return ByDistance(
        edges_m=edges_m,
        count=tuple(len(group) for group in groups),
        median=tuple(float(np.median(group)) if len(group) else math.nan for group in groups),
        mean=tuple(float(np.mean(group)) if len(group) else math.nan for group in groups),
        p90=tuple(float(np.percentile(group, 90)) if len(group) else math.nan for group in groups),
    )


def total(scores: Sequence[SequenceScore], durations_ms: Sequence[float]) -> Figures:
    """The figures of all scores together. durations_ms: one a frame, NaN if there was nothing to process."""
    objects = [object_score for sequence in scores for object_score in sequence.objects]
    frames = [frame for sequence in scores for frame in sequence.frames]
    hits = [hit for frame in frames for hit in frame.hits]
    distance = np.array([hit.distance_m for hit in hits])
    error = np.array([hit.speed_error_mps for hit in hits])
    known = np.isfinite(error)
    return Figures(
        objects=_object_counts(scores),
        settled=_settled_counts(scores),
        frames=_frame_counts(frames),
        minutes=sum(sequence.duration_s for sequence in scores) / 60.0,
        latencies_s=tuple(object_score.latency_s for object_score in objects),
        speed_error=bin_by_distance(distance[known], error[known]),
        speed_error_median_mps=float(np.median(error[known])) if known.any() else math.nan,
        speed_error_p90_mps=float(np.percentile(error[known], 90)) if known.any() else math.nan,
        found_by_distance=_found_by_distance(scores),
        ms_per_frame=_median_known(durations_ms),
    )


def _median_known(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.median(known)) if known else math.nan


def _object_counts(scores: Sequence[SequenceScore]) -> Counts:
    objects = [object_score for sequence in scores for object_score in sequence.objects]
    found = sum(object_score.found for object_score in objects)
    wrong = sum(len(sequence.wrong_objects) for sequence in scores)
    return Counts(found, wrong, len(objects) - found)


def _settled_counts(scores: Sequence[SequenceScore]) -> Counts:
    frames = [frame for sequence in scores for frame in sequence.frames]
    return Counts(
        sum(hit.settled for frame in frames for hit in frame.hits),
        sum(len(frame.wrong) + len(frame.duplicates) for frame in frames),
        sum(len(frame.missed_settled) for frame in frames),
    )


def _frame_counts(frames: Sequence[FrameScore]) -> Counts:
    return Counts(
        sum(len(frame.hits) for frame in frames),
        sum(len(frame.wrong) + len(frame.duplicates) for frame in frames),
        sum(len(frame.missed) for frame in frames),
    )


def _found_by_distance(scores: Sequence[SequenceScore]) -> tuple[Counts, ...]:
    """Counts of objects by their median distance over the judged frames."""
    objects = [object_score for sequence in scores for object_score in sequence.objects]
    result = []
    for low, high in itertools.pairwise(DISTANCE_BINS_M):
        inside = [object_score for object_score in objects if low <= object_score.distance_m < high]
        found = sum(object_score.found for object_score in inside)
        result.append(Counts(found, 0, len(inside) - found))
    return tuple(result)


@dataclass(frozen=True, slots=True)
class Curve:
    """Precision and recall by threshold, the highest threshold first."""

    thresholds: tuple[float, ...]
    precision: tuple[float, ...]
    recall: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MethodAnswers:
    """One method's answers on one sequence."""

    truths: Sequence[FrameTruth]
    answers: Sequence[FrameDetections]


THRESHOLDS = tuple(float(value) for value in np.round(np.linspace(1.0, 0.0, 41), 3))


def object_curves(method_answers: Sequence[MethodAnswers]) -> tuple[Curve, Curve]:
    """Precision-recall curves per object and per frame, over the threshold of confidence."""
    per_object, per_frame = [], []
    for threshold in THRESHOLDS:
        scores = [score(answers.truths, answers.answers, threshold) for answers in method_answers]
        per_object.append(_object_counts(scores))
        per_frame.append(_settled_counts(scores))
    return _curve(THRESHOLDS, per_object), _curve(THRESHOLDS, per_frame)


@dataclass(frozen=True, slots=True, eq=False)
class PixelCounts:
    """Histograms of the confidence 0..255 that a method gave to the pixels of moving bodies and of the rest.

    moving, rest: (256,). Pixels of excused bodies and those beyond the range are in neither.
    """

    moving: NDArray[np.int64]
    rest: NDArray[np.int64]

    @staticmethod
    def none() -> PixelCounts:
        """Nothing counted yet."""
        return PixelCounts(np.zeros(256, np.int64), np.zeros(256, np.int64))

    def __add__(self, other: PixelCounts) -> PixelCounts:
        return PixelCounts(self.moving + other.moving, self.rest + other.rest)

    def at(self, level: int) -> Counts:
        """Counts if every pixel of this level or above is called moving."""
        return Counts(
            int(self.moving[level:].sum()), int(self.rest[level:].sum()), int(self.moving[:level].sum())
        )


PIXEL_LEVEL = 128  # a pixel of this level or above is called moving: half of the scale, as for objects


def pixel_curve(counts: PixelCounts) -> Curve:
    """The curve over all levels except zero, which marks pixels that no detection claims."""
    levels = range(255, 0, -1)
    return _curve(tuple(level / 255.0 for level in levels), [counts.at(level) for level in levels])


def _curve(thresholds: tuple[float, ...], counts: Sequence[Counts]) -> Curve:
    """The curve at the thresholds where precision and recall are defined."""
    known = [
        (threshold, count.precision, count.recall)
        for threshold, count in zip(thresholds, counts, strict=True)
        if count.correct + count.wrong > 0 and count.correct + count.missed > 0
    ]
    return Curve(
        thresholds=tuple(point[0] for point in known),
        precision=tuple(point[1] for point in known),
        recall=tuple(point[2] for point in known),
    )
