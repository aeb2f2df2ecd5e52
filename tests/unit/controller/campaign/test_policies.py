from __future__ import annotations

import math

import numpy as np
import pytest

from config.scenario import Beam, Pallet
from controller.campaign.paper_rule import PaperRule
from controller.campaign.planar_scan import PlanarScanner
from controller.campaign.protective_field import ProtectiveField
from controller.campaign.zone_monitor import ZoneMonitor
from controller.decision.decision import Action, Decision
from controller.decision.situation import Situation
from controller.path.path import OnPath
from hal.geometry import mount_of
from hal.types import FloatArray, PlanarPose
from tests.support import scenes
from tests.support.campaign import CONFIG, crate, stage
from vision.scene import Scene

ROBOT = CONFIG.robot
START = PlanarPose(0.0, 0.0, 0.0)
FRONT = ROBOT.body.front_m


def wall_of_points(x_m: float, count: int = 10, half_m: float = 0.3) -> FloatArray:
    return np.stack((np.full(count, x_m), np.linspace(-half_m, half_m, count)), axis=1)


def test_the_papers_detection_distance() -> None:
    """1.5 m/s, 0.3 m/s2, V_o = 1.5 m/s: S_n = 3.75 + 1.5 * 5 = 11.25 m, as the paper says."""
    rule = PaperRule(ROBOT, mount_of(ROBOT))
    assert rule.detection_distance(1.5, 1.5) == pytest.approx(11.25 + 0.1)
    assert rule.detection_distance(0.6, 0.0) == pytest.approx(0.6 + 0.1)
    assert rule.detection_distance(0.6, -1.0) == pytest.approx(0.6 + 0.1)


def paper(scene: Scene | None, v_mps: float) -> Decision:
    made = stage(length_m=20.0)
    return PaperRule(ROBOT, mount_of(ROBOT)).step(
        Situation(scene, made.path, START, OnPath(0.0, 0.0, 0.0), v_mps, 0.0, 0)
    )


def test_the_paper_brakes_for_what_is_inside_its_distance_only() -> None:
    """Its front is 4 m before the camera: 4 - 0.06 m before the robot's front; S_n(1.5, 0) is 3.85 m."""
    seen = scenes.scene(obstacles=(scenes.obstacle(position_m=(0.0, 0.0, 4.15)),))
    assert paper(seen, 1.4).action is Action.INCREASE
    nearer = scenes.scene(obstacles=(scenes.obstacle(position_m=(0.0, 0.0, 3.8)),))
    assert paper(nearer, 1.5).target_speed_mps == 0.0
    coming = scenes.scene(
        obstacles=(scenes.obstacle(position_m=(0.0, 0.0, 8.0), velocity_mps=(0.0, 0.0, -1.5), moving=True),)
    )
    assert paper(coming, 1.5).target_speed_mps == 0.0
    beside = scenes.scene(obstacles=(scenes.obstacle(position_m=(1.0, 0.0, 3.0)),))
    assert paper(beside, 1.5).target_speed_mps > 0.0


def test_the_paper_waits_for_a_first_scene() -> None:
    assert paper(None, 0.0).target_speed_mps == 0.0


@pytest.mark.parametrize(
    ("x_m", "expected", "rule"),
    [
        (FRONT + 0.05, 0.0, "stop polygon"),
        (FRONT + 0.09 + 5.0, 1.0, "free"),
    ],
)
def test_nav2_slows_by_the_zone_that_four_points_are_in(x_m: float, expected: float, rule: str) -> None:
    assert ZoneMonitor(ROBOT, stage()).limit(wall_of_points(x_m), 1.0, 0.0) == (expected, rule)


def test_nav2_slows_to_three_tenths_beside_something() -> None:
    """Four points 0.1 m beside the robot: in the slowdown polygon, never in its way."""
    beside = np.stack((np.linspace(-0.4, 0.4, 4), np.full(4, 0.39 + 0.1)), axis=1)
    target, rule = ZoneMonitor(ROBOT, stage()).limit(beside, 1.0, 0.0)
    assert target == pytest.approx(0.3)
    assert rule == "slowdown polygon"
    assert ZoneMonitor(ROBOT, stage()).limit(beside[:3], 1.0, 0.0) == (1.0, "free")


