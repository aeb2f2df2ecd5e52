"""Depth that repeats to the bit: a fault once something has moved, and none while nothing does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import Pose, RgbdFrame
from tests.support.painted import MOUNT, QVGA, box, drive, floor, record, vector, wall
from vision.camera.frozen_depth import FrozenDepth, _alike, _changed
from vision.perception import Perception
from vision.scene import CameraCondition, CameraHealth

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
GOOD, UNTRUSTWORTHY = CameraCondition.GOOD, CameraCondition.UNTRUSTWORTHY
PLACE = floor() + wall() + box(vector(3.5, 0.0, 0.0), vector(0.4, 0.6, 1.2), 10)
# Noise in colour, none in depth.
STANDING = record(PLACE, drive(), 8, QVGA).frames
DRIVING = record(PLACE, drive(0.8), 12, QVGA).frames


def healths(frames: list[RgbdFrame], odometry: list[Pose] | None = None) -> list[CameraHealth]:
    eyes = Perception(SMALL, MOUNT, 0.8, 0.05)
    known: Sequence[Pose | None] = odometry or [None] * len(frames)
    return [eyes.perceive(frame, pose, None).scene.health for frame, pose in zip(frames, known, strict=True)]


def with_depth_of(frame: RgbdFrame, other: RgbdFrame) -> RgbdFrame:
    return replace(frame, depth=other.depth.copy())


def test_frozen_depth_beside_live_colour_is_untrustworthy_from_its_third_repetition_on() -> None:
    frozen = [with_depth_of(frame, DRIVING[0]) for frame in DRIVING[:8]]
    found = healths([*frozen, *DRIVING[8:]])
    assert [health.condition for health in found[:3]] == [GOOD] * 3
    assert [health.condition for health in found[3:8]] == [UNTRUSTWORTHY] * 5
    assert found[3].reason == "depth has not changed by a single unit for 3 frames of motion"
    assert "for 7 frames" in found[7].reason
    assert [health.condition for health in found[8:]] == [GOOD] * 4, "it lives again"


@pytest.mark.parametrize("every", [2, 3])
def test_depth_at_a_part_of_colour_s_rate_is_not_frozen(every: int) -> None:
    slower = [with_depth_of(frame, DRIVING[k - k % every]) for k, frame in enumerate(DRIVING)]
    assert {health.condition for health in healths(slower)} == {GOOD}


def test_without_noise_the_depth_of_a_place_where_nothing_moves_may_repeat() -> None:
    assert (STANDING[0].depth == STANDING[-1].depth).all()
    assert {health.condition for health in healths(STANDING)} == {GOOD}


def test_before_a_wall_without_a_pattern_the_odometry_tells_that_the_robot_moves() -> None:
    ahead = [Pose(np.eye(3), np.array([0.0, 0.0, 0.02 * k])) for k in range(8)]
    turns = [np.array([[1.0, 0.0, 0.01 * k], [0.0, 1.0, 0.0], [-0.01 * k, 0.0, 1.0]]) for k in range(8)]
    turning = [Pose(turn, np.zeros(3)) for turn in turns]
    stuck = [Pose(np.eye(3), np.array([0.0, 0.0, 0.001 * k])) for k in range(8)]
    for odometry, found in ((ahead, 7), (turning, 7), (stuck, 0)):
        watch = FrozenDepth()
        for k, pose in enumerate(odometry):
            grey = np.full((240, 320), 128 + k % 2, np.uint8)
            told = watch.step(DRIVING[0].depth, grey, pose, repeated=False)
        assert told == found


def test_slow_motion_adds_up_and_what_has_moved_is_not_forgotten() -> None:
    watch, depth = FrozenDepth(), np.full((480, 848), 2000, np.uint16)
    told = [watch.step(depth, np.full((480, 848), 100 + level, np.uint8), None, False) for level in range(15)]
    assert told == [0] * 13 + [13, 14]
    assert watch.step(depth, np.full((480, 848), 100, np.uint8), None, False) == 15


def test_a_frame_that_repeats_as_a_whole_says_nothing_of_depth_alone() -> None:
    watch, depth = FrozenDepth(), np.full((480, 848), 2000, np.uint16)
    grey = np.zeros((480, 848), np.uint8)
    assert [watch.step(depth, grey, None, repeated=k > 0) for k in range(9)] == [0] * 9
    still = [replace(DRIVING[0], captured_ns=f.captured_ns, sequence=f.sequence) for f in DRIVING]
    assert all("depth" not in health.reason for health in healths(still))


def test_depth_that_changes_between_the_samples_is_not_frozen() -> None:
    """As of a small thing that moves, in images without noise."""
    watch = FrozenDepth()
    for k in range(9):
        depth = np.full((480, 848), 2000, np.uint16)
        depth[100, 100] += k
        assert watch.step(depth, np.full((480, 848), 20 * k, np.uint8), None, False) == 0


def test_no_depth_again_and_again_is_told_as_no_depth() -> None:
    found = healths([replace(frame, depth=np.zeros_like(frame.depth)) for frame in DRIVING])
    assert "only 0.0% of the depth image" in found[-1].reason
    assert "single unit" not in found[-1].reason


def test_samples_of_depth_are_those_of_the_one_before_or_not() -> None:
    """One in 16 px each way, beginning at the eighth."""
    depth = np.zeros((56, 97), np.uint16)
    assert _alike(depth, depth.copy())
    for place in ((8, 8), (40, 88)):
        other = depth.copy()
        other[place] = 1
        assert not _alike(depth, other)
    assert not _alike(depth, np.empty((0, 0), np.uint16))
    assert not _alike(depth, np.zeros((97, 56), np.uint16))


def test_a_sample_has_changed_by_more_than_noise_or_not() -> None:
    grey = np.full((56, 97), 100, np.uint8)
    other = grey.copy()
    other[8, 8], other[24, 8], other[40, 88], other[9, 9] = 87, 113, 112, 0
    assert _changed(other, grey) == _changed(grey, other) == 2 / 18
    assert _changed(grey, np.empty((0, 0), np.uint8)) == 1.0
