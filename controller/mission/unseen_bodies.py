"""Bodies that a simulated drive never shows as meant: outside of the room, or moving only after its end."""

from __future__ import annotations

from config.app import AppConfig
from config.scenario import BodySpec, Go, Room
from controller.build import scenario_of

_MOST_TOLD = 3


def unseen_bodies_warning(config: AppConfig) -> str | None:
    """One line about bodies that stand or go outside of the room, whose walls hide them, and about those that
    set off after the end of the scenario; None if there are none. Raises ConfigError."""
    if config.simulation is None:
        return None
    scenario = scenario_of(config)
    told = [*_outside(scenario.bodies, scenario.room), *_too_late(scenario.bodies, scenario.duration_s)]
    if not told:
        return None
    more = f"; and {len(told) - _MOST_TOLD} more" if len(told) > _MOST_TOLD else ""
    return f"{config.simulation.scenario}: bodies: {'; '.join(told[:_MOST_TOLD])}{more}"


def _outside(bodies: tuple[BodySpec, ...], room: Room) -> list[str]:
    told = []
    for body in bodies:
        steps = () if body.motion is None else body.motion.steps
        goals = [("goes", step.x_m, step.y_m) for step in steps if isinstance(step, Go)]
        outside = [
            f"{body.name!r} {does} outside of the room ({room.in_words}), at x {x_m:g}, y {y_m:g}: "
            "the walls hide it"
            for does, x_m, y_m in [("stands", body.x_m, body.y_m), *goals]
            if not room.contains(x_m, y_m)
        ]
        told += outside[:1]
    return told


def _too_late(bodies: tuple[BodySpec, ...], duration_s: float) -> list[str]:
    return [
        f"{body.name!r} sets off at {body.motion.start_s:g} s, but a campaign ends after duration_s "
        f"({duration_s:g} s)"
        for body in bodies
        if body.motion is not None and body.motion.start_s >= duration_s
    ]
