"""The model of another transport robot: a hull on four turning wheels, a sensor and a load."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from config.scenario import RobotBody
from hal.types import Pose
from sim.models.mesh import Faces, axis_rotation, box, join, prism
from sim.motion import MotionState

SENSOR_HEIGHT_M = 0.08  # height of the lidar above the hull
_WHEEL_SIDES = 12  # of the prism that stands for a wheel: round at the few pixels that it covers


def build_robot(
    spec: RobotBody, pick: int
) -> tuple[tuple[Faces, ...], Callable[[MotionState], tuple[Pose, ...]]]:
    """The parts (hull, then four wheels), and a function for their poses in a state of motion."""
    radius = min(0.13, 0.35 * spec.height_m)
    wheel = _wheel(radius, 0.07)
    x, y = 0.5 * spec.length_m - 1.3 * radius, 0.5 * spec.width_m - 0.035
    hubs = [np.array([sx * x, sy * y, spec.z_m + radius]) for sx in (1.0, -1.0) for sy in (1.0, -1.0)]

    def pose_parts(state: MotionState) -> tuple[Pose, ...]:
        roll = axis_rotation("y", state.distance_m / radius)
        return (Pose(np.eye(3), np.array([0.0, 0.0, spec.z_m])), *(Pose(roll, hub) for hub in hubs))

    return (_hull(spec, radius, pick), wheel, wheel, wheel, wheel), pose_parts


def _hull(spec: RobotBody, radius: float, pick: int) -> Faces:
    if spec.texture == "plain":
        skin: str | dict[str, str] = "plain/grey"
    else:
        colour = ("white", "orange", "blue")[pick % 3]
        side = f"panel/{colour}/dark"
        skin = {"side": side, "all": f"plain/{colour}"}
    low = 0.5 * radius
    parts = [
        box((spec.length_m, spec.width_m - 0.16, spec.height_m - low), skin, (0.0, 0.0, low), skip="u"),
        box(
            (spec.length_m - 0.04, spec.width_m, spec.height_m - 2.2 * radius), skin, (0.0, 0.0, 2.2 * radius)
        ),
        prism(
            8,
            (0.05, 0.05),
            (spec.height_m, spec.height_m + SENSOR_HEIGHT_M),
            "plain/black",
            cap="plain/black",
        ).moved(np.eye(3), np.array([0.42 * spec.length_m, 0.0, 0.0])),
        box(
            (0.02, 0.5 * spec.width_m, 0.06),
            "stripes",
            (0.5 * spec.length_m - 0.008, 0.0, 1.2 * radius),
            skip="b",
        ),
    ]
    if spec.load_height_m > 0.0:
        size = (0.68 * spec.length_m, 0.85 * spec.width_m, spec.load_height_m)
        load = "plain/white" if spec.texture == "plain" else f"cardboard/{pick}"
        parts.append(box(size, load, (-0.1 * spec.length_m, 0.0, spec.height_m), skip="u"))
    return join(parts)


def _wheel(radius: float, width: float) -> Faces:
    """A wheel with its axis along y and its hub at the origin."""
    rotation = axis_rotation("x", np.pi / 2.0)
    drum = prism(_WHEEL_SIDES, (radius, radius), (-0.5 * width, 0.5 * width), "wheel", cap="hub")
    return drum.moved(rotation, np.zeros(3))
