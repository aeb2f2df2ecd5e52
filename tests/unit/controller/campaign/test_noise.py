from __future__ import annotations

import math

import numpy as np
import pytest

from config.camera import SimulatedCameraConfig
from config.faults import Faults
from controller.campaign.noise_mission import drive_noise
from controller.campaign.noise_model import NoiseModel
from controller.campaign.noisy_camera import NoisyCamera
from controller.campaign.policies import build_policy
from controller.campaign.stage import Stage
from controller.decision.decision import Decision
from controller.decision.situation import Situation
from hal.geometry import camera_in_floor, mount_of
from hal.types import PlanarPose
from tests.support.campaign import CONFIG, crate, frozen, late, mover, silent, stage
from vision.scene import CameraCondition, Scene

CAMERA = SimulatedCameraConfig()
ORIGIN = PlanarPose(0.0, 0.0, 0.0)
QUIET = NoiseModel(
    depth_sigma_1pm=0.0,
    lateral_sigma_m=0.0,
    lateral_velocity_mps=0.0,
    lateral_velocity_per_m=0.0,
    radial_velocity_mps=0.0,
    radial_velocity_per_m=0.0,
    miss_rate=0.0,
    miss_rate_at_range=0.0,
)


def scenes(
    made: Stage, count: int, noise: NoiseModel | None = None, seed: int = 1, pose: PlanarPose = ORIGIN
) -> list[Scene]:
    camera = NoisyCamera(made, CAMERA, seed, noise)
    return [camera.look(k / CAMERA.fps, k, pose, pose) for k in range(count)]


def on_floor(scene: Scene) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.float64]], ...]:
    camera = camera_in_floor(ORIGIN, mount_of(CONFIG.robot))
    one = scene.obstacles[0]
    return camera.apply(one.position_m[None])[0], camera.rotation @ one.velocity_mps


def test_without_noise_the_scene_is_the_truth() -> None:
    made = stage(mover(8.0, 0.0, -8.0, 0.0, 1.0))
    position, velocity = on_floor(scenes(made, 60, QUIET)[-1])
    # After 2 s its middle has come 2 m; what is seen is its front, half a metre before that.
    assert position[:2] == pytest.approx([8.0 - 59 / 30 - 0.5, 0.0], abs=0.05)
    assert velocity[:2] == pytest.approx([-1.0, 0.0], abs=0.02)


def test_track_is_reported_from_its_third_sighting_on_with_one_id() -> None:
    found = scenes(stage(crate(5.0)), 10, QUIET)
    assert [len(one.obstacles) for one in found[:4]] == [0, 0, 1, 1]
    assert {one.obstacles[0].id for one in found[2:]} == {1}
    assert found[2].obstacles[0].age_s == pytest.approx(2 / CAMERA.fps)


def test_a_first_sight_bounds_the_velocity_by_v_omax_and_narrows() -> None:
    found = scenes(stage(crate(5.0)), 40)
    spread = [math.sqrt(one.obstacles[0].velocity_cov[2, 2]) for one in found[2:]]
    assert spread[0] > 0.8
    assert spread[-1] < 0.25
    assert spread == sorted(spread, reverse=True)


def test_standing_is_not_moving_and_walking_is_within_a_quarter_of_a_second() -> None:
    assert not any(one.obstacles[0].moving for one in scenes(stage(crate(5.0)), 60)[2:])
    walking = scenes(stage(mover(5.0, -1.0, 5.0, 3.0, 1.0)), 30)
    assert walking[8].obstacles[0].moving


def test_errors_have_the_spread_that_is_said() -> None:
    """Over many seeds: depth 0.25 * 0.0075 z^2 at the crate's front, velocity as its covariance says."""
    made = stage(crate(6.0))
    depth, velocity = [], []
    for seed in range(400):
        last = next(one for one in reversed(scenes(made, 12, seed=seed)) if one.obstacles).obstacles[0]
        depth.append(last.position_m[2])
        velocity.append(last.velocity_mps / np.sqrt(np.diag(last.velocity_cov)))
    z = 6.0 - 0.3 - 0.45
    assert np.std(depth) == pytest.approx(0.25 * 0.0075 * z * z, rel=0.15)
    assert np.abs(np.mean(depth) - z) < 0.02
    # The young part of the spread has not faded altogether after 0.4 s.
    assert 0.6 < np.std(velocity, axis=0)[2] < 1.1


