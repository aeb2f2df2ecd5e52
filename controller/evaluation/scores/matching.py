"""Matches detections to true objects: a pair is possible if the boxes overlap or the middles are close."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.evaluation.assignment import Pairs, assign
from controller.evaluation.types import Box, DetectedObject, TrueObject
from hal.types import FloatArray

MIN_IOU = 0.3
MAX_DISTANCE_M = 0.5


def iou(a: Box, b: Box) -> float:
    """Intersection over union of two boxes; 0 if one of them is unknown (NaN) or empty."""
    if not np.isfinite([*a, *b]).all():
        return 0.0
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0.0 or height <= 0.0:
        return 0.0
    intersection = width * height
    return intersection / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - intersection)


def distance_m(detection: DetectedObject, true: TrueObject) -> float:
    """Distance of the middles, over the components that the method measures; inf if it measures none."""
    difference = detection.position_m - true.position_m
    known = np.isfinite(difference)
    return float(np.linalg.norm(difference[known])) if known.any() else np.inf


def costs(detections: Sequence[DetectedObject], objects: Sequence[TrueObject]) -> FloatArray:
    """(N, M) costs, from 0 for a perfect match to 2 for the poorest one; inf for an impossible pair."""
    cost = np.full((len(detections), len(objects)), np.inf)
    for row, detection in enumerate(detections):
        for column, true in enumerate(objects):
            overlap, centre_distance_m = iou(detection.box, true.box), distance_m(detection, true)
            if overlap >= MIN_IOU or centre_distance_m <= MAX_DISTANCE_M:
                cost[row, column] = (1.0 - overlap) + min(centre_distance_m / MAX_DISTANCE_M, 1.0)
    return cost


def match(detections: Sequence[DetectedObject], objects: Sequence[TrueObject]) -> Pairs:
    """Pairs (detection, object) by index, one to one."""
    return assign(costs(detections, objects))
