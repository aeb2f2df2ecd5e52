"""What is wrong for a moment is over after it: odometry that is none, and a clock that steps back."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import Pose
from tests.support.painted import MOUNT, QVGA, Take, box, drive, floor, record, vector, wall
from vision.perception import Perception
from vision.scene import CameraCondition, Scene

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
COUNT = 14
NAN = float("nan")


@cache
def room() -> Take:
    crate = box(vector(3.5, 0.3, 0.0), vector(0.4, 0.6, 1.2), 10)
    return record(floor() + wall() + crate, drive(0.4), COUNT, QVGA)


def perception() -> Perception:
    return Perception(SMALL, MOUNT, 0.8, 0.05)


@pytest.mark.parametrize(
    "wrong", [Pose(np.full((3, 3), NAN), np.full(3, NAN)), Pose(np.eye(3), np.array([NAN, 0.0, 0.0]))]
)
def test_odometry_that_is_none_for_a_frame_is_none_for_that_frame_only(wrong: Pose) -> None:
    eyes, take = perception(), room()
    odometry = [wrong if k == 6 else camera for k, camera in enumerate(take.cameras)]
    seen = [eyes.perceive(frame, pose, None).scene for frame, pose in zip(take.frames, odometry, strict=True)]
    for scene in seen[3:]:
        assert scene.health.condition is CameraCondition.GOOD
        assert np.isfinite(scene.ego_motion.motion.translation_m).all()
        assert len(scene.obstacles) == 2  # crate and wall


def seen(offsets_ns: dict[int, int], black: tuple[int, ...] = ()) -> list[Scene]:
    """offsets_ns: from that frame on all stamps are so much later. black: frames that show nothing."""
    eyes, result, offset = perception(), [], 10**12
    for k, (frame, camera) in enumerate(zip(room().frames, room().cameras, strict=True)):
        offset += offsets_ns.get(k, 0)
        colour = np.zeros_like(frame.colour) if k in black else frame.colour
        shown = replace(frame, colour=colour, captured_ns=frame.captured_ns + offset)
        result.append(eyes.perceive(shown, camera, None).scene)
    return result


@pytest.mark.parametrize("back_s", [0.15, 100])
@pytest.mark.parametrize("black", [(), (7,)])
def test_a_clock_that_steps_back_is_taken_as_true_after_three_frames(
    back_s: float, black: tuple[int, ...]
) -> None:
    scenes = seen({5: -round(back_s * 1e9)}, black)
    conditions = [scene.health.condition for scene in scenes]
    assert conditions[4] is CameraCondition.GOOD
    assert conditions[5:8] == [CameraCondition.UNTRUSTWORTHY] * 3
    assert "older than the one before" in scenes[5].health.reason
    assert "time has gone back" in scenes[7].health.reason
    assert conditions[9:] == [CameraCondition.GOOD] * (COUNT - 9)
    # What was known before has gone, and what is there is found again.
    before = {one.id for one in scenes[4].obstacles}
    assert len(before) == 2
    for scene in scenes[7 + len(black) :]:
        assert not before & {one.id for one in scene.obstacles}
    assert len(scenes[-1].obstacles) == 2
    assert all(0.0 <= one.unseen_s < 0.2 and 0.0 <= one.age_s < 1.0 for one in scenes[-1].obstacles)


def test_after_one_frame_stamped_in_the_future_tracking_goes_on() -> None:
    scenes = seen({5: 10**10, 6: -(10**10)})
    assert scenes[8].health.condition is CameraCondition.UNTRUSTWORTHY
    assert [scene.health.condition for scene in scenes[9:]] == [CameraCondition.GOOD] * (COUNT - 9)


def test_single_frames_that_come_late_step_no_clock() -> None:
    """Every other one is 0.2 s old: those between follow each other."""
    late = {k: (-1 if k % 2 else 1) * 200_000_000 for k in range(5, 13)}
    scenes = seen(late)
    bad = [k for k, scene in enumerate(scenes) if scene.health.condition is not CameraCondition.GOOD]
    assert bad == [5, 7, 9, 11]
    assert not any("time has gone back" in scene.health.reason for scene in scenes)
    assert {one.id for one in scenes[4].obstacles} == {one.id for one in scenes[-1].obstacles}