def test_some_frames_miss_it_and_it_is_predicted_meanwhile() -> None:
    found = scenes(stage(crate(4.0)), 400)
    unseen = [one.obstacles[0].unseen_s for one in found[5:]]
    share = np.mean(np.array(unseen) > 0.0)
    assert share == pytest.approx(NoiseModel().miss_rate, abs=0.02)
    assert max(unseen) < NoiseModel().forget_s


def test_hidden_track_is_forgotten_after_half_a_second_and_gets_a_new_id() -> None:
    """It crosses from right to left; a tall crate hides it for two seconds in the middle."""
    made = stage(mover(8.0, -4.0, 8.0, 6.0, 1.0, name="walker"), crate(4.0, 0.0, size_m=1.2, name="hides"))
    crate_id = scenes(stage(crate(4.0, 0.0, size_m=1.2)), 5, QUIET)[-1].obstacles[0].id
    assert crate_id == 1
    ids = [{one.id for one in scene.obstacles if one.moving} for scene in scenes(made, 260, QUIET)]
    seen = [next(iter(one)) for one in ids if one]
    assert len(set(seen)) == 2
    gap = [not one for one in ids][ids.index({seen[0]}) : len(ids) - ids[::-1].index({seen[-1]})]
    assert sum(gap) > 0.5 * CAMERA.fps


def test_hidden_body_gets_no_new_measurement() -> None:
    """It stops behind the crate: while it is remembered, it goes on as it was seen to."""
    made = stage(mover(8.0, -4.0, 8.0, -0.9, 1.0), crate(4.0, 0.0, size_m=1.2))
    walkers = [one for scene in scenes(made, 200, QUIET) for one in scene.obstacles if one.moving]
    hidden = [one for one in walkers if one.unseen_s > 0.0]
    assert len(hidden) > 10
    assert [one.velocity_mps[0] for one in hidden] == pytest.approx([hidden[0].velocity_mps[0]] * len(hidden))
    assert abs(hidden[0].velocity_mps[0]) > 0.5


def test_free_space_shows_the_nearest_and_knows_nothing_behind_it() -> None:
    space = scenes(stage(crate(5.0, size_m=1.0)), 1, QUIET)[0].free_space
    ahead = np.abs(space.bearing_tan) < 0.08
    assert space.nearest_m[ahead] == pytest.approx(4.05)
    assert space.known_m[ahead] == pytest.approx(4.05)
    beside = np.abs(space.bearing_tan) > 0.2
    assert np.isinf(space.nearest_m[beside]).all()
    assert space.known_m[beside] == pytest.approx(CAMERA.depth_max_m)


def test_free_space_errs_towards_near() -> None:
    space = np.array([one.free_space.nearest_m[40] for one in scenes(stage(crate(6.0)), 300)])
    assert 0.05 < 5.25 - space.mean() < 0.35
    assert 0.03 < space.std() < 0.2


def test_body_that_the_robot_drives_over_or_under_is_no_surface() -> None:
    for body in (crate(5.0, height_m=0.04), crate(5.0).model_copy(update={"z_m": 1.5})):
        assert np.isinf(scenes(stage(body), 1, QUIET)[0].free_space.nearest_m).all()


@pytest.mark.parametrize(("under_m", "listed"), [(0.79, True), (0.81, False)])
def test_body_that_hangs_above_the_robot_is_no_obstacle(under_m: float, listed: bool) -> None:
    hangs = crate(5.0).model_copy(update={"z_m": under_m})
    assert any(one.obstacles for one in scenes(stage(hangs), 5, QUIET)) == listed


