"""What the decision knows of the way ahead: who is a newcomer, and who only has a new number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.app import ReplayConfig
from config.decision import DecisionConfig
from config.perception import DepthNoise, PerceptionConfig
from config.robot import Robot
from controller.decision.world_model import WorldModel
from controller.path.path import OnPath
from controller.replay.build import build_replay_decision
from hal.types import PlanarPose
from tests.support.decision_bench import MOUNT, PATH, Bench, obstacle
from tests.support.scenes import free_space
from vision.scene import FreeSpace, Obstacle

START = OnPath(0.0, 0.0, 0.0)


def after(*frames: tuple[Obstacle, ...]) -> WorldModel:
    """What is known after these were seen, one after the other, by a robot that drives."""
    bench = Bench()
    known = WorldModel(PATH, Robot(), MOUNT, DecisionConfig(), 0.0)
    for shown in frames:
        bench.now_ns += 33_000_000
        known.update(bench.scene(*shown), PlanarPose(0.0, 0.0, 0.0), START, 0.5, bench.now_ns)
    return known


CRATE = [(obstacle(4.0, 0.0),)] * 10


def age_s(y_m: float, seen_s: float) -> float:
    """For how long something was seen, by what is known, that shows where there was a crate before."""
    bodies = after(*CRATE, (obstacle(4.0, y_m, age_s=seen_s, number=6),)).bodies
    assert bodies.tracked_s.item() == pytest.approx(seen_s)
    return float(bodies.age_s.item())


def test_body_where_one_stood_before_keeps_its_age() -> None:
    assert age_s(0.1, 0.03) == 0.5
    assert age_s(1.0, 0.03) == pytest.approx(0.03)
    assert age_s(0.1, 2.0) == 2.0


@pytest.mark.parametrize(("frames", "known"), [(5, False), (7, True)])
def test_only_what_stood_there_200_ms_before_is_known(frames: int, known: bool) -> None:
    """The frames are 33 ms apart."""
    bodies = after(*CRATE[:frames], (obstacle(4.0, 0.1, age_s=0.03, number=6),)).bodies
    assert (bodies.age_s[bodies.ids == 6].item() >= 0.5) == known


def test_who_has_a_new_number_keeps_the_age_in_the_frames_that_follow() -> None:
    renumbered = [(obstacle(4.0, 0.1, age_s=0.033 * k, number=6),) for k in range(1, 12)]
    assert after(*CRATE, *renumbered).bodies.age_s.item() == 0.5


def test_who_has_a_new_number_keeps_the_age_though_in_one_frame_it_is_a_mere_strip() -> None:
    renumbered = [(obstacle(4.0, 0.1, age_s=0.033 * k, number=6),) for k in range(1, 12)]
    renumbered[8] = (replace(renumbered[8][0], extent_m=np.array([0.02, 1.7, 0.2])),)
    assert after(*CRATE, *renumbered).bodies.age_s.item() == 0.5


def test_a_newcomer_is_not_known_by_its_own_surface_of_a_moment_ago() -> None:
    """Something right before the camera, soon gone again: it would be waited for without end."""
    newcomer = [(obstacle(4.0, 0.1, age_s=0.033 * k, number=6),) for k in range(1, 12)]
    assert after(*[()] * 10, *newcomer).bodies.age_s.item() == pytest.approx(0.033 * 11)


def test_where_a_mover_has_just_been_a_new_track_is_a_newcomer() -> None:
    """It is a part of him, such as an arm."""
    mover = [(replace(one, moving=True),) for (one,) in CRATE]
    bodies = after(*mover, (obstacle(4.0, 0.1, age_s=0.03, number=6),)).bodies
    assert bodies.age_s[bodies.ids == 6].item() == pytest.approx(0.03)


def test_a_strip_is_no_body_unless_it_moves() -> None:
    """2 cm of a rack, or of somebody's leg: where it stands is what depth sees of it."""
    strip = obstacle(4.0, 0.1, age_s=0.6, number=6, size_m=(0.02, 0.3))
    known = after(*[(strip,)] * 3)
    assert not len(known.bodies)
    assert known.unboxed.ids.tolist() == [6]
    assert after((replace(strip, moving=True),)).bodies.ids.tolist() == [6]
    assert after((obstacle(4.0, 0.1, number=6, size_m=(0.04, 0.3)),)).bodies.ids.tolist() == [6]


