"""Odometry that the images deny, and what is left of it afterwards: nothing that stands seems to move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hal.geometry import camera_in_floor
from hal.types import PlanarPose, Pose
from tests.support.painted import MOUNT, QVGA, Take, box, drive, record, vector
from tests.support.painted_room import CRATE_M, perception, room
from vision.percept import Percept
from vision.scene import CameraCondition, Scene

COUNT = 36
WARM = 5


@cache
def take(speed_mps: float) -> Take:
    crates = box(vector(3.0, 0.6, 0.0), CRATE_M, 10) + box(vector(5.0, -1.0, 0.0), vector(0.4, 0.8, 0.7), 20)
    return noisy(record(room() + crates, drive(speed_mps), COUNT, QVGA))


def noisy(shown: Take) -> Take:
    """With depth that is off by a unit here and there, as any camera's: the same to the bit, it is frozen."""
    rng = np.random.default_rng(1)
    frames = [
        replace(frame, depth=frame.depth + (rng.random(frame.depth.shape) < 0.1) * (frame.depth > 0))
        for frame in shown.frames
    ]
    return replace(shown, frames=[replace(one, depth=one.depth.astype(np.uint16)) for one in frames])


def reckoned(path: Callable[[float], PlanarPose]) -> list[Pose]:
    return [camera_in_floor(path(k / 30.0), MOUNT) for k in range(COUNT)]


def look(shown: Take, odometry: list[Pose]) -> list[Percept]:
    eyes = perception()
    return [eyes.perceive(frame, pose, None) for frame, pose in zip(shown.frames, odometry, strict=True)]


def movers(scenes: list[Scene]) -> int:
    return sum(one.moving for scene in scenes for one in scene.obstacles)


@pytest.mark.parametrize(
    ("true_mps", "reckoned_mps"),
    [
        pytest.param(0.0, 0.3, id="pushes against something, the tracks spin"),
        pytest.param(1.0, 1.6, id="a wrong scale"),
        pytest.param(0.5, 0.0, id="stuck"),
    ],
)
def test_a_disputed_motion_makes_nothing_move(true_mps: float, reckoned_mps: float) -> None:
    percepts = look(take(true_mps), reckoned(drive(reckoned_mps)))
    scenes = [one.scene for one in percepts]
    assert movers(scenes) == 0
    disputed = [scene for scene in scenes if scene.ego_motion.source == "disputed"]
    assert len(disputed) >= 0.75 * COUNT
    for scene in disputed:
        assert scene.health.condition is CameraCondition.DEGRADED
        assert "do the tracks slip, or is the odometry wrong?" in scene.health.reason
    # The camera goes as the images tell it.
    ways_m = [float(np.linalg.norm(scene.ego_motion.motion.translation_m)) for scene in disputed]
    assert np.median(ways_m) == pytest.approx(true_mps / 30.0, abs=3e-3)