def test_body_nearer_than_the_minimum_depth_is_not_measured() -> None:
    """A crate of 0.6 m before a camera that sits 0.45 m ahead of the robot's middle."""
    for gap_m, seen in ((CAMERA.depth_min_m + 0.02, True), (CAMERA.depth_min_m - 0.02, False)):
        last = scenes(stage(crate(0.45 + gap_m + 0.3)), 5, QUIET)[-1]
        assert len(last.obstacles) == seen
        middle = len(last.free_space.nearest_m) // 2
        assert np.isfinite(last.free_space.nearest_m[middle]) == seen
        assert last.free_space.known_m[middle] <= (gap_m if seen else 0.0)


def test_glass_is_neither_obstacle_nor_surface_and_nothing_is_known_behind_it() -> None:
    made = stage(crate(5.0, size_m=1.0).model_copy(update={"glass": True}))
    last = scenes(made, 5, QUIET)[-1]
    assert last.obstacles == ()
    ahead = np.abs(last.free_space.bearing_tan) < 0.08
    assert np.isinf(last.free_space.nearest_m[ahead]).all()
    assert last.free_space.known_m[ahead] == pytest.approx(4.05)


class Spy:
    """Drives on and keeps the scenes it is shown."""

    def __init__(self) -> None:
        self.seen: list[tuple[float, Scene | None]] = []
        self._inner = build_policy("zones", CONFIG, stage())

    def step(self, at: Situation) -> Decision:
        self.seen.append((at.now_ns * 1e-9, at.scene))
        return self._inner.step(at)


def ages(spy: Spy) -> dict[float, float]:
    return {t_s: t_s - scene.captured_ns * 1e-9 for t_s, scene in spy.seen if scene is not None}


def test_an_empty_drive_arrives_in_little_more_than_the_s_curve_time() -> None:
    spy = Spy()
    log = drive_noise(stage(length_m=6.0), CONFIG, spy)
    assert log.reached_s == pytest.approx(6.0 / 1.5 + 5.0 + 0.5, rel=0.06)
    assert log.s_m[-1] == pytest.approx(6.0, abs=0.06)
    assert log.setpoints.violations == 0
    assert max(ages(spy).values()) < 0.06 + 1 / 30 + 0.021
    assert min(ages(spy).values()) >= 0.06 - 1e-9


def test_a_silent_camera_shows_no_new_scene() -> None:
    spy = Spy()
    drive_noise(stage(length_m=4.0, faults=silent(2.0, 3.0)), CONFIG, spy)
    old = ages(spy)
    assert max(age for t_s, age in old.items() if 2.9 < t_s < 3.0) > 0.9
    assert max(age for t_s, age in old.items() if t_s > 3.2) < 0.12


def test_a_frozen_camera_is_not_to_be_trusted_from_its_second_repetition_on() -> None:
    spy = Spy()
    drive_noise(stage(length_m=4.0, faults=frozen(2.0, 3.0)), CONFIG, spy)
    trusted = {t: s.health.condition is CameraCondition.GOOD for t, s in spy.seen if s is not None}
    assert not any(good for t_s, good in trusted.items() if 2.2 < t_s < 3.0)
    assert all(good for t_s, good in trusted.items() if t_s < 2.0 or t_s > 3.2)


def test_late_frames_come_late() -> None:
    spy = Spy()
    delayed = late(2.0, 4.0, 0.2)
    drive_noise(stage(length_m=4.0, faults=delayed), CONFIG, spy)
    assert min(age for t_s, age in ages(spy).items() if 2.5 < t_s < 4.0) >= 0.26 - 1e-9


def test_lost_feedback_ends_the_drive_at_rest() -> None:
    log = drive_noise(stage(length_m=20.0, faults=Faults(feedback_lost_s=3.0)), CONFIG, Spy())
    assert log.reached_s is None
    assert log.v_mps[-1] < 0.05
    assert 3.2 < log.times_s[-1] < 5.0


def test_a_robot_that_stands_for_ever_is_given_up() -> None:
    made = stage(crate(4.0), length_m=10.0, blocked=True)
    log = drive_noise(made, CONFIG, build_policy("field", CONFIG, made))
    assert log.reached_s is None
    assert log.times_s[-1] < 30.0
