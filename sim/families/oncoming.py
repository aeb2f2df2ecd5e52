"""Obstacles that come towards the robot, along its path or close beside it."""

from __future__ import annotations

from config.scenario import Scenario, Step
from sim.families.layout import (
    HALF_WIDTH_M,
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

# Beside the path, where people and robots go past: 0.76 m from the robot's side.
_LANE_OFFSET_M = 1.15


def head_on_person(random: Random) -> Scenario:
    """A person walks towards the robot in the middle of its path and steps aside before they meet."""
    length = float(random.uniform(12.0, 15.0))
    speed = float(random.uniform(0.7, 1.4))
    aside_x, start_s = _choose_turnoff(random, length + 1.0, speed, 1.0)
    side = random_side(random)
    motion = walk(
        start_s,
        go(aside_x, float(random.uniform(-0.2, 0.2)), speed),
        go(aside_x - 1.2, side * _LANE_OFFSET_M, speed),
        go(-4.5, side * _LANE_OFFSET_M, speed),
    )
    obstacle = person(random, "person", (length + 1.0, float(random.uniform(-0.3, 0.3))), motion)
    return scenario("head_on_person", length, (*racks(random, length), obstacle))


def head_on_robot(random: Random) -> Scenario:
    """Another robot comes towards the robot on the same path and turns off into a gap between the racks."""
    length = float(random.uniform(13.0, 16.0))
    speed = float(random.uniform(0.5, 1.0))
    # Turning on the spot takes time: 90 degrees at 60 degrees a second, and stopping before that.
    turn_x, start_s = _choose_turnoff(random, length + 1.0, speed, 4.5)
    motion = drive(start_s, go(turn_x, 0.0, speed), go(turn_x, random_side(random) * 4.0, speed))
    other = robot(random, "robot", (length + 1.0, 0.0), motion)
    return scenario("head_on_robot", length, (*racks(random, length, ((turn_x - 1.2, turn_x + 1.2),)), other))


def _choose_turnoff(
    random: Random, from_x_m: float, speed_mps: float, clearing_s: float
) -> tuple[float, float]:
    """(x, start time) for a body that has left the path clearing_s after it reached x, and that no robot can
    have met before."""
    start_s = float(random.uniform(0.0, 2.0))
    x = from_x_m - 2.0
    while x > 4.5 and max_travel_m(start_s + (from_x_m - (x - 0.5)) / speed_mps + 0.5) + 1.6 < x - 0.5:
        x -= 0.5
    x += float(random.uniform(0.0, 1.0))
    # The start is a little earlier if leaving the path takes long, so that the robot need not stand for long:
    # that would be another family.
    return x, max(start_s - 0.2 * clearing_s, 0.0)


def group(random: Random) -> Scenario:
    """Three to five people together, some of them on the path, who part before the robot."""
    length = float(random.uniform(12.0, 15.0))
    speed = float(random.uniform(0.7, 1.2))
    aside_x, start_s = _choose_turnoff(random, length + 1.0, speed, 1.0)
    people = []
    for number in range(int(random.integers(3, 6))):
        side = 1.0 if number % 2 else -1.0
        rank = number // 2
        y = side * (0.35 + 0.1 * float(random.random()))
        x = length + 1.0 + 0.9 * rank
        lane = side * (_LANE_OFFSET_M + 0.05)
        people.append(
            person(
                random,
                f"person {number + 1}",
                (x, y),
                walk(
                    start_s,
                    go(aside_x + 0.9 * rank, y, speed),
                    go(aside_x + 0.9 * rank - 1.0, lane, speed),
                    go(-4.0 + 0.9 * rank, lane, speed),
                ),
            )
        )
    return scenario("group", length, (*racks(random, length), *people))


def turns_back(random: Random) -> Scenario:
    """Somebody walks into the path, stops and turns back; for half of the seeds a second time."""
    length = float(random.uniform(12.0, 15.0))
    x = float(random.uniform(6.0, 9.0))
    speed = float(random.uniform(0.6, 1.3))
    side = random_side(random)
    off_path_y, on_path_y = side * float(random.uniform(1.8, 2.6)), side * float(random.uniform(-0.2, 0.35))
    steps: list[Step] = [
        go(x, on_path_y, speed),
        wait(float(random.uniform(0.3, 2.5))),
        go(x + 0.3, off_path_y, speed),
    ]
    if random.integers(2):
        steps += [wait(float(random.uniform(0.5, 2.0))), go(x + 0.3, on_path_y, speed), wait(1.0)]
        steps += [go(x + 0.6, side * 3.5, speed)]
    motion = walk(float(random.uniform(0.5, 4.0)), *steps)
    obstacle = person(random, "person", (x, side * 2.6), motion)
    return scenario("turns_back", length, (*racks(random, length, ((x - 1.3, x + 1.8),)), obstacle))


def grazing(random: Random) -> Scenario:
    """Somebody passes the robot in the opposite direction, with a gap of 3 to 35 cm."""
    length = float(random.uniform(12.0, 15.0))
    side = random_side(random)
    speed = float(random.uniform(0.5, 1.4))
    # Half the robot's width, half of a walking person's (0.33 m at most), and the gap.
    y = side * (HALF_WIDTH_M + 0.33 + float(random.uniform(0.03, 0.35)))
    motion = walk(float(random.uniform(0.0, 3.0)), go(-5.0, y, speed))
    obstacle = person(random, "person", (length + 1.5, y), motion)
    return scenario("grazing", length, (*racks(random, length), obstacle))
