"""Obstacles that cross the path: from either side at any angle, from behind a shelf, in crowds, in bends."""

from __future__ import annotations

import math

from config.scenario import BodySpec, Column, Crate, Scenario, Shelf
from sim.families.layout import (
    BLEND_M,
    RACK_DEPTH_M,
    Random,
    bend_path,
    drive,
    earliest_arrival_s,
    go,
    person,
    racks,
    random_side,
    robot,
    scenario,
    walk,
)

_START_OFFSET_M = 3.6  # beside the path, where whoever crosses starts and ends: behind the racks
_GAP_MARGIN_M = 1.3  # room beside its way in the gap between the racks; another robot is about 1 m long


def crossing_left(random: Random) -> Scenario:
    """Somebody crosses from the left, at 30 to 150 degrees to the path."""
    return _crossing(random, "crossing_left", 1.0)


def crossing_right(random: Random) -> Scenario:
    """Somebody crosses from the right, at 30 to 150 degrees to the path."""
    return _crossing(random, "crossing_right", -1.0)


def _crossing(random: Random, name: str, side: float) -> Scenario:
    length = float(random.uniform(12.0, 15.0))
    x, angle = float(random.uniform(5.0, 9.0)), math.radians(float(random.uniform(30.0, 150.0)))
    body, gap = _crosser(random, "crosser", x, side, angle, float(random.uniform(-3.0, 4.0)))
    return scenario(name, length, (*racks(random, length, (gap,)), body))


def _crosser(
    random: Random, name: str, x_m: float, side: float, angle_rad: float, delay_s: float
) -> tuple[BodySpec, tuple[float, float]]:
    """A body that is on the path at x_m, delay_s after the earliest time at which the robot could be there;
    and the interval along the aisle that must be free of racks. angle_rad: between the body's way and the
    path."""
    is_robot = bool(random.integers(3) == 0)
    speed = float(random.uniform(0.5, 1.0) if is_robot else random.uniform(0.6, 1.5))
    shift = _START_OFFSET_M / math.tan(angle_rad)
    start, end = (x_m - shift, side * _START_OFFSET_M), (x_m + shift, -side * _START_OFFSET_M)
    approach_s = _START_OFFSET_M / math.sin(angle_rad) / speed
    start_s = earliest_arrival_s(x_m) + delay_s - approach_s
    if start_s < 0.0:
        # It would have to start before time zero, so it begins part of the way in.
        skipped = min(-start_s / approach_s, 0.45)
        start = (x_m - shift * (1.0 - skipped), side * _START_OFFSET_M * (1.0 - skipped))
    gap = (x_m - abs(shift) - _GAP_MARGIN_M, x_m + abs(shift) + _GAP_MARGIN_M)
    if is_robot:
        return robot(random, name, start, drive(start_s, go(*end, speed))), gap
    return person(random, name, start, walk(start_s, go(*end, speed))), gap


def behind_shelf(random: Random) -> Scenario:
    """Somebody steps out from behind the end of a shelf that stands close to the path."""
    length = float(random.uniform(12.0, 15.0))
    side = random_side(random)
    corner_x = float(random.uniform(5.0, 8.0))
    inner = float(random.uniform(0.85, 1.4))
    speed = float(random.uniform(0.6, 1.4))
    x = corner_x + float(random.uniform(0.5, 0.9))
    long_m = corner_x + 4.0
    shelf = Shelf(
        kind="shelf",
        name="blind corner",
        x_m=corner_x - 0.5 * long_m,
        y_m=side * (inner + 0.5 * RACK_DEPTH_M),
        length_m=long_m,
        width_m=RACK_DEPTH_M,
    )
    start_y = inner + RACK_DEPTH_M + 0.8
    on_path_s = earliest_arrival_s(x - 2.0) + float(random.uniform(-1.0, 3.0))
    motion = walk(on_path_s - start_y / speed, go(x, -side * _START_OFFSET_M, speed))
    obstacle = person(random, "person", (x, side * start_y), motion)
    pillar = Column(kind="column", name="pillar", x_m=corner_x + 3.0, y_m=-side * 2.2)
    return scenario("behind_shelf", length, (shelf, pillar, obstacle))


def crowd_junction(random: Random) -> Scenario:
    """Four to seven bodies cross a junction of two aisles, from both sides, one after the other."""
    length = float(random.uniform(13.0, 16.0))
    bodies: list[BodySpec] = []
    for number in range(int(random.integers(4, 8))):
        side = random_side(random)
        x, angle = float(random.uniform(6.0, 9.0)), math.radians(float(random.uniform(75.0, 105.0)))
        delay_s = 1.6 * number - 3.0 + float(random.uniform(-0.8, 0.8))
        body, _ = _crosser(random, f"crosser {number + 1}", x, side, angle, delay_s)
        bodies.append(body)
    return scenario("crowd_junction", length, (*racks(random, length, ((3.8, 11.2),)), *bodies))


def curved_path(random: Random) -> Scenario:
    """A bend with crates on both sides, and for most seeds somebody who crosses after the bend."""
    radius, turn = float(random.uniform(3.0, 7.0)), random_side(random) * float(random.uniform(40.0, 90.0))
    before, after = float(random.uniform(3.0, 5.0)), float(random.uniform(4.0, 6.0))
    path, room = bend_path(before, radius, turn, after)
    left = math.copysign(1.0, turn)
    bend = math.radians(abs(turn))
    # The geometry of the circle without the blends, which is accurate enough to place bodies beside it.
    exit_x, exit_y = before + 0.5 * BLEND_M + radius * math.sin(bend), left * radius * (1.0 - math.cos(bend))
    out_x, out_y = math.cos(bend), left * math.sin(bend)
    bodies: list[BodySpec] = [
        Crate(
            kind="crate",
            name="crate inside",
            x_m=before + 0.5 * BLEND_M + radius * math.sin(0.5 * bend) - 1.5 * math.sin(0.5 * bend),
            y_m=left * (radius - (radius - 1.6) * math.cos(0.5 * bend)),
            heading_deg=math.degrees(left * 0.5 * bend),
        ),
        Crate(
            kind="crate",
            name="crate outside",
            x_m=before + 0.5 * BLEND_M + (radius + 1.7) * math.sin(0.6 * bend),
            y_m=left * (radius - (radius + 1.7) * math.cos(0.6 * bend)),
            heading_deg=math.degrees(left * 0.6 * bend),
        ),
    ]
    if random.random() < 0.7:
        along = float(random.uniform(1.0, after - 1.5))
        x, y = exit_x + along * out_x, exit_y + along * out_y
        side = random_side(random)
        away_x, away_y = -out_y * side * _START_OFFSET_M, out_x * side * _START_OFFSET_M
        speed = float(random.uniform(0.6, 1.4))
        on_path_s = earliest_arrival_s(before + radius * bend + along) + float(random.uniform(-2.0, 3.0))
        motion = walk(on_path_s - _START_OFFSET_M / speed, go(x - away_x, y - away_y, speed))
        bodies.append(person(random, "person", (x + away_x, y + away_y), motion))
    return scenario("curved_path", 0.0, tuple(bodies), path=path, room=room)
