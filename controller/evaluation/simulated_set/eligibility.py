"""Which true objects a detector must find, may find, or must not call moving, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from controller.evaluation.types import FrameTruth, TrueObject

MIN_VISIBLE_PX = 400
MAX_DISTANCE_M = 10.0
MIN_VISIBLE_RATIO = 0.3
MOVING_MPS = 0.1  # slower objects need not be found
OBJECT_REST_MPS = 0.02  # slower objects stand: calling them moving is wrong ...
STANDING_S = 0.5  # ... once they have stood for this long
SETTLING_S = 0.5  # an object need not be found in its first eligible frames, for this long


class Eligibility(Enum):
    """ELIGIBLE: must be found. EXCUSED: may be found. STILL: calling it moving is wrong."""

    ELIGIBLE = "eligible"
    EXCUSED = "excused"
    STILL = "still"


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on one object in one frame. settled: it became eligible at least SETTLING_S ago."""

    eligibility: Eligibility
    settled: bool


def judge_eligibility(frames: Sequence[FrameTruth]) -> list[dict[int, Verdict]]:
    """For each frame, the verdict on each object, by the object's id."""
    first_eligible_s: dict[int, float] = {}
    last_moved_s: dict[int, float] = {}
    result = []
    for frame in frames:
        verdicts_by_id = {}
        for true in frame.objects:
            if true.speed_mps >= OBJECT_REST_MPS or true.turning:
                last_moved_s[true.id] = frame.stamp_s
            eligibility = _eligibility(true, frame.stamp_s, last_moved_s.get(true.id))
            if eligibility is Eligibility.ELIGIBLE:
                first_eligible_s.setdefault(true.id, frame.stamp_s)
            since_s = first_eligible_s.get(true.id)
            # Stamps are multiples of the frame period; half a millisecond allows for rounding.
            settled = since_s is not None and frame.stamp_s - since_s >= SETTLING_S - 5e-4
            verdicts_by_id[true.id] = Verdict(eligibility, settled)
        result.append(verdicts_by_id)
    return result


def _eligibility(true: TrueObject, now_s: float, last_moved_s: float | None) -> Eligibility:
    if last_moved_s is None or now_s - last_moved_s > STANDING_S:
        return Eligibility.STILL
    seen = true.visible_px >= MIN_VISIBLE_PX and true.visible_ratio >= MIN_VISIBLE_RATIO
    if seen and true.speed_mps >= MOVING_MPS and true.distance_m <= MAX_DISTANCE_M:
        return Eligibility.ELIGIBLE
    return Eligibility.EXCUSED
