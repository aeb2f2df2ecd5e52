"""A person of several parts whose limbs swing with the distance walked."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from config.scenario import Person
from hal.types import FloatArray, Pose
from sim.mesh import Faces, axis_rotation, join, prism
from sim.motion import MotionState

_SIDES = 8
# Shares of the body height, after common anthropometric tables.
_HIP, _KNEE, _SHOULDER, _CHIN, _ELBOW = 0.52, 0.27, 0.81, 0.86, 0.63
_STEP_M = 0.42  # share of the height
_THIGH_SWING_RAD, _ARM_SWING_RAD, _KNEE_BEND_RAD = 0.42, 0.38, 0.75


def build_person(
    spec: Person, generator: np.random.Generator
) -> tuple[tuple[Faces, ...], FloatArray, Callable[[MotionState], tuple[Pose, ...]]]:
    """Parts in their own frames (joint at the origin), a convex footprint, and the gait."""
    h = spec.height_m
    clothes = _clothes(spec, generator)
    thigh = _limb(0.047 * h, 0.72, (_HIP - _KNEE) * h, clothes["legs"])
    shank = join([_limb(0.034 * h, 0.72, (_KNEE - 0.03) * h, clothes["legs"]), _shoe(h)])
    upper_arm = _limb(0.029 * h, 0.85, (_SHOULDER - _ELBOW) * h, clothes["arms"])
    forearm = join([_limb(0.024 * h, 0.8, 0.15 * h, clothes["arms"]), _hand(h)])
    parts = (_trunk(h, clothes), thigh, shank, thigh, shank, upper_arm, forearm, upper_arm, forearm)
    return parts, _footprint(h), lambda state: _gait(h, spec.z_m, state)


def _clothes(spec: Person, generator: np.random.Generator) -> dict[str, str]:
    if spec.texture == "plain":
        return {"legs": "plain/dark", "arms": "plain/grey", "torso": "plain/grey", "head": "plain/grey"}
    legs = str(generator.choice(["jeans", "dark", "khaki"]))
    if spec.texture == "coarse":
        return {"legs": f"cloth/{legs}", "arms": "plain/blue", "torso": "plain/blue", "head": "head"}
    vest = str(generator.choice(["yellow", "orange"]))
    return {"legs": f"cloth/{legs}", "arms": "cloth/shirt", "torso": f"vest/{vest}", "head": "head"}


def _limb(radius_m: float, taper: float, length_m: float, texture: str) -> Faces:
    """A tapered tube that hangs down from its joint at the origin."""
    return prism(
        _SIDES, (radius_m * taper, radius_m * taper), (-length_m, 0.0), texture, taper=1.0 / taper, cap=None
    )


def _shoe(h: float) -> Faces:
    z = -(_KNEE - 0.03) * h
    return prism(
        6, (0.08 * h, 0.03 * h), (z - 0.03 * h, z + 0.02 * h), "plain/black", 0.75, "plain/black"
    ).moved(np.eye(3), np.array([0.035 * h, 0.0, 0.0]))


def _hand(h: float) -> Faces:
    return prism(6, (0.022 * h, 0.014 * h), (-0.25 * h, -0.15 * h), "plain/skin", 1.0, "plain/skin")


def _trunk(h: float, clothes: dict[str, str]) -> Faces:
    """Hips, torso, shoulders, neck and head; its frame stands on the floor."""
    return join(
        [
            prism(
                _SIDES, (0.062 * h, 0.098 * h), ((_HIP - 0.04) * h, (_HIP + 0.06) * h), clothes["legs"], 1.0
            ),
            prism(_SIDES, (0.066 * h, 0.102 * h), ((_HIP + 0.05) * h, 0.78 * h), clothes["torso"], 1.14),
            prism(
                _SIDES, (0.0752 * h, 0.1163 * h), (0.78 * h, 0.835 * h), clothes["torso"], 0.5, "plain/skin"
            ),
            prism(6, (0.03 * h, 0.03 * h), (0.82 * h, _CHIN * h), "plain/skin"),
            prism(_SIDES, (0.047 * h, 0.040 * h), (_CHIN * h, 0.96 * h), clothes["head"], 1.08),
            prism(_SIDES, (0.0508 * h, 0.0432 * h), (0.96 * h, 1.0 * h), "plain/black", 0.6, "plain/black"),
        ]
    )


def _footprint(h: float) -> FloatArray:
    """An octagon around feet and arms as they swing."""
    x, y = 0.19 * h, 0.145 * h
    cut = 0.4
    return np.array(
        [
            [x, -cut * y], [x, cut * y], [cut * x, y], [-cut * x, y],
            [-x, cut * y], [-x, -cut * y], [-cut * x, -y], [cut * x, -y],
        ]
    )  # fmt: skip


def _gait(h: float, z_m: float, state: MotionState) -> tuple[Pose, ...]:
    """Poses of trunk, left thigh and shank, right ones, left arm's two parts, right ones."""
    phase = math.pi * state.distance_m / (_STEP_M * h)
    # Slow or standing: the limbs come to rest.
    swing = min(1.0, state.speed_mps / 0.7)
    bob = -0.012 * h * swing * (1.0 - math.cos(2.0 * phase)) * 0.5
    poses = [Pose(np.eye(3), np.array([0.0, 0.0, z_m + bob]))]
    for side, offset in ((1.0, 0.0), (-1.0, math.pi)):
        hip = np.array([0.0, side * 0.052 * h, _HIP * h + z_m + bob])
        thigh_rad = -_THIGH_SWING_RAD * swing * math.sin(phase + offset)
        knee_rad = _KNEE_BEND_RAD * swing * max(0.0, math.cos(phase + offset)) ** 2
        poses.extend(_chain(hip, thigh_rad, (_HIP - _KNEE) * h, knee_rad))
    for side, offset in ((1.0, math.pi), (-1.0, 0.0)):
        shoulder = np.array([0.0, side * 0.137 * h, (_SHOULDER - 0.01) * h + z_m + bob])
        arm_rad = -_ARM_SWING_RAD * swing * math.sin(phase + offset)
        poses.extend(_chain(shoulder, arm_rad, (_SHOULDER - _ELBOW) * h, -0.15 - 0.3 * swing))
    return tuple(poses)


def _chain(joint: FloatArray, upper_rad: float, length_m: float, lower_rad: float) -> list[Pose]:
    """An upper limb swung about y at its joint, and the lower one bent against it."""
    upper = axis_rotation("y", upper_rad)
    middle = joint + upper @ np.array([0.0, 0.0, -length_m])
    return [Pose(upper, joint), Pose(axis_rotation("y", upper_rad + lower_rad), middle)]
