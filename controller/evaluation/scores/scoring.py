"""Scores one method on one sequence: which moving objects it found, and what it wrongly called moving.

An object is found if it is matched in at least half of its eligible frames after its first 0.5 s. A track id
that is called moving in three frames or more without matching a moving object is a wrong object. A second
detection of an object that is already matched is false in that frame and lowers the precision per frame. It
is no wrong object, because something does move there.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.evaluation.scores.matching import costs, match
from controller.evaluation.simulated_set.eligibility import Eligibility, Verdict, judge_eligibility
from controller.evaluation.types import CALLED_MOVING, DetectedObject, FrameDetections, FrameTruth, TrueObject

MIN_SHARE = 0.5  # of the judged frames in which a found object is matched
WRONG_FRAMES = 3  # frames from which a wrong track id is a wrong object


@dataclass(frozen=True, slots=True)
class Hit:
    """A detection matched to an eligible object.

    object_id, distance_m: of the true object.
    speed_error_mps: norm of the difference of the velocities, over the components that the method measures;
    NaN if it measures none.
    settled: the object has been eligible for at least 0.5 s.
    """

    object_id: int
    distance_m: float
    speed_error_mps: float
    settled: bool


@dataclass(frozen=True, slots=True)
class FrameScore:
    """The score of one frame.

    hits: matched detections.
    missed: ids of eligible objects without a detection.
    missed_settled: those of them that are settled.
    wrong: ids of detections that match no moving object.
    duplicates: ids of further detections of an eligible object.
    """

    hits: tuple[Hit, ...]
    missed: tuple[int, ...]
    missed_settled: tuple[int, ...]
    wrong: tuple[int, ...]
    duplicates: tuple[int, ...]

    @property
    def error_count(self) -> int:
        """The number of errors in this frame."""
        return len(self.missed_settled) + len(self.wrong) + len(self.duplicates)


@dataclass(frozen=True, slots=True)
class ObjectScore:
    """The score of one true object.

    judged: number of eligible frames after the first 0.5 s.
    detected: number of judged frames in which it was matched.
    latency_s: from becoming eligible to the first match, inf if there was none.
    distance_m: median over the judged frames.
    """

    id: int
    kind: str
    judged: int
    detected: int
    latency_s: float
    distance_m: float

    @property
    def found(self) -> bool:
        """Matched in at least half of the judged frames."""
        return self.detected >= MIN_SHARE * self.judged


@dataclass(frozen=True, slots=True)
class SequenceScore:
    """The score of one sequence. objects: those with a judged frame. wrong_objects: track ids, sorted."""

    frames: tuple[FrameScore, ...]
    objects: tuple[ObjectScore, ...]
    wrong_objects: tuple[int, ...]
    duration_s: float


def score(
    truths: Sequence[FrameTruth], answers: Sequence[FrameDetections], threshold: float = CALLED_MOVING
) -> SequenceScore:
    """Score the answers. threshold: detections of less confidence do not count.

    truths and answers must be the same frames in the same order; raises ValueError if they are not.
    """
    if len(truths) != len(answers) or any(
        truth.stamp_s != answer.stamp_s for truth, answer in zip(truths, answers, strict=False)
    ):
        raise ValueError("truths and answers must be the same frames in the same order")
    verdicts = judge_eligibility(truths)
    frames = tuple(
        _score_frame(truth, verdict, [d for d in answer.detections if d.confidence >= threshold])
        for truth, verdict, answer in zip(truths, verdicts, answers, strict=True)
    )
    count = Counter(identity for frame in frames for identity in frame.wrong)
    wrong = tuple(sorted(identity for identity, times in count.items() if times >= WRONG_FRAMES))
    return SequenceScore(frames, _score_objects(truths, verdicts, frames), wrong, _duration_s(truths))


def _score_frame(
    truth: FrameTruth, verdicts: dict[int, Verdict], detections: list[DetectedObject]
) -> FrameScore:
    eligible = [true for true in truth.objects if verdicts[true.id].eligibility is Eligibility.ELIGIBLE]
    excused = [true for true in truth.objects if verdicts[true.id].eligibility is Eligibility.EXCUSED]
    pairs = match(detections, eligible)
    hits = tuple(_hit(detections[row], eligible[column], verdicts) for row, column in pairs)
    matched_rows = {row for row, _ in pairs}
    matched_ids = {hit.object_id for hit in hits}
    unmatched = [detection for row, detection in enumerate(detections) if row not in matched_rows]
    missed = tuple(true.id for true in eligible if true.id not in matched_ids)
    wrong: list[int] = []
    duplicates: list[int] = []
    for detection, is_moving, may_move in zip(
        unmatched, _lie_on(unmatched, eligible), _lie_on(unmatched, excused), strict=True
    ):
        if not may_move:
            (duplicates if is_moving else wrong).append(detection.id)
    return FrameScore(
        hits=hits,
        missed=missed,
        missed_settled=tuple(identity for identity in missed if verdicts[identity].settled),
        wrong=tuple(wrong),
        duplicates=tuple(duplicates),
    )


def _lie_on(detections: list[DetectedObject], objects: list[TrueObject]) -> list[bool]:
    """Which detections could be matched to any of the objects."""
    return [bool(row.any()) for row in np.isfinite(costs(detections, objects))]


def _hit(detection: DetectedObject, true: TrueObject, verdicts: dict[int, Verdict]) -> Hit:
    difference = detection.velocity_mps - true.velocity_mps
    known = np.isfinite(difference)
    error = float(np.linalg.norm(difference[known])) if known.any() else math.nan
    return Hit(true.id, true.distance_m, error, verdicts[true.id].settled)


def _score_objects(
    truths: Sequence[FrameTruth], verdicts: Sequence[dict[int, Verdict]], frames: Sequence[FrameScore]
) -> tuple[ObjectScore, ...]:
    first_s: dict[int, float] = {}
    hit_s: dict[int, float] = {}
    judged: Counter[int] = Counter()
    detected: Counter[int] = Counter()
    kinds: dict[int, str] = {}
    distances_m: dict[int, list[float]] = {}
    for truth, verdict, frame in zip(truths, verdicts, frames, strict=True):
        hits = {hit.object_id for hit in frame.hits}
        for true in truth.objects:
            if verdict[true.id].eligibility is not Eligibility.ELIGIBLE:
                continue
            kinds[true.id] = true.kind
            first_s.setdefault(true.id, truth.stamp_s)
            if true.id in hits:
                hit_s.setdefault(true.id, truth.stamp_s)
            if verdict[true.id].settled:
                judged[true.id] += 1
                detected[true.id] += true.id in hits
                distances_m.setdefault(true.id, []).append(true.distance_m)
    return tuple(
        ObjectScore(
            identity,
            kinds[identity],
            judged[identity],
            detected[identity],
            hit_s.get(identity, math.inf) - first_s[identity],
            float(np.median(distances_m[identity])),
        )
        for identity in sorted(judged)
    )


def _duration_s(truths: Sequence[FrameTruth]) -> float:
    """From the start of the first frame to the end of the last one."""
    if len(truths) < 2:
        return 0.0
    span_s = truths[-1].stamp_s - truths[0].stamp_s
    return span_s * len(truths) / (len(truths) - 1)
