"""A check before a simulated drive: a world in which the robot cannot drive is refused."""

from __future__ import annotations

import numpy as np

from config.app import AppConfig
from config.loader import ConfigError
from config.scenario import Room
from controller.build import build_path, build_world, path_spec
from controller.path.path import Path
from sim.contact import BUILDING, nearest_body

_LOOKED_AT_EVERY_M = 0.1


def require_possible_world(config: AppConfig) -> None:
    """The robot must be free where it starts, and its path must stay in the room.

    Raises ConfigError, PathError. A governed robot drives no path, so only its start is checked.
    """
    if config.simulation is None:
        return
    where, _ = path_spec(config)
    path = build_path(config)
    world = build_world(config)
    start = f"{where}: path.start: at x {path.start.x_m:g}, y {path.start.y_m:g}"
    room = world.scenario.room
    if not room.contains(path.start.x_m, path.start.y_m):
        raise ConfigError(f"{start} the robot stands outside of the room, {room.in_words}; move it in")
    nearest = nearest_body(world, config.robot.body, path.start, 0.0)
    if nearest.touches:
        what = "a wall of the room" if nearest.name == BUILDING else f"the body {nearest.name!r}"
        raise ConfigError(f"{start} the robot already touches {what}; move either of them")
    if config.governor is None:
        _require_path_in(room, path, where)


def _require_path_in(room: Room, path: Path, where: str) -> None:
    count = round(path.length_m / _LOOKED_AT_EVERY_M) + 2
    along_m = np.linspace(0.0, path.length_m, count)
    x, y, _ = path.poses(along_m)
    for s_m, x_m, y_m in zip(along_m.tolist(), x.tolist(), y.tolist(), strict=True):
        if not room.contains(x_m, y_m):
            raise ConfigError(
                f"{where}: path: leaves the room {s_m:.1f} m from its start, at x {x_m:.1f}, y {y_m:.1f}; "
                f"the room is {room.in_words}: shorten the path or widen the room"
            )
