"""The rules by which an object is found, missed or wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from controller.evaluation.scores.matching import costs, distance_m, iou, match
from controller.evaluation.scores.scoring import score
from controller.evaluation.simulated_set.eligibility import Eligibility, judge_eligibility
from controller.evaluation.types import NO_BOX
from tests.support.evaluation_cases import (
    ELSEWHERE,
    FPS,
    answers,
    bare_detection,
    detection,
    far_detection,
    true_object,
    truths,
)


def test_overlap_of_boxes() -> None:
    assert iou((0, 0, 10, 10), (5, 0, 15, 10)) == pytest.approx(1 / 3)
    assert iou((0, 0, 10, 10), (10, 0, 20, 10)) == 0.0
    assert iou((0, 0, 10, 10), NO_BOX) == 0.0


def test_distance_counts_only_what_is_measured() -> None:
    assert distance_m(bare_detection((0.3, math.nan, 4.4)), true_object()) == pytest.approx(0.5)
    assert distance_m(bare_detection((math.nan,) * 3), true_object()) == math.inf


def test_boxes_or_middles_make_a_match() -> None:
    by_box = detection(1, (120.0, 100.0, 210.0, 300.0), (9.0, 0.0, 9.0))
    by_middle = detection(2, ELSEWHERE, (0.4, 0.0, 4.0))
    neither = far_detection()
    possible = np.isfinite(costs([by_box, by_middle, neither], [true_object()]))
    assert possible.ravel().tolist() == [True, True, False]


def test_each_detection_goes_to_one_object() -> None:
    left, right = true_object(1), true_object(2, position_m=(0.6, 0.0, 4.0), box=(180, 100, 280, 300))
    near_right = detection(5, NO_BOX, (0.45, 0.0, 4.0))
    near_left = detection(6, NO_BOX, (0.1, 0.0, 4.0))
    assert match([near_right, near_left], [left, right]) == ((0, 1), (1, 0))


@pytest.mark.parametrize(
    ("change", "standing"),
    [
        ({}, Eligibility.ELIGIBLE),
        ({"visible_px": 400, "visible_ratio": 0.3}, Eligibility.ELIGIBLE),
        ({"visible_px": 399}, Eligibility.EXCUSED),
        ({"visible_ratio": 0.29}, Eligibility.EXCUSED),
        ({"position_m": (0.0, 0.0, 10.1)}, Eligibility.EXCUSED),
        ({"speed_mps": 0.09}, Eligibility.EXCUSED),
        ({"speed_mps": 0.0, "turning": True}, Eligibility.EXCUSED),
        ({"speed_mps": 0.0}, Eligibility.STILL),
    ],
)
def test_eligibility_of_an_object(change: dict[str, Any], standing: Eligibility) -> None:
    assert judge_eligibility(truths([[true_object(**change)]]))[0][1].eligibility is standing


def test_object_that_has_just_stopped_is_excused_for_half_a_second() -> None:
    frames = [[true_object()]] + [[true_object(speed_mps=0.0)]] * 20
    standings = [call[1].eligibility for call in judge_eligibility(truths(frames))]
    assert standings[1:16] == [Eligibility.EXCUSED] * 15
    assert standings[16:] == [Eligibility.STILL] * 5


def test_the_first_half_second_is_not_judged() -> None:
    frames = truths([[true_object()]] * 45)
    assert [call[1].settled for call in judge_eligibility(frames)] == [False] * 15 + [True] * 30


def run(found: list[bool]) -> Any:
    seen = [[detection()] if here else [] for here in found]
    return score(truths([[true_object()]] * len(found)), answers(seen))


def test_half_of_the_judged_frames_are_enough() -> None:
    found = run([False] * 15 + [True] * 15 + [False] * 15)
    assert found.objects[0].found
    assert (found.objects[0].judged, found.objects[0].detected) == (30, 15)
    assert not run([True] * 15 + [True] * 14 + [False] * 16).objects[0].found


def test_time_to_the_first_detection() -> None:
    assert run([False] * 6 + [True] * 39).objects[0].latency_s == pytest.approx(0.2)
    assert run([False] * 45).objects[0].latency_s == math.inf


def test_an_object_without_judged_frames_does_not_count() -> None:
    assert run([False] * 15).objects == ()
    assert len(run([False] * 16).objects) == 1


@pytest.mark.parametrize(("times", "wrong"), [(2, ()), (3, (9,))])
def test_three_frames_make_a_wrong_object(times: int, wrong: tuple[int, ...]) -> None:
    frames = [[far_detection()] if index < times else [] for index in range(30)]
    scored = score(truths([[true_object()]] * 30), answers(frames))
    assert scored.wrong_objects == wrong
    assert sum(len(frame.wrong) for frame in scored.frames) == times


def test_detection_below_the_threshold_is_never_wrong() -> None:
    frames = [[far_detection(confidence=0.49)]] * 10
    assert score(truths([[]] * 10), answers(frames)).wrong_objects == ()
    assert score(truths([[]] * 10), answers(frames), threshold=0.4).wrong_objects == (9,)


def test_a_second_detection_is_false_in_the_frame_but_no_wrong_object() -> None:
    scored = score(truths([[true_object()]] * 5), answers([[detection(1), detection(2)]] * 5))
    assert all(len(frame.hits) == 1 and len(frame.duplicates) == 1 for frame in scored.frames)
    assert scored.wrong_objects == ()


def test_calling_an_excused_object_moving_is_neither_right_nor_wrong() -> None:
    scored = score(truths([[true_object(visible_px=100)]] * 5), answers([[detection()]] * 5))
    assert all(frame.error_count == 0 and frame.hits == () for frame in scored.frames)


def test_calling_a_standing_object_moving_is_wrong() -> None:
    scored = score(truths([[true_object(speed_mps=0.0)]] * 5), answers([[detection()]] * 5))
    assert scored.wrong_objects == (7,)


def test_speed_error_is_the_norm_of_what_is_measured() -> None:
    off = detection(velocity_mps=(1.3, 0.0, 0.4))
    unmeasured = detection(velocity_mps=(1.3, math.nan, math.nan))
    hits = [score(truths([[true_object()]]), answers([[one]])).frames[0].hits[0] for one in (off, unmeasured)]
    assert hits[0].speed_error_mps == pytest.approx(0.5)
    assert hits[1].speed_error_mps == pytest.approx(0.3)


def test_duration_ends_with_the_last_frame() -> None:
    assert score(truths([[]] * 60), answers([[]] * 60)).duration_s == pytest.approx(2.0)


def test_refuses_frames_that_do_not_belong_together() -> None:
    with pytest.raises(ValueError, match="same frames"):
        score(truths([[]] * 3), answers([[]] * 2))
    shifted = [type(one)(one.stamp_s + 1 / FPS, one.detections, 1.0) for one in answers([[]] * 3)]
    with pytest.raises(ValueError, match="same frames"):
        score(truths([[]] * 3), shifted)
