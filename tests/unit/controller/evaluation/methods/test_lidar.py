"""The lidar: rays by hand, clusters, and what it calls moving."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.scenario import Room
from controller.evaluation.methods.lidar_baseline import LidarTracker
from controller.evaluation.methods.lidar_clusters import find_clusters
from controller.evaluation.methods.lidar_matching import refine
from controller.evaluation.methods.lidar_scan import Lidar, LidarModel, Scan, cast
from controller.evaluation.simulated_set.scripted_drive import MOUNT
from controller.evaluation.types import CALLED_MOVING
from hal.types import FloatArray, PlanarPose
from sim.world import BodyState
from tests.support.evaluation_cases import CAMERA

ROOM = Room(x_min_m=-4.0, x_max_m=8.0, y_min_m=-5.0, y_max_m=5.0)
EXACT = LidarModel(noise_m=0.0)
ORIGIN = PlanarPose(0.0, 0.0, 0.0)


def crate(x_m: float, y_m: float, z_m: tuple[float, float] = (0.0, 1.0), size_m: float = 0.5) -> BodyState:
    half = 0.5 * size_m
    corners = np.array([[half, -half], [half, half], [-half, half], [-half, -half]])
    return BodyState(
        id=1,
        name="crate",
        kind="crate",
        pose=PlanarPose(x_m, y_m, 0.0),
        velocity_mps=np.zeros(2),
        yaw_rate_radps=0.0,
        footprint_m=corners + np.array([x_m, y_m]),
        z_m=z_m,
        moves=True,
        reach_m=size_m,
    )


def ahead_m(scan: Scan) -> float:
    return float(scan.range_m[np.argmin(np.abs(scan.bearings_rad))])


def test_rays_against_segments() -> None:
    wall: FloatArray = np.array([[[2.0, -1.0], [2.0, 1.0]]])
    angles = np.array([0.0, math.atan(0.4), math.atan(0.6), math.pi])
    hits = cast(np.zeros(2), angles, wall)
    assert hits[:2] == pytest.approx([2.0, math.hypot(2.0, 0.8)])
    assert np.isinf(hits[2:]).all()


def test_scan_sees_the_nearest_thing_at_its_height() -> None:
    lidar = Lidar(EXACT, ROOM, seed=1)
    assert ahead_m(lidar.scan(0.0, ORIGIN, [])) == pytest.approx(8.0 - 0.45)
    assert ahead_m(lidar.scan(0.0, ORIGIN, [crate(3.0, 0.0)])) == pytest.approx(2.75 - 0.45)
    assert ahead_m(lidar.scan(0.0, ORIGIN, [crate(3.0, 0.0, z_m=(1.0, 2.0))])) == pytest.approx(7.55)


def test_noise_has_the_stated_size_and_the_seed_repeats_it() -> None:
    noisy = [Lidar(LidarModel(), ROOM, seed=5).scan(0.0, ORIGIN, []).range_m for _ in range(2)]
    exact = Lidar(EXACT, ROOM, seed=5).scan(0.0, ORIGIN, []).range_m
    assert np.array_equal(noisy[0], noisy[1])
    assert np.std(noisy[0] - exact) == pytest.approx(0.03, rel=0.1)


def test_clusters_are_things_and_not_walls() -> None:
    scan = Lidar(EXACT, ROOM, seed=1).scan(0.0, ORIGIN, [crate(3.0, 0.5)])
    clusters = find_clusters(scan)
    assert len(clusters.size_m) == 1
    assert clusters.centre_m[0] == pytest.approx([2.75 + 0.25 - 0.45, 0.5], abs=0.3)
    assert clusters.unoccluded[0]


def test_a_half_hidden_cluster_is_not_whole() -> None:
    scan = Lidar(EXACT, ROOM, seed=1).scan(0.0, ORIGIN, [crate(3.0, 0.4), crate(5.0, 0.1)])
    clusters = find_clusters(scan)
    assert sorted(clusters.unoccluded.tolist()) == [False, True]


def test_matching_finds_the_way_that_slipping_tracks_did_not_tell() -> None:
    bodies = [crate(3.0, 1.5), crate(4.0, -2.0), crate(2.0, -3.0, size_m=1.0)]
    lidar = Lidar(LidarModel(), ROOM, seed=2)
    before = lidar.scan(0.0, ORIGIN, bodies)
    c, s = math.cos(0.05), math.sin(0.05)
    # The body turns about its centre; the sensor, 0.45 m ahead of it, goes by 0.1 m and along the turn.
    now = lidar.scan(0.1, PlanarPose(0.1, 0.02, 0.05), bodies)
    true = np.array([0.1 + 0.45 * (c - 1.0), 0.02 + 0.45 * s, 0.05])
    found = refine(before, now, PlanarPose(true[0] + 0.01, true[1] - 0.01, 0.056))
    assert found.heading_rad == pytest.approx(true[2], abs=0.0015)
    assert [found.x_m, found.y_m] == pytest.approx(true[:2].tolist(), abs=0.006)


def test_matching_keeps_the_guess_where_nothing_comes_back() -> None:
    bearings = EXACT.bearings_rad
    empty = Scan(0.0, bearings, np.full(len(bearings), np.inf))
    guess = PlanarPose(0.1, 0.0, 0.01)
    assert refine(empty, empty, guess) == guess


def drive_and_track(velocity_mps: float, yaw_slip: float) -> list[tuple[float, float, bool]]:
    """(z, speed, moving) of what is ahead in the last frame: the robot turns and slips, a crate crosses."""
    lidar = Lidar(LidarModel(), ROOM, seed=3)
    tracker = LidarTracker(LidarModel(), MOUNT, CAMERA)
    others = [crate(6.0, 2.8, size_m=1.0), crate(5.0, -3.0, size_m=0.8), crate(5.5, 0.8)]
    for index in range(30):
        t_s = index / 15.0
        robot = PlanarPose(0.3 * t_s, 0.0, 0.2 * t_s)
        told = PlanarPose(0.3 * t_s, 0.0, 0.2 * t_s * yaw_slip)
        mover = crate(3.5, -1.0 + velocity_mps * t_s)
        tracker.update(lidar.scan(t_s, robot, [mover, *others]), told)
        answer = tracker.answer(t_s, told)
    return [
        (
            float(one.position_m[2]),
            float(np.hypot(*one.velocity_mps[[0, 2]])),
            one.confidence >= CALLED_MOVING,
        )
        for one in answer.detections
    ]


def test_a_crossing_crate_is_moving_at_its_speed_and_nothing_else_is() -> None:
    moving = [one for one in drive_and_track(1.0, yaw_slip=1.1) if one[2]]
    assert len(moving) == 1
    assert moving[0][1] == pytest.approx(1.0, abs=0.15)


def test_slip_in_a_static_scene_makes_nothing_move() -> None:
    seen = drive_and_track(0.0, yaw_slip=1.2)
    assert len(seen) >= 2
    assert not any(moving for _, _, moving in seen)


def test_height_is_not_measured() -> None:
    lidar = Lidar(EXACT, ROOM, seed=1)
    tracker = LidarTracker(EXACT, MOUNT, CAMERA)
    tracker.update(lidar.scan(0.0, ORIGIN, [crate(3.0, 0.0)]), ORIGIN)
    position = tracker.answer(0.0, ORIGIN).detections[0].position_m
    assert math.isnan(position[1])
    assert position[2] == pytest.approx(3.0 - 0.45, abs=0.3)
