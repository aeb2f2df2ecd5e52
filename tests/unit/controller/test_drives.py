"""Whole drives without a renderer: decision, shaper and path follower against things of known motion."""

from __future__ import annotations

import numpy as np
import pytest

from config.path import LineSpec, PathSpec
from config.robot import Robot
from controller.path.path import Path
from tests.support.closed_loop import (
    Box,
    Log,
    Mission,
    Noise,
    Trajectory,
    bend,
    optimum_s,
    reversals,
    standing_at,
    walking,
)
from tests.support.floor_bodies import line_path
from vision.scene import Scene

# Of the chassis, and one control step.
REACTION_S = 0.22
REAL = Noise(depth_1pm=0.0075, velocity_mps=0.1)


def slow_end(before_m: float, slow_mps: float) -> Path:
    """A line, and a metre more at slow_mps."""
    last = LineSpec(kind="line", length_m=1.0, max_speed_mps=slow_mps)
    return Path(PathSpec(segments=(LineSpec(kind="line", length_m=before_m), last)), Robot())


def slow_start(slow_m: float, slow_mps: float) -> Path:
    first = LineSpec(kind="line", length_m=slow_m, max_speed_mps=slow_mps)
    return Path(PathSpec(segments=(first, LineSpec(kind="line", length_m=12.0))), Robot())


def limits_hold(log: Log) -> bool:
    a = np.array([0.0, *log.a_mps2])
    return bool(
        min(log.v_mps) >= 0.0
        and max(log.v_mps) <= 1.5 + 1e-6
        and a.max() <= 0.3 + 1e-6
        and a.min() >= -0.7 - 1e-6
        and np.abs(np.diff(a)).max() <= 2.0 * 0.02 + 1e-6
    )


def drive(mission: Mission, seconds: float = 60.0) -> Log:
    log = mission.run(seconds)
    assert limits_hold(log)
    assert reversals(log) < 3
    # Standing when something walks into it is all that it can promise.
    speed = np.array([0.0, *log.v_mps[:-1]])
    assert not np.any((np.array(log.clearance_m) <= 0.0) & (speed > 0.02))
    return log


def test_an_empty_path_takes_no_more_than_one_per_cent_longer_than_the_optimum() -> None:
    mission = Mission(line_path(40.0), [], lag_s=0.02)
    drive(mission)
    assert mission.reached
    # 0.06 s pass until the first scene is there.
    assert mission.t - 0.06 <= 1.01 * optimum_s(mission.path, mission)


@pytest.mark.parametrize("before_m", [1.0, 3.0, 8.0])
@pytest.mark.parametrize("slow_mps", [0.1, 0.3])
def test_a_slow_section_is_entered_slowly_also_by_who_still_accelerates(
    before_m: float, slow_mps: float
) -> None:
    log = drive(Mission(slow_end(before_m, slow_mps), []))
    speeds = np.array(log.v_mps)
    inside = np.array(log.s_m) >= before_m
    assert speeds[inside].max() <= slow_mps + 1e-3
    # Nor is it crept up to.
    assert speeds[~inside].max() > min(slow_mps, 0.3)


def test_no_slow_section_is_left_before_its_end() -> None:
    """Faster beyond: the acceleration begins there."""
    mission = Mission(slow_start(1.5, 0.4), [])
    log = drive(mission)
    # What is commanded now acts a little later; speeds are kept every 5 cm.
    inside = np.array(log.s_m) < 1.5 - 0.05 - 0.4 * REACTION_S
    assert np.array(log.v_mps)[inside].max() <= 0.4 + 1e-3
    assert max(log.v_mps) > 1.0


def test_a_crate_beside_the_path_costs_at_most_two_per_cent() -> None:
    empty, beside = (
        Mission(line_path(25.0), []),
        Mission(line_path(25.0), [Box(standing_at(12.0, -1.0), 0.6, 0.5, 0.6)], REAL),
    )
    drive(empty)
    drive(beside)
    assert beside.t <= 1.02 * empty.t


@pytest.mark.parametrize("noise", [Noise(), REAL])
def test_a_crate_on_the_path_is_stopped_before_comfortably(noise: Noise) -> None:
    mission = Mission(line_path(15.0), [Box(standing_at(8.0, 0.0), 0.6, 0.6, 0.6)], noise)
    log = drive(mission, 20.0)
    assert log.v_mps[-1] == 0.0
    assert 0.3 <= log.clearance_m[-1] <= 0.6
    assert not any(decision.emergency for decision in log.decisions)
    assert log.decisions[-1].stuck_since_ns is not None


