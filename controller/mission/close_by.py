"""Bodies that stand, or end, nearer to the path than the robot passes: a warning before a simulated drive."""

from __future__ import annotations

import numpy as np

from config.app import AppConfig
from controller.build import build_path, build_world, path_spec, scenario_of
from controller.path.path import Path
from hal.types import PlanarPose
from sim.contact import BUILDING, nearest_body
from sim.world import World

# What the camera errs to the side, on top of margins.lateral_m (README, "Room").
CAMERA_ERROR_M = 0.10
_EVERY_M = 0.1
_MOST_POSES = 3000
_MOST_TOLD = 3


def close_by_warning(config: AppConfig) -> str | None:
    """One line about what stands on the path, beside it or behind its target; None if there is room.

    Movers count where they are at the end of the scenario: before, where they are depends on the time.
    Scenarios whose outcome is "blocked" are left out. Raises ConfigError, PathError.
    """
    if config.simulation is None or config.governor is not None:
        return None
    scenario = scenario_of(config)
    if scenario.outcome == "blocked":
        return None
    where, _ = path_spec(config)
    path = build_path(config)
    world = build_world(config)
    warnings = _beside(config, path, world) | _behind_target(config, path, world)
    if not warnings:
        return None
    words = list(warnings.values())
    more = f"; and {len(words) - _MOST_TOLD} more" if len(words) > _MOST_TOLD else ""
    return f"{where}: path: {'; '.join(words[:_MOST_TOLD])}{more}"


def _beside(config: AppConfig, path: Path, world: World) -> dict[str, str]:
    """What stands on the path or too near beside it, in the order along the path."""
    lateral_m = config.decision.margins.lateral_m
    need_m = lateral_m + CAMERA_ERROR_M
    nearest: dict[str, tuple[float, float]] = {}
    count = min(round(path.length_m / _EVERY_M), _MOST_POSES) + 2
    along_m = np.linspace(0.0, path.length_m, count)
    for s_m, pose in zip(along_m.tolist(), np.stack(path.poses(along_m), axis=1).tolist(), strict=True):
        found = nearest_body(world, config.robot.body, PlanarPose(*pose), world.scenario.duration_s)
        distance_m = 0.0 if found.touches else found.distance_m
        if distance_m < need_m - 5e-3 and distance_m < nearest.get(found.name, (need_m, 0.0))[0]:
            nearest[found.name] = (distance_m, s_m)
    return {
        name: _passing(_called(name, world), _moves(name, world), distance_m, s_m, lateral_m, need_m)
        for name, (distance_m, s_m) in nearest.items()
    }


def _passing(what: str, moves: bool, distance_m: float, s_m: float, lateral_m: float, need_m: float) -> str:
    if distance_m <= 0.0:
        there = ", if it is there first" if moves else ""
        return f"the robot would touch {what} {s_m:.1f} m along the path, and will wait before it{there}"
    waits = "will" if distance_m < lateral_m else "may"
    return (
        f"passes {distance_m:.2f} m from {what}, {s_m:.1f} m along the path; "
        f"it needs {need_m:.2f} m, the robot {waits} wait there"
    )


def _behind_target(config: AppConfig, path: Path, world: World) -> dict[str, str]:
    """What stands within margins.stop_m before the robot at its target."""
    stop_m, body = config.decision.margins.stop_m, config.robot.body
    target, end_s = path.pose(path.length_m), world.scenario.duration_s
    stretched = body.model_copy(update={"length_m": body.length_m + stop_m})
    found = nearest_body(world, stretched, target, end_s)
    if not found.touches or nearest_body(world, body, target, end_s).touches:
        return {}
    return {
        found.name: f"{_called(found.name, world)} stands less than margins.stop_m ({stop_m:g} m) behind the "
        "target, where the robot never arrives"
    }


def _called(name: str, world: World) -> str:
    if name == BUILDING:
        return "a wall of the room"
    return f"{name!r} where it ends" if _moves(name, world) else repr(name)


def _moves(name: str, world: World) -> bool:
    return any(body.name == name and body.motion is not None for body in world.scenario.bodies)
