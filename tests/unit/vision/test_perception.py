"""The whole of perception on painted frames, whose motion and depth are known exactly."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import cache

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.types import FloatArray, Intrinsics, PlanarPose, RgbdFrame
from tests.support.painted import (
    FRAME_NS,
    QVGA,
    VGA,
    Take,
    box,
    drive,
    floor,
    plain,
    record,
    vector,
)
from tests.support.painted_room import CRATE_M, SIDEWAYS, SMALL, TOWARDS, look, perception, room
from vision.percept import Percept
from vision.perception import Perception
from vision.scene import CameraCondition, Obstacle, Scene

JUDGED = 21  # frames: 0.7 s
watch = cache(look)  # most tests ask the same few takes different questions


@cache
def sideways(speed_mps: float, turn_radps: float, camera: Intrinsics = QVGA) -> Take:
    crate = box(vector(3.5, 1.0, 0.0), CRATE_M, 10, SIDEWAYS)
    return record(room() + crate, drive(speed_mps, turn_radps), JUDGED + 4, camera)


@cache
def towards(speed_mps: float, turn_radps: float) -> Take:
    crate = box(vector(4.5, 0.3, 0.0), CRATE_M, 10, TOWARDS)
    return record(room() + crate, drive(speed_mps, turn_radps), JUDGED + 4, QVGA)


@cache
def standing_room(speed_mps: float, turn_radps: float, count: int) -> Take:
    crates = box(vector(4.0, 1.0, 0.0), CRATE_M, 10) + box(vector(5.0, -1.0, 0.0), vector(0.4, 0.8, 0.7), 20)
    return record(room() + crates, drive(speed_mps, turn_radps), count, QVGA)


def only_mover(scene: Scene) -> Obstacle:
    movers = [one for one in scene.obstacles if one.moving]
    assert len(movers) == 1, movers
    return movers[0]


def assert_speed(take: Take, percepts: list[Percept], velocity_world_mps: FloatArray) -> None:
    """From 0.7 s on there is one mover, always the same, at its true velocity over ground."""
    ids = set()
    for k in range(JUDGED, len(percepts)):
        mover = only_mover(percepts[k].scene)
        expected = take.cameras[k].rotation.T @ velocity_world_mps
        assert np.linalg.norm(mover.velocity_mps - expected) <= 0.15
        assert mover.fragments >= 2
        assert mover.score > 0.5
        ids.add(mover.id)
    assert len(ids) == 1


@pytest.mark.parametrize("odometry", [True, False])
@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(0.0, 0.0), (0.5, 0.1)])
def test_crossing_crate_gets_its_velocity(speed_mps: float, turn_radps: float, odometry: bool) -> None:
    take = sideways(speed_mps, turn_radps)
    assert_speed(take, watch(take, odometry), SIDEWAYS)


@pytest.mark.parametrize("odometry", [True, False])
@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(0.0, 0.0), (0.5, 0.1)])
def test_crate_coming_nearer_gets_its_velocity(speed_mps: float, turn_radps: float, odometry: bool) -> None:
    take = towards(speed_mps, turn_radps)
    assert_speed(take, watch(take, odometry), TOWARDS)


def test_full_resolution_with_the_defaults() -> None:
    take = sideways(0.5, 0.1, VGA)
    assert_speed(take, watch(take, True, PerceptionConfig()), SIDEWAYS)


def test_a_plain_crate_without_any_texture_moves_too() -> None:
    crate = [replace(face, texture=plain(60)) for face in box(vector(3.5, 1.0, 0.0), CRATE_M, 10, SIDEWAYS)]
    take = record(room() + crate, drive(), 30, QVGA)
    mover = only_mover(watch(take, True)[-1].scene)
    assert np.linalg.norm(mover.velocity_mps - take.cameras[-1].rotation.T @ SIDEWAYS) <= 0.25


def test_position_and_box_of_the_mover() -> None:
    take = sideways(0.0, 0.0)
    mover = only_mover(watch(take, True)[-1].scene)
    # The front, 0.6 x 1.2 m, has gone from y = 1.0 to y = 1.0 - 0.8 t at x = 3.5; right is -y, down is -z.
    time_s = (len(take.frames) - 1) * FRAME_NS * 1e-9
    assert mover.position_m[0] == pytest.approx(-(1.0 - 0.8 * time_s), abs=0.1)
    assert mover.position_m[1] == pytest.approx(0.5 - 0.6, abs=0.15)
    assert mover.position_m[2] == pytest.approx(3.5, abs=0.15)
    u0, v0, u1, v1 = mover.bbox_px
    assert u0 == pytest.approx(QVGA.cx + QVGA.fx * (-1.3 + 0.8 * time_s) / 3.5, abs=5)
    assert v0 == pytest.approx(QVGA.cy + QVGA.fy * (0.5 - 1.2) / 3.5, abs=5)
    assert u1 - u0 == pytest.approx(0.6 / 3.5 * QVGA.fx, abs=10)
    assert v1 == pytest.approx(QVGA.cy + QVGA.fy * 0.5 / 3.5, abs=12)


@pytest.mark.parametrize("odometry", [True, False])
def test_nothing_moves_in_a_room_that_the_robot_drives_through(odometry: bool) -> None:
    take = standing_room(0.5, 0.1, 60)
    percepts = watch(take, odometry)
    for percept in percepts:
        assert [one.id for one in percept.scene.obstacles if one.moving] == []
        assert not percept.fragments.moving.any()
    assert {p.scene.ego_motion.source for p in percepts[1:]} == {"visual"}
    assert percepts[-1].scene.health.condition is CameraCondition.GOOD


def test_the_two_crates_and_the_wall_are_listed_and_keep_their_ids() -> None:
    percepts = watch(standing_room(0.5, 0.1, 60), True)
    listed = [{one.id for one in percept.scene.obstacles} for percept in percepts[5:]]
    always = set.intersection(*listed)
    assert len(always) == 3
    last = percepts[-1].scene.obstacles
    depth_m = sorted(float(one.position_m[2]) for one in last if one.id in always)
    way_m = 0.5 * 59 * FRAME_NS * 1e-9
    assert depth_m[0] == pytest.approx(4.0 - way_m, abs=0.35)
    assert all(one.score == 0.5 for one in last)


def test_ego_motion_follows_the_true_camera() -> None:
    take = standing_room(0.5, 0.1, 60)
    percepts = watch(take, False)
    for k in range(10, 60):
        ego = percepts[k].scene.ego_motion
        true = take.cameras[k - 1].inverse() @ take.cameras[k]
        error_m = np.linalg.norm(ego.motion.translation_m - true.translation_m)
        error_rad = np.linalg.norm(ego.motion.rotation - true.rotation) / np.sqrt(2.0)
        assert error_m < 0.006
        assert error_rad < 0.002
        assert ego.dt_s == pytest.approx(FRAME_NS * 1e-9)
        assert ego.inlier_ratio > 0.7


def test_marks_on_the_floor_are_fragments_but_no_obstacles() -> None:
    percepts = watch(record(floor(cell_m=0.2), drive(0.5), 12, QVGA), True)
    for percept in percepts:
        assert percept.scene.obstacles == ()
        assert np.isinf(percept.scene.free_space.nearest_m).all()
    assert len(percepts[-1].fragments.ids) >= 20
    assert (percepts[-1].fragments.obstacle_id == -1).all()


def test_fragments_know_their_obstacle_and_its_velocity() -> None:
    take = sideways(0.0, 0.0)
    last = watch(take, True)[-1]
    mover, fragments = only_mover(last.scene), last.fragments
    of_mover = fragments.obstacle_id == mover.id
    np.testing.assert_array_equal(fragments.moving, of_mover)
    assert np.count_nonzero(of_mover) >= 6
    velocity = fragments.velocity_mps[of_mover]
    assert np.nanmedian(velocity[:, 0]) == pytest.approx(0.8, abs=0.1)
    static = fragments.velocity_mps[~of_mover & np.isfinite(fragments.depth_m)]
    assert abs(np.nanmedian(static[:, 0])) < 0.05
    u0, v0, u1, v1 = mover.bbox_px
    middle = fragments.ends_px[of_mover].mean(axis=1)
    assert (middle > [u0 - 6, v0 - 6]).all()
    assert (middle < [u1 + 6, v1 + 6]).all()


def values(data: object) -> object:
    """Everything in a scene as plain, comparable values."""
    if isinstance(data, np.ndarray):
        return data.dtype.str, data.shape, data.tobytes()
    if isinstance(data, Enum):
        return data.name
    if is_dataclass(data):
        return [(field.name, values(getattr(data, field.name))) for field in fields(data)]
    return [values(one) for one in data] if isinstance(data, tuple) else repr(data)


def test_the_same_frames_give_the_same_scenes_to_the_last_bit() -> None:
    take = sideways(0.5, 0.1)
    first, second = watch(take, False), look(take, False)
    for one, other in zip(first, second, strict=True):
        assert values(one) == values(other)
    assert any(one.moving for one in first[-1].scene.obstacles)


@pytest.mark.parametrize("since_ns", [0, -(10**12), 1_700_000_000 * 10**9])
def test_origin_of_time_changes_nothing(since_ns: int) -> None:
    take = sideways(0.5, 0.1)
    eyes, start_ns = perception(), take.frames[0].captured_ns
    for frame, expected in zip(take.frames, watch(take, False), strict=True):
        shown = replace(frame, captured_ns=frame.captured_ns - start_ns + since_ns)
        scene = eyes.perceive(shown, None, None).scene
        assert values(scene.obstacles) == values(expected.scene.obstacles)


def test_robot_pose_time_and_number_are_handed_on() -> None:
    frame = sideways(0.0, 0.0).frames[3]
    pose = PlanarPose(1.0, 2.0, 0.3)
    scene = perception().perceive(frame, None, pose).scene
    assert scene.robot_pose == pose
    assert (scene.captured_ns, scene.sequence) == (frame.captured_ns, 3)


def test_an_image_of_another_size_starts_anew_and_breaks_nothing() -> None:
    small, odd = sideways(0.0, 0.0), Intrinsics(333, 251, 305.0, 305.0, 166.0, 125.0)
    crate = box(vector(3.5, 1.0, 0.0), CRATE_M, 10, SIDEWAYS)
    other = record(room() + crate, drive(), 14, odd)
    eyes = perception()
    for frame, camera in zip(small.frames[:8], small.cameras, strict=False):
        before = eyes.perceive(frame, camera, None)
    last_ns = small.frames[7].captured_ns
    scenes = []
    for k, frame in enumerate(other.frames):
        later = replace(frame, captured_ns=last_ns + (k + 1) * FRAME_NS, sequence=8 + k)
        scenes.append(eyes.perceive(later, None, None))
    assert scenes[0].scene.ego_motion.source == "none"
    assert not set(scenes[-1].fragments.ids) & set(before.fragments.ids)
    assert only_mover(scenes[-1].scene).velocity_mps[0] == pytest.approx(0.8, abs=0.15)


def test_a_mover_that_leaves_the_view_is_not_listed_for_ever() -> None:
    gone = room() + box(vector(3.5, -0.9, 0.0), CRATE_M, 10, vector(0.0, -1.4, 0.0))
    percepts = watch(record(gone, drive(), 40, QVGA), True)
    assert any(one.moving for percept in percepts for one in percept.scene.obstacles)
    assert not any(one.moving for one in percepts[-1].scene.obstacles)


def covered(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, colour=np.zeros_like(frame.colour))


def test_a_short_blackout_is_untrustworthy_and_then_over() -> None:
    take = sideways(0.0, 0.0)
    eyes = perception()
    conditions = []
    for k, frame in enumerate(take.frames):
        shown = covered(frame) if k in (10, 11) else frame
        percept = eyes.perceive(shown, take.cameras[k], None)
        conditions.append(percept.scene.health.condition)
    assert conditions[10:12] == [CameraCondition.UNTRUSTWORTHY] * 2
    assert conditions[20:] == [CameraCondition.GOOD] * (len(take.frames) - 20)
    assert only_mover(percept.scene).velocity_mps[0] == pytest.approx(0.8, abs=0.15)


def test_without_mounting_space_is_known_up_to_the_nearest_surface_only() -> None:
    take = standing_room(0.0, 0.0, 3)
    eyes = Perception(SMALL, None, 0.8, 0.05)
    space = eyes.perceive(take.frames[0], None, None).scene.free_space
    np.testing.assert_array_equal(space.known_m, np.where(np.isfinite(space.nearest_m), space.nearest_m, 0.0))
    assert np.isfinite(space.nearest_m).all()  # with no mounting, the floor is a surface too
