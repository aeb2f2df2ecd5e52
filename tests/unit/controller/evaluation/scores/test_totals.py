"""Sums, bins and curves against values counted by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.evaluation.scores.pixels import claimed_levels, count_pixels
from controller.evaluation.scores.scoring import score
from controller.evaluation.scores.totals import (
    Counts,
    MethodAnswers,
    PixelCounts,
    bin_by_distance,
    object_curves,
    pixel_curve,
    total,
)
from tests.support.evaluation_cases import (
    answers,
    detection,
    far_detection,
    moving_square,
    true_object,
    truths,
)


def test_precision_and_recall_of_counts() -> None:
    counts = Counts(correct=40, wrong=2, missed=10)
    assert counts.precision == pytest.approx(40 / 42)
    assert counts.recall == pytest.approx(0.8)
    assert math.isnan(Counts(0, 0, 0).precision)


def test_total_of_two_sequences() -> None:
    good = score(truths([[true_object()]] * 30), answers([[detection()]] * 30))
    bad = score(truths([[true_object()]] * 30), answers([[far_detection()]] * 30))
    figures = total([good, bad], [4.0, 6.0, math.nan])
    assert figures.objects == Counts(1, 1, 1)
    assert figures.frames == Counts(30, 30, 30)
    assert figures.settled == Counts(15, 30, 15)
    assert figures.minutes == pytest.approx(2.0 / 60.0)
    assert figures.wrong_per_minute == pytest.approx(30.0)
    assert figures.latency_median_s == math.inf
    assert figures.speed_error_median_mps == 0.0
    assert figures.ms_per_frame == 5.0


def test_totals_of_nothing_are_unknown() -> None:
    figures = total([], [])
    assert math.isnan(figures.wrong_per_minute)
    assert math.isnan(figures.latency_median_s)
    assert math.isnan(figures.ms_per_frame)


def test_bins_by_distance() -> None:
    binned = bin_by_distance(np.array([1.0, 1.5, 2.5, 9.0]), np.array([1.0, 3.0, 5.0, 7.0]), (0.0, 2.0, 4.0))
    assert binned.count == (2, 1)
    assert binned.median == (2.0, 5.0)
    assert binned.p90[0] == pytest.approx(2.8)


def test_object_curve_trades_precision_for_recall() -> None:
    frames = [[detection(confidence=0.9), far_detection(confidence=0.7)]] * 30
    unsure = [[detection(confidence=0.6)]] * 30
    recorded = [
        MethodAnswers(truths([[true_object()]] * 30), answers(frames)),
        MethodAnswers(truths([[true_object()]] * 30), answers(unsure)),
    ]
    per_object, per_frame = object_curves(recorded)
    points = dict(
        zip(per_object.thresholds, zip(per_object.recall, per_object.precision, strict=True), strict=True)
    )
    assert points[0.8] == (0.5, 1.0)
    assert points[0.65] == (0.5, 0.5)
    assert points[0.5] == pytest.approx((1.0, 2 / 3))
    assert max(per_object.thresholds) == 0.9
    assert per_frame.recall[-1] == 1.0


def test_the_pixel_curve_goes_from_the_surest_pixels_to_all_that_are_claimed() -> None:
    moving, rest = np.zeros(256, np.int64), np.zeros(256, np.int64)
    moving[[0, 200]], rest[[0, 100]] = (25, 75), (900, 25)
    counts = PixelCounts(moving, rest)
    assert counts.at(128) == Counts(75, 0, 25)
    assert counts.at(1) == Counts(75, 25, 25)
    curve = pixel_curve(counts + PixelCounts.none())
    assert curve.precision[0] == 1.0
    assert (curve.recall[-1], curve.precision[-1]) == (0.75, 0.75)


def test_an_obstacle_claims_the_pixels_of_its_depth_in_its_box() -> None:
    frame = moving_square(0)
    around = detection(box=(130.0, 120.0, 310.0, 380.0), position_m=(-0.5, 0.0, 3.0), confidence=1.0)
    levels = claimed_levels(frame, [around])
    assert (
        np.count_nonzero(levels) == 60 * 100
    )  # the thing is 120 x 200 px; the wall behind it is not claimed
    assert levels[100, 90] == 255
    assert levels.shape == (240, 320)


def test_pixels_without_truth_count_neither_way() -> None:
    levels = np.full((2, 3), 255, np.uint8)
    instances = np.array([[1, 2, 3], [0, 0, 1]], np.uint16)
    depth_m = np.array([[4.0, 4.0, 4.0], [4.0, 0.0, 11.0]], np.float32)
    counts = count_pixels(levels, instances, depth_m, moving=[1], excused=[2])
    assert counts.moving.sum() == 1  # the body beyond 10 m is not judged
    assert counts.rest.sum() == 2