def test_a_vehicle_that_fills_the_view_and_drives_off_moves_and_not_the_robot() -> None:
    """At first all that the standing robot sees goes away from it, as if it went back itself."""
    crates = box(vector(2.6, 1.0, 0.0), CRATE_M, 10) + box(vector(3.0, -1.2, 0.0), CRATE_M, 20)
    vehicle = box(vector(0.45, 0.0, 0.0), vector(1.0, 0.9, 1.0), 30, vector(0.6, 0.0, 0.0))
    shown = noisy(record(room() + crates + vehicle, drive(0.0), 2 * COUNT, QVGA))
    eyes = perception()
    scenes = [eyes.perceive(frame, shown.cameras[0], None).scene for frame in shown.frames]
    assert {scene.ego_motion.source for scene in scenes[1:]} == {"visual", "odometry"}
    for scene in scenes[8:]:
        (mover,) = [one for one in scene.obstacles if one.moving]
        assert mover.velocity_mps[2] == pytest.approx(0.6, abs=0.15)
    # Its fragments leave room for those of what comes into view behind it.
    assert {scene.health.condition for scene in scenes[-COUNT // 2 :]} == {CameraCondition.GOOD}


def test_motion_impossible_for_a_tracked_base_is_disputed_without_blaming_the_odometry() -> None:
    """The base slides to the left, as on a slope of ice; the images are all that there is."""
    shown = noisy(record(room(), lambda time_s: PlanarPose(0.0, 0.6 * time_s, 0.0), COUNT, QVGA))
    eyes = perception()
    scenes = [eyes.perceive(frame, None, None).scene for frame in shown.frames]
    assert movers(scenes) == 0
    disputed = [scene for scene in scenes if scene.ego_motion.source == "disputed"]
    assert len(disputed) >= 5
    for scene in disputed:
        assert scene.health.condition is CameraCondition.DEGRADED
        assert "a tracked base hardly makes" in scene.health.reason
        assert "odometry" not in scene.health.reason


def test_a_robot_that_seems_to_go_backwards_is_disputed_where_only_the_images_tell() -> None:
    shown = noisy(record(room(), drive(-0.2), COUNT, QVGA))
    eyes = perception()
    scenes = [eyes.perceive(frame, None, None).scene for frame in shown.frames]
    assert movers(scenes) == 0
    disputed = [scene for scene in scenes if scene.ego_motion.source == "disputed"]
    assert len(disputed) >= 5
    assert {scene.health.condition for scene in disputed} == {CameraCondition.DEGRADED}
    # With odometry it may: another planner drives it, or somebody pushes it.
    backwards = [one.scene for one in look(shown, reckoned(drive(-0.2)))]
    assert {scene.ego_motion.source for scene in backwards[1:]} == {"visual"}


def test_after_a_jump_of_the_odometry_nothing_moves() -> None:
    def jumps(time_s: float) -> PlanarPose:
        return PlanarPose(0.5 * time_s + (0.2 if time_s > 0.5 else 0.0), 0.0, 0.0)

    scenes = [one.scene for one in look(take(0.5), reckoned(jumps))]
    assert movers(scenes) == 0
    assert scenes[-1].health.condition is CameraCondition.GOOD


def test_an_image_that_comes_twice_under_two_stamps_is_not_compared_with_itself() -> None:
    """The camera seems to stand, and then to go twice as fast: it does neither."""
    true = take(0.5)
    frames = [
        replace(true.frames[k - 1], captured_ns=frame.captured_ns, sequence=k) if k % 10 == 7 else frame
        for k, frame in enumerate(true.frames)
    ]
    shown = Take(frames, true.cameras)
    eyes = perception()
    scenes = [eyes.perceive(frame, None, None).scene for frame in shown.frames]
    assert movers(scenes) == 0
    assert [k for k, scene in enumerate(scenes) if scene.ego_motion.source == "none"] == [0, 7, 17, 27]
    assert {scene.health.condition for scene in scenes} == {CameraCondition.GOOD}
    ids = {one.id for scene in scenes[WARM:] for one in scene.obstacles}
    assert len(ids) == len(scenes[-1].obstacles)
    assert scenes[28].ego_motion.dt_s == pytest.approx(2 / 30.0)


def test_a_change_between_the_pixels_that_are_compared_first_is_a_change() -> None:
    still = take(0.0).frames[0]
    eyes = perception()
    for k in range(8):
        colour = still.colour.copy()
        colour[3, 5] = 10 * k
        frame = replace(still, colour=colour, captured_ns=still.captured_ns + k * 33_333_333, sequence=k)
        scene = eyes.perceive(frame, None, None).scene
    assert scene.health.condition is CameraCondition.GOOD
    assert scene.ego_motion.source == "visual"


def test_a_repetition_is_worth_no_more_than_what_it_repeats() -> None:
    frames = take(0.0).frames
    plain = np.full_like(frames[0].colour, 128)
    eyes = perception()
    told = [
        eyes.perceive(replace(frame, colour=plain) if k in (4, 5) else frame, None, None).scene.health
        for k, frame in enumerate(frames[:6])
    ]
    assert told[4].condition is CameraCondition.UNTRUSTWORTHY
    assert (told[5].condition, told[5].reason) == (told[4].condition, told[4].reason)
