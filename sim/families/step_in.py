"""A person steps into the robot's path, stands there, and leaves it again: a bag test as a seeded world."""

from __future__ import annotations

import zlib

import numpy as np

from config.faults import Faults
from sim.families.layout import earliest_arrival_s, go, person, racks, random_side, scenario, wait, walk
from sim.families.registry import USUAL_SLIP, Case

_START_OFFSET_M = 3.4  # beside the path, where the person starts and ends: behind the racks
_LENGTH_M = 16.0


def step_in(seed: int) -> Case:
    """The mission for a seed, always the same. The person comes when the fastest possible robot would be 3.5
    to 7 m away."""
    random = np.random.default_rng((zlib.crc32(b"step_in"), seed))
    x = float(random.uniform(8.0, 11.0))
    side, speed = random_side(random), float(random.uniform(1.0, 1.4))
    stand_y = side * float(random.uniform(-0.2, 0.2))
    ahead_m, pause_s = float(random.uniform(3.5, 7.0)), float(random.uniform(9.0, 13.0))
    exit_side = side if random.integers(2) else -side
    start_s = earliest_arrival_s(x - ahead_m) - (_START_OFFSET_M - 0.5) / speed
    motion = walk(
        start_s,
        go(x, stand_y, speed),
        wait(pause_s),
        go(x, exit_side * _START_OFFSET_M, float(random.uniform(0.8, 1.3))),
    )
    body = person(random, "person", (x, side * _START_OFFSET_M), motion)
    shelves = racks(random, _LENGTH_M, ((x - 1.5, x + 1.5),))
    world = scenario(f"step_in-{seed}", _LENGTH_M, (*shelves, body))
    return Case("step_in", seed, world.model_copy(update={"faults": Faults(yaw_slip=USUAL_SLIP)}))
