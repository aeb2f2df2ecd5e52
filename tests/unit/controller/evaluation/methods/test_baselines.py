"""Each representative of Table 1 finds a thing that moves before a wall, and leaves a still scene alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from controller.evaluation.methods.baselines.background_model import BackgroundModel
from controller.evaluation.methods.baselines.box_tracking import BoxTracking
from controller.evaluation.methods.baselines.dense_flow import DenseFlow
from controller.evaluation.methods.baselines.low_rank import LowRank, robust_pca
from controller.evaluation.methods.baselines.masks import IdTracker, blobs, half_depth_m, half_intrinsics
from controller.evaluation.methods.baselines.trajectories import Trajectories
from controller.evaluation.scores.matching import iou
from controller.evaluation.types import CALLED_MOVING, Box, DetectedObject, Method
from tests.support.evaluation_cases import CAMERA, moving_square, square_left_px

FRAMES = 14
PAN_PX = 2.0


def watch(method: Method, thing_px: float, size: tuple[int, int] = (120, 200)) -> list[DetectedObject]:
    """What is called moving in the last frame of a panning camera's sequence."""
    for index in range(FRAMES):
        answer = method.observe(moving_square(index, thing_px, PAN_PX, size), None)
    return [one for one in answer.detections if one.confidence >= CALLED_MOVING]


def true_box(thing_px: float) -> Box:
    left = square_left_px(FRAMES - 1, thing_px, PAN_PX)
    return left, 140.0, left + 120.0, 340.0


ALL: list[Callable[[], Method]] = [BackgroundModel, Trajectories, LowRank, DenseFlow]


@pytest.mark.parametrize("make", ALL)
def test_finds_the_thing_that_moves(make: Callable[[], Method]) -> None:
    moving = watch(make(), thing_px=8.0)
    overlaps = [iou(one.box, true_box(8.0)) for one in moving]
    assert max(overlaps, default=0.0) > 0.45
    best = moving[int(np.argmax(overlaps))]
    assert best.position_m[2] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("make", ALL)
def test_a_wall_that_only_the_camera_pans_over_does_not_move(make: Callable[[], Method]) -> None:
    assert watch(make(), thing_px=0.0, size=(0, 0)) == []


@pytest.mark.parametrize("make", ALL)
def test_two_runs_say_the_same(make: Callable[[], Method]) -> None:
    first, second = ([one.box for one in watch(make(), thing_px=8.0)] for _ in range(2))
    assert first == second


def test_a_tracker_keeps_the_box_that_it_was_given() -> None:
    tracking = BoxTracking()
    tracking.add_object(4, (150.0, 140.0, 270.0, 340.0))
    for index in range(8):
        answer = tracking.observe(moving_square(index, 4.0), None)
    left = square_left_px(7, 4.0)
    assert [one.id for one in answer.detections] == [4]
    assert iou(answer.detections[0].box, (left, 140.0, left + 120.0, 340.0)) > 0.6
    assert answer.detections[0].position_m[2] == pytest.approx(3.0, abs=0.05)


def test_a_tracker_that_was_given_nothing_finds_nothing() -> None:
    assert BoxTracking().observe(moving_square(0), None).detections == ()


def test_robust_pca_takes_the_sparse_part_out() -> None:
    generator = np.random.default_rng(3)
    low = np.outer(generator.uniform(50.0, 200.0, 400), np.ones(12))
    sparse = np.zeros_like(low)
    where = generator.choice(400 * 12, 150, replace=False)
    sparse.ravel()[where] = 80.0
    found = robust_pca(low + sparse)
    assert np.abs(found - sparse).max() < 2.0


def test_parts_are_cut_where_the_depth_jumps() -> None:
    frame = moving_square(0)
    mask = np.zeros((240, 320), np.uint8)
    mask[80:150, 100:180] = 255  # over the thing and the wall beside it
    found = blobs(mask, half_depth_m(frame), half_intrinsics(CAMERA))
    depths = sorted(round(float(one.position_m[2]), 1) for one in found)
    assert depths == [3.0, 5.0]


def test_small_parts_are_dropped() -> None:
    mask = np.zeros((240, 320), np.uint8)
    mask[80:88, 80:88] = 255
    assert blobs(mask, half_depth_m(moving_square(0)), half_intrinsics(CAMERA)) == []


def test_an_identity_lives_on_through_a_few_frames_unseen() -> None:
    identities = IdTracker()
    mask = np.zeros((240, 320), np.uint8)
    mask[80:150, 80:130] = 255
    seen = blobs(mask, half_depth_m(moving_square(0)), half_intrinsics(CAMERA))
    first = identities.answer(seen, None).detections[0]
    identities.answer([], None)
    again = identities.answer(seen, None).detections[0]
    assert first.id == again.id
    assert first.confidence < CALLED_MOVING <= again.confidence