def test_nav2_approach_is_speed_times_time_before_collision() -> None:
    """1.05 m before the front at 1 m/s: the pose at 1.1 s is the first inside, counted as 1.0 s."""
    points = wall_of_points(FRONT + 1.05)
    monitor = ZoneMonitor(ROBOT, stage())
    assert monitor.collision_time(points, 1.0, 0.0) == pytest.approx(1.0)
    target, rule = monitor.limit(points, 1.0, 0.0)
    assert target == pytest.approx(0.5)
    assert rule == "approach"
    assert monitor.collision_time(points[:5], 1.0, 0.0) == 2.0
    assert monitor.collision_time(wall_of_points(FRONT + 2.05), 1.0, 0.0) == 2.0
    assert monitor.collision_time(wall_of_points(0.3), 1.0, 0.0) == 0.0


def test_nav2_looks_along_its_arc() -> None:
    """On a turn of 1 m to the left, points at its end are hit and points straight ahead are not."""
    monitor = ZoneMonitor(ROBOT, stage())
    aside = np.stack((np.linspace(0.7, 1.3, 10), np.full(10, 1.3)), axis=1)
    assert monitor.collision_time(aside, 1.0, 1.0) < 2.0
    assert monitor.collision_time(wall_of_points(2.6, half_m=0.1), 1.0, 1.0) == 2.0


def test_the_protective_fields_length() -> None:
    """1 m/s: S_Br = 1 / 1.4 + 0.7 / 4 m, 0.2 s response, 0.1 m tolerance, 0.15 m for a low base."""
    field = ProtectiveField(ROBOT, stage())
    assert field.length(1.0) == pytest.approx(1.0 / 1.4 + 0.7 / 4.0 + 0.2 + 0.1 + 0.15)
    assert field.length(0.0) == pytest.approx(0.25)


def test_the_protective_field_stops_and_restarts_two_seconds_after_it_is_free() -> None:
    length = ProtectiveField(ROBOT, stage()).length(1.0)
    made = stage(crate(FRONT + length + 0.2, size_m=0.6), length_m=20.0)
    field = ProtectiveField(ROBOT, made)

    def step(s_m: float, v_mps: float, t_s: float) -> Decision:
        pose, on_path = PlanarPose(s_m, 0.0, 0.0), OnPath(s_m, 0.0, 0.0)
        return field.step(Situation(None, made.path, pose, on_path, v_mps, 0.0, round(t_s * 1e9)))

    # The crate's near side is 0.1 m inside the field of 1 m/s, and outside that of 0.5 m/s.
    assert step(0.0, 0.5, 0.0).target_speed_mps > 0.0
    stopping = step(0.0, 1.0, 0.1)
    assert (stopping.target_speed_mps, stopping.emergency) == (0.0, True)
    assert step(-5.0, 0.0, 0.3).target_speed_mps == 0.0
    assert step(-5.0, 0.0, 2.2).target_speed_mps == 0.0
    assert step(-5.0, 0.0, 2.4).target_speed_mps > 0.0


def test_the_scanner_is_exact() -> None:
    points = PlanarScanner(stage(crate(5.0, size_m=1.0))).points(START, 0.0)
    ahead = points[np.abs(points[:, 1]) < 0.45]
    ahead = ahead[(ahead[:, 0] > 0.0) & (ahead[:, 0] < 6.0)]
    assert len(ahead) > 5
    assert ahead[:, 0] == pytest.approx(4.5)


def test_the_scanner_sees_its_own_height_only() -> None:
    low = Pallet(kind="pallet", name="pallet", x_m=5.0, y_m=0.0)
    high = Beam(kind="beam", name="beam", x_m=5.0, y_m=0.0, z_m=0.6, heading_deg=90.0)
    assert len(PlanarScanner(stage(low, high)).points(START, 0.0)) == 0


def test_between_two_scans_the_points_move_with_the_robot() -> None:
    scanner = PlanarScanner(stage(crate(5.0, size_m=1.0)))
    first = scanner.points(START, 0.0)
    later = scanner.points(PlanarPose(0.05, 0.0, 0.0), 0.04)
    assert later == pytest.approx(first - np.array([0.05, 0.0]))
    turned = scanner.points(PlanarPose(0.0, 0.0, math.pi / 2), 0.05)
    assert turned == pytest.approx(np.stack((first[:, 1], -first[:, 0]), axis=1))
