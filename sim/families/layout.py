"""Common parts of all families: an aisle along x, racks on both sides, people and robots.

The robot starts at the origin and drives along x. Its size and speed are the defaults of config/robot.py.
"""

from __future__ import annotations

import math

import numpy as np

from config.path import ArcSpec, LineSpec, PathSpec
from config.scenario import (
    BodySpec,
    Go,
    MotionPlan,
    Person,
    RobotBody,
    Room,
    Scenario,
    Shelf,
    Step,
    Texture,
    Wait,
)

Random = np.random.Generator

FRONT_M, HALF_WIDTH_M = 0.51, 0.39  # of the robot, from its turning centre
# Upper bounds of the robot's speed and acceleration, without delay and jerk limit.
_TOP_MPS, _ACCEL_MPS2 = 1.5, 0.3
RACK_DEPTH_M = 1.1  # a pallet of 1.2 m is stored with some overhang
BLEND_M = 0.8  # length of the blend at either end of a bend
_DURATION_S = 70.0  # the longest aisle takes half of it without obstacles
_BAY_M = 2.7  # a bay of a pallet rack: three pallets of 0.8 m side by side


def max_travel_m(t_s: float) -> float:
    """The furthest that the robot can have come at t_s."""
    accelerating_s = min(max(t_s, 0.0), _TOP_MPS / _ACCEL_MPS2)
    return 0.5 * _ACCEL_MPS2 * accelerating_s**2 + _TOP_MPS * max(t_s - _TOP_MPS / _ACCEL_MPS2, 0.0)


def earliest_arrival_s(x_m: float) -> float:
    """The earliest time at which the robot's turning centre can be at x_m."""
    accelerating_m = 0.5 * _TOP_MPS**2 / _ACCEL_MPS2
    if x_m <= accelerating_m:
        return math.sqrt(2.0 * max(x_m, 0.0) / _ACCEL_MPS2)
    return _TOP_MPS / _ACCEL_MPS2 + (x_m - accelerating_m) / _TOP_MPS


def straight(length_m: float) -> PathSpec:
    """A straight path along x from the origin."""
    return PathSpec(segments=(LineSpec(kind="line", length_m=length_m),))


def bend_path(before_m: float, radius_m: float, turn_deg: float, after_m: float) -> tuple[PathSpec, Room]:
    """A path from the origin along x, round a bend and on; and a building around it."""
    path = PathSpec(
        segments=(
            LineSpec(kind="line", length_m=before_m),
            ArcSpec(kind="arc", radius_m=radius_m, angle_deg=turn_deg, blend_m=BLEND_M),
            LineSpec(kind="line", length_m=after_m),
        )
    )
    reach_m = before_m + radius_m + after_m + 6.0
    return path, Room(x_min_m=-6.0, x_max_m=reach_m, y_min_m=-reach_m, y_max_m=reach_m)


def hall(length_m: float, half_width_m: float = 5.0) -> Room:
    """A building around an aisle."""
    return Room(x_min_m=-6.0, x_max_m=length_m + 8.0, y_min_m=-half_width_m, y_max_m=half_width_m)


def racks(random: Random, length_m: float, gaps_m: tuple[tuple[float, float], ...] = ()) -> tuple[Shelf, ...]:
    """Racks along both sides of the aisle, except in gaps_m (from, to), which leave room to cross."""
    shelves = []
    for side in (1.0, -1.0):
        inner_m = float(random.uniform(1.75, 2.4))
        x = float(random.uniform(-4.0, -2.0))
        number = 0
        while x < length_m + 3.0:
            length = _BAY_M * int(random.integers(1, 4))
            blocking_gaps = [gap for gap in gaps_m if gap[0] < x + length and gap[1] > x]
            if blocking_gaps:
                length = blocking_gaps[0][0] - x
            if length > 0.8:
                number += 1
                shelves.append(
                    Shelf(
                        kind="shelf",
                        name=f"rack {'left' if side > 0 else 'right'} {number}",
                        x_m=x + 0.5 * length,
                        y_m=side * (inner_m + 0.5 * RACK_DEPTH_M),
                        length_m=length,
                        width_m=RACK_DEPTH_M,
                    )
                )
            x = blocking_gaps[0][1] if blocking_gaps else x + length + float(random.choice([0.0, 0.0, 1.2]))
    return tuple(shelves)


def person(random: Random, name: str, start: tuple[float, float], motion: MotionPlan | None) -> Person:
    """A person of random height who stands at start and faces the direction of the first step."""
    return Person(
        kind="person",
        name=name,
        x_m=start[0],
        y_m=start[1],
        heading_deg=_first_heading_deg(start, motion),
        height_m=float(random.uniform(1.55, 1.95)),
        motion=motion,
    )


def robot(random: Random, name: str, start: tuple[float, float], motion: MotionPlan | None) -> RobotBody:
    """Another transport robot, with a load for half of the seeds."""
    return RobotBody(
        kind="robot",
        name=name,
        x_m=start[0],
        y_m=start[1],
        heading_deg=_first_heading_deg(start, motion),
        load_height_m=float(random.choice([0.0, 0.5])),
        motion=motion,
    )


def _first_heading_deg(start: tuple[float, float], motion: MotionPlan | None) -> float:
    first = None if motion is None else next((step for step in motion.steps if isinstance(step, Go)), None)
    if first is None:
        return 180.0
    return math.degrees(math.atan2(first.y_m - start[1], first.x_m - start[0]))


def walk(start_s: float, *steps: Step) -> MotionPlan:
    """A motion plan with the acceleration and turn rate of people."""
    return MotionPlan(start_s=max(start_s, 0.0), steps=steps)


def drive(start_s: float, *steps: Step, accel_mps2: float = 0.8) -> MotionPlan:
    """A motion plan with the acceleration and turn rate of transport robots."""
    return MotionPlan(start_s=max(start_s, 0.0), accel_mps2=accel_mps2, turn_rate_degps=60.0, steps=steps)


def go(x_m: float, y_m: float, speed_mps: float) -> Go:
    """A step straight to a point."""
    return Go(kind="go", x_m=x_m, y_m=y_m, speed_mps=speed_mps)


def wait(duration_s: float) -> Wait:
    """A step of standing still."""
    return Wait(kind="wait", duration_s=duration_s)


def random_side(random: Random) -> float:
    """A random side: 1 for the left, -1 for the right."""
    return float(random.choice([1.0, -1.0]))


def random_texture(random: Random, *choices: Texture) -> Texture:
    """One of these textures, at random."""
    return choices[int(random.integers(len(choices)))]


def scenario(
    name: str,
    length_m: float,
    bodies: tuple[BodySpec, ...],
    *,
    blocked: bool = False,
    path: PathSpec | None = None,
    room: Room | None = None,
) -> Scenario:
    """A world. blocked: something never leaves the path."""
    return Scenario(
        name=name,
        duration_s=_DURATION_S,
        outcome="blocked" if blocked else "target",
        path=path or straight(length_m),
        room=room or hall(length_m),
        bodies=bodies,
    )
