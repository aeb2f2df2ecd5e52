"""The model of a person, with limbs that swing with the distance walked."""

from __future__ import annotations

import math

import numpy as np

from config.scenario import Person
from hal.types import FloatArray, Pose
from sim.models.mesh import Faces, axis_rotation, join, prism
from sim.motion import MotionState

_SIDES = 8  # of the prisms that stand for trunk and limbs
# Shares of the body height, after common anthropometric tables.
_HIP, _KNEE, _ANKLE, _SHOULDER, _CHIN, _ELBOW = 0.52, 0.27, 0.03, 0.81, 0.86, 0.63
_STEP_M = 0.42  # length of a step as a share of the height
# Heel and toe relative to the ankle, as shares of the height.
_SOLE: FloatArray = np.array([[-0.035, 0.0, -_ANKLE], [0.104, 0.0, -_ANKLE]])
# A foot pitches by this share of its shank's angle.
_FOOT_PITCH_RATIO = 0.4
# Greatest angles of a walker's arms and knees: 22 and 49 degrees.
_ARM_SWING_RAD, _KNEE_BEND_RAD = 0.38, 0.85


def build_person(spec: Person, generator: np.random.Generator) -> tuple[Faces, ...]:
    """The parts: trunk; thigh, shank and foot, left then right; upper arm and forearm, left then right. Each
    limb's joint is at the origin of its frame."""
    h = spec.height_m
    clothes = _clothes(spec, generator)
    thigh = _limb(0.047 * h, 0.72, (_HIP - _KNEE) * h, clothes["legs"])
    shank = _limb(0.034 * h, 0.72, (_KNEE - _ANKLE) * h, clothes["legs"])
    leg = (thigh, shank, _shoe(h))
    upper_arm = _limb(0.029 * h, 0.85, (_SHOULDER - _ELBOW) * h, clothes["arms"])
    forearm = join([_limb(0.024 * h, 0.8, 0.15 * h, clothes["arms"]), _hand(h)])
    return _trunk(h, clothes), *leg, *leg, upper_arm, forearm, upper_arm, forearm


def pose_person(spec: Person, state: MotionState) -> tuple[Pose, ...]:
    """The poses of the parts in the body frame. The lower foot stands on the floor."""
    h, amplitude = spec.height_m, swing(state.speed_mps)
    cycle = state.distance_m / (2.0 * _STEP_M * h)
    legs: list[Pose] = []
    arms: list[Pose] = []
    for side, offset in ((1.0, 0.0), (-1.0, 0.5)):
        hip = np.array([0.0, side * 0.052 * h, _HIP * h])
        reach, lift_ratio = _stride((cycle + offset) % 1.0)
        knee_rad = _KNEE_BEND_RAD * amplitude * lift_ratio
        # Bending the knee would pull the foot back; the thigh compensates for that.
        thigh_rad = -math.asin(amplitude * reach * _STEP_M / (_HIP - _ANKLE)) - 0.5 * knee_rad
        legs.extend(_limb_poses(hip, thigh_rad, (_HIP - _KNEE) * h, knee_rad))
        ankle = legs[-1].apply(np.array([[0.0, 0.0, (_ANKLE - _KNEE) * h]]))[0]
        legs.append(Pose(axis_rotation("y", _FOOT_PITCH_RATIO * (thigh_rad + knee_rad)), ankle))
    for side, offset in ((1.0, 0.5), (-1.0, 0.0)):
        shoulder = np.array([0.0, side * 0.13 * h, (_SHOULDER - 0.01) * h])
        arm_rad = -_ARM_SWING_RAD * amplitude * math.cos(2.0 * math.pi * (cycle + offset))
        arms.extend(_limb_poses(shoulder, arm_rad, (_SHOULDER - _ELBOW) * h, -0.15 - 0.3 * amplitude))
    soles = np.concatenate([foot.apply(_SOLE * h)[:, 2] for foot in (legs[2], legs[5])])
    lift = np.array([0.0, 0.0, spec.z_m - float(soles.min())])
    poses = (Pose(np.eye(3), np.zeros(3)), *legs, *arms)
    return tuple(Pose(pose.rotation, pose.translation_m + lift) for pose in poses)


def _stride(cycle: float) -> tuple[float, float]:
    """How far a foot is ahead of the hip, in steps, and how far it is lifted (0..1). cycle: 0..1 over two
    steps.

    In the first half the foot stands still on the floor; in the second it swings forward smoothly.
    """
    if cycle < 0.5:
        return 0.5 - 2.0 * cycle, 0.0
    q = 2.0 * cycle - 1.0
    # Hermite cubic from -1/2 to 1/2 that begins and ends with the speed of the standing foot, -1.
    forward = -0.5 + q * (-1.0 + q * (6.0 - 4.0 * q))
    return forward, math.sin(math.pi * q) ** 2


def swing(speed_mps: float) -> float:
    """The amplitude of the swing of the limbs, 0..1: zero at rest, less when walking slowly."""
    return min(1.0, speed_mps / 0.5)


def _clothes(spec: Person, generator: np.random.Generator) -> dict[str, str]:
    if spec.texture == "plain":
        return {"legs": "plain/dark", "arms": "plain/grey", "torso": "plain/grey", "head": "plain/grey"}
    legs = str(generator.choice(["jeans", "dark", "khaki"]))
    if spec.texture == "coarse":
        return {"legs": f"cloth/{legs}", "arms": "plain/blue", "torso": "plain/blue", "head": "head"}
    vest = str(generator.choice(["yellow", "orange"]))
    return {"legs": f"cloth/{legs}", "arms": "cloth/shirt", "torso": f"vest/{vest}", "head": "head"}


def _limb(radius_m: float, taper: float, length_m: float, texture: str) -> Faces:
    """A tapered tube that hangs down from its joint at the origin and overlaps with its neighbours."""
    low, overlap = radius_m * taper, 0.6 * radius_m
    return prism(_SIDES, (low, low), (-length_m - overlap, overlap), texture, taper=1.0 / taper)


def _shoe(h: float) -> Faces:
    """A shoe, with the ankle at the origin."""
    sole = prism(6, (0.08 * h, 0.03 * h), (-_ANKLE * h, 0.02 * h), "plain/black", 0.75, "plain/black")
    return sole.moved(np.eye(3), np.array([0.035 * h, 0.0, 0.0]))


def _hand(h: float) -> Faces:
    return prism(6, (0.022 * h, 0.014 * h), (-0.25 * h, -0.15 * h), "plain/skin", 1.0, "plain/skin")


def _trunk(h: float, clothes: dict[str, str]) -> Faces:
    """Hips, torso, shoulders, neck and head, in a frame on the floor."""
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


def _limb_poses(joint: FloatArray, upper_rad: float, length_m: float, lower_rad: float) -> list[Pose]:
    """The poses of an upper limb rotated about y at its joint, and of the lower limb bent relative to it."""
    upper = axis_rotation("y", upper_rad)
    middle = joint + upper @ np.array([0.0, 0.0, -length_m])
    return [Pose(upper, joint), Pose(axis_rotation("y", upper_rad + lower_rad), middle)]