def test_a_low_pallet_that_sinks_below_the_view_is_not_touched() -> None:
    mission = Mission(line_path(15.0), [Box(standing_at(8.0, 0.1), 1.2, 0.8, 0.15)], REAL)
    log = drive(mission, 30.0)
    assert log.v_mps[-1] == 0.0
    assert log.clearance_m[-1] > 0.3


@pytest.mark.parametrize("seen_by_edges", [True, False])
@pytest.mark.parametrize("wide_m", [1.2, 3.0])
def test_a_sill_below_the_view_is_not_forgotten_while_the_robot_stands_before_it(
    wide_m: float, seen_by_edges: bool
) -> None:
    """It is below the view long before the robot comes to rest; too wide or too plain to be an obstacle."""
    sill = Box(standing_at(8.0, 0.0), 0.2, wide_m, 0.15, seen_by_edges=seen_by_edges)
    log = drive(Mission(line_path(15.0), [sill], REAL), 40.0)
    assert log.v_mps[-1] == 0.0
    assert log.clearance_m[-1] > 0.3


def test_a_plain_wall_is_stopped_before_by_depth_alone() -> None:
    wall = Box(standing_at(9.0, 0.0), 0.2, 5.0, 3.0, seen_by_edges=False)
    log = drive(Mission(line_path(15.0), [wall], REAL), 20.0)
    assert log.v_mps[-1] == 0.0
    assert 0.3 <= log.clearance_m[-1] <= 0.7


@pytest.mark.parametrize(
    ("where", "slowest"),
    [
        (walking(9.0, 4.0, 0.0, -1.2, 2.0), 0.4),
        (walking(8.0, 3.0, 0.0, -0.6, 2.0), 0.2),
        (walking(7.0, -3.5, 0.4, 0.9, 1.0), 0.4),
    ],
)
def test_a_crossing_person_is_let_pass(where: Trajectory, slowest: float) -> None:
    mission = Mission(line_path(18.0), [Box(where)], REAL)
    log = drive(mission)
    assert mission.reached
    assert min(log.v_mps[100:600]) >= slowest
    assert min(log.clearance_m) > 0.3


def test_a_person_who_stops_on_the_path_is_waited_for_and_then_it_goes_again() -> None:
    def where(t_s: float) -> tuple[float, float]:
        return 8.0, 3.0 - min(max(t_s - 2.0, 0.0), 2.7) * 1.1 - max(t_s - 14.0, 0.0) * 1.1

    mission = Mission(line_path(15.0), [Box(where)], REAL)
    log = drive(mission)
    assert mission.reached
    assert min(log.v_mps[300:]) == 0.0
    assert min(log.clearance_m) > 0.2


def test_an_oncoming_person_finds_it_standing() -> None:
    person = Box(walking(18.0, 0.0, -1.2, 0.0, 0.0, 8.0))
    log = drive(Mission(line_path(25.0), [person], REAL), 20.0)
    nearest = int(np.argmin(log.clearance_m))
    assert log.v_mps[nearest] == 0.0


def test_a_leader_that_brakes_hard_is_not_touched() -> None:
    def where(t_s: float) -> tuple[float, float]:
        return 4.0 + 0.8 * min(t_s, 9.0) + 0.8 * max(t_s - 15.0, 0.0), 0.0

    mission = Mission(line_path(18.0), [Box(where)], REAL)
    log = drive(mission)
    assert mission.reached
    assert min(log.clearance_m) > 0.2


def test_a_bend_with_a_crate_behind_it() -> None:
    path = bend(3.0, 90.0)
    end = path.pose(path.length_m - 2.0)
    mission = Mission(path, [Box(standing_at(end.x_m, end.y_m), 0.6, 0.6, 0.8)], REAL, yaw_ratio=0.9)
    log = drive(mission, 40.0)
    assert log.v_mps[-1] == 0.0
    assert log.clearance_m[-1] > 0.2
    assert max(abs(d) for d in log.offset_m) < 0.05


def test_a_camera_that_falls_silent_leads_to_a_stop_at_first_by_comfort() -> None:
    """For 0.6 s the last look will do; after that somebody may have come whom nobody saw."""

    def silent(scene: Scene, t_s: float) -> Scene | None:
        return scene if t_s < 6.0 or t_s > 14.0 else None

    mission = Mission(line_path(20.0), [], alter=silent)
    log = drive(mission)
    assert mission.reached
    assert log.v_mps[round(13.5 / 0.02)] == 0.0
    assert "old" in log.decisions[round(13.5 / 0.02)].reason.sentence
    still_known = round(6.5 / 0.02)
    assert -0.3 - 1e-6 <= min(log.a_mps2[:still_known]) < -0.05
    assert min(log.a_mps2) == pytest.approx(-0.7, abs=1e-6)