def test_a_large_thing_that_stands_is_no_body_unless_it_is_a_vehicle_that_has_just_stopped() -> None:
    """2.4 m across the way. Its box then begins nearer, by what its ends may swing beyond the margin."""
    stands = obstacle(4.0, 0.0, number=6, size_m=(2.4, 1.7))
    assert not len(after(*[(stands,)] * 3).bodies)
    drives = obstacle(4.0, 0.0, 0.0, 1.0, number=6, size_m=(2.4, 1.7))
    bodies = after(*[(drives,)] * 32, (stands,)).bodies
    assert bodies.ids.tolist() == [6]
    assert float(bodies.xy_m[0, 0] - bodies.half_view_m[0]) == pytest.approx(3.9 - (0.63 * 1.2 - 0.25))


def test_body_that_leaves_the_view_is_remembered_wider_than_its_last_strip() -> None:
    """A crate at the edge of the view, of which less and less is in it."""
    crate = obstacle(2.0, 0.9)
    known = after((crate,), (replace(crate, extent_m=np.array([0.02, 1.7, 0.2])),))
    assert known.bodies.ids.tolist() == [5]
    assert known.remembered.tolist() == [True]
    assert known.bodies.half_across_m.tolist() == [0.25]


FREE = free_space()
N = len(FREE.bearing_tan)


@pytest.mark.parametrize(
    "broken",
    [
        replace(FREE, nearest_m=np.full(3, np.inf)),
        replace(FREE, known_m=np.zeros(0)),
        replace(FREE, blank=np.zeros(2, np.bool_)),
        replace(FREE, nearest_m=np.full(N, np.inf, np.float32)),
        replace(FREE, bearing_tan=np.zeros((1, N))),
    ],
)
def test_a_scan_that_does_not_tell_the_same_of_every_band_is_none(broken: FreeSpace) -> None:
    bench = Bench()
    decision = bench.step(bench.scene(free=broken))
    assert decision.target_speed_mps == 0.0
    assert "its bands are not told of alike" in decision.reason.sentence


def test_depth_is_as_noisy_as_the_configuration_says() -> None:
    noise = DepthNoise(quadratic_per_m=0.002)
    config = ReplayConfig(perception=PerceptionConfig(depth_noise=noise))
    known = build_replay_decision(config, MOUNT, None).new_world_model(PATH, 0.0)
    bench = Bench()
    known.update(bench.scene(), PlanarPose(0.0, 0.0, 0.0), START, 0.5, bench.now_ns)
    assert known.surfaces.noise == noise


@pytest.mark.parametrize("unknown", [PlanarPose(np.nan, 0.0, 0.0), PlanarPose(0.0, 0.0, np.inf)])
def test_scene_without_a_known_pose_is_not_taken_in(unknown: PlanarPose) -> None:
    bench = Bench()
    bench.settle()
    decision = bench.step(replace(bench.scene(), robot_pose=unknown))
    assert decision.target_speed_mps == 0.0
    assert "the robot's pose at the time of the scene is not known" in decision.reason.sentence


@pytest.mark.parametrize(("fps", "period_s"), [(15.0, 1.0 / 15.0), (None, 1.0 / 30.0)])
def test_the_decision_of_a_replay_has_the_period_of_its_recording(fps: float | None, period_s: float) -> None:
    maker = build_replay_decision(ReplayConfig(), MOUNT, fps)
    assert maker._latency_s == pytest.approx(period_s + DecisionConfig().chassis_delay_s)
