"""Obstacles that go the same way as the robot: ahead of it, past it, or into its path."""

from __future__ import annotations

from config.scenario import BodySpec, Scenario
from sim.families.layout import (
    FRONT_M,
    Random,
    drive,
    go,
    max_travel_m,
    person,
    racks,
    random_side,
    robot,
    scenario,
    wait,
    walk,
)

_LANE_OFFSET_M = 1.2  # beside the path, where they go: 0.8 m from the robot's side


def cut_in(random: Random) -> Scenario:
    """Somebody beside the path turns into it just ahead of the robot, and leaves it again."""
    length = float(random.uniform(14.0, 18.0))
    side = random_side(random)
    speed = float(random.uniform(0.5, 1.1))
    start_x, cut_x = float(random.uniform(1.0, 3.5)), float(random.uniform(4.5, 6.5))
    steps = (
        go(cut_x, side * _LANE_OFFSET_M, speed),
        go(cut_x + 1.2, 0.0, speed),
        go(cut_x + float(random.uniform(3.0, 5.0)), 0.0, speed),
        go(cut_x + 6.5, -side * _LANE_OFFSET_M, speed),
        go(length + 5.0, -side * _LANE_OFFSET_M, speed),
    )
    start = (start_x, side * _LANE_OFFSET_M)
    obstacle: BodySpec
    if random.integers(2):
        obstacle = robot(random, "robot", start, drive(0.0, *steps))
    else:
        obstacle = person(random, "person", start, walk(0.0, *steps))
    return scenario("cut_in", length, (*racks(random, length), obstacle))


def overtaking(random: Random) -> Scenario:
    """Somebody faster passes the robot and, for some of the seeds, goes on ahead in its lane."""
    length = float(random.uniform(14.0, 18.0))
    side = random_side(random)
    speed = float(random.uniform(1.6, 2.0))
    from_x, start_s = -2.5, float(random.uniform(0.0, 3.0))
    merge_x = float(random.uniform(4.0, 10.0))
    # Merge only if the robot cannot be close behind: nobody merges right in front of somebody they just
    # passed.
    passed = max_travel_m(start_s + (merge_x - from_x) / speed + 0.6) + FRONT_M + 1.5 < merge_x
    lane = 0.0 if passed and random.integers(4) else side * _LANE_OFFSET_M
    motion = walk(
        start_s,
        go(merge_x, side * _LANE_OFFSET_M, speed),
        go(merge_x + 1.5, lane, speed),
        go(length + 6.0, lane, speed),
    )
    obstacle = person(random, "person", (from_x, side * _LANE_OFFSET_M), motion)
    return scenario("overtaking", length, (*racks(random, length), obstacle))


def lead_brakes(random: Random) -> Scenario:
    """A robot drives ahead on the same path, brakes, stands for a while and goes on."""
    length = float(random.uniform(14.0, 18.0))
    speed = float(random.uniform(0.5, 1.1))
    stop_x = float(random.uniform(6.0, 9.0))
    start_s, accel_mps2 = float(random.uniform(0.0, 1.0)), float(random.uniform(0.5, 1.0))
    steps = (
        go(stop_x, 0.0, speed),
        wait(float(random.uniform(1.0, 5.0))),
        go(length + 6.0, 0.0, speed),
    )
    motion = drive(start_s, *steps, accel_mps2=accel_mps2)
    lead = robot(random, "lead", (float(random.uniform(2.2, 3.5)), float(random.uniform(-0.1, 0.1))), motion)
    return scenario("lead_brakes", length, (*racks(random, length), lead))
