"""Where those go who are out of sight, or about to be: what the velocities say that were measured of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies
from controller.decision.limits import LEAVES_ASLANT
from hal.compiled import compiled
from hal.types import FloatArray, PlanarPose

BoolArray = NDArray[np.bool_]

# What was seen for less than this is not believed once it is gone.
SETTLED_S = 0.5
# Noise makes whatever stands beside the view creep now and then, and each time the robot would slow down: so
# much is no noise.
_CLEAR_SIGMAS, _CLEAR_MPS = 3.3, 0.2
# Nobody is as narrow as this, and ends of racks are: half of the greatest width that was seen.
NOBODY_HALF_M = 0.1
# So certainly it goes that it will not be found where it was seen last. Who has been looked at for longer
# stands by a verdict that had time: what sinks below the view may well seem to move.
_CERTAIN_SIGMAS, _NO_VERDICT_S = 5.0, 1.0
# Two velocities that differ by so much are of two.
_APART_SIGMAS = 2.0


def out_or_coming(bodies: Bodies, widest_half_m: FloatArray, pose: PlanarPose) -> tuple[BoolArray, BoolArray]:
    """(N,) of those that stand, who is out of view; and who is not, but was measured, beyond what noise
    explains, on a way towards the axis of a robot at pose. widest_half_m (N,): half of the greatest width
    that each was seen with."""
    out, comes = _out_or_coming(
        bodies.moving,
        bodies.tracked_s,
        bodies.unseen_s,
        widest_half_m,
        bodies.xy_m,
        bodies.measured_mps,
        bodies.covariance,
        pose.x_m,
        pose.y_m,
        pose.heading_rad,
    )
    return out, comes


def known_part(velocity_mps: FloatArray, covariance: FloatArray, along: FloatArray) -> float:
    """The velocity's part along a direction (2,), 0 if that is less than its spread."""
    part_mps = float(velocity_mps @ along)
    return part_mps if abs(part_mps) > math.sqrt(float(along @ covariance @ along)) else 0.0


def may_come(bodies: Bodies, pose: PlanarPose) -> BoolArray:
    """(N,) towards the robot's axis, from either side, or along with the robot: that is how one cuts in."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    left = (bodies.xy_m[:, 1] - pose.y_m) * cos - (bodies.xy_m[:, 0] - pose.x_m) * sin
    leftward = bodies.velocity_mps[:, 1] * cos - bodies.velocity_mps[:, 0] * sin
    forward = bodies.velocity_mps[:, 0] * cos + bodies.velocity_mps[:, 1] * sin
    comes: BoolArray = (left * leftward < 0.0) | (forward > LEAVES_ASLANT * np.abs(leftward))
    return comes


def as_measured(bodies: Bodies, mistaken_mps: float) -> Bodies:
    """With the velocity that was measured for who stands by the verdict alone, which takes some frames.
    Thought to stand where it is not seen, it would be waited for without end. Not with a velocity above
    mistaken_mps: it is none."""
    squared = np.einsum("ni,ni->n", bodies.measured_mps, bodies.measured_mps)
    # Along its way: v' C v / v'v is the variance there.
    variance = np.einsum("ni,nij,nj->n", bodies.measured_mps, bodies.covariance, bodies.measured_mps)
    goes = ~bodies.moving & (bodies.tracked_s >= SETTLED_S) & (bodies.tracked_s < _NO_VERDICT_S)
    goes &= (squared**2 > _CERTAIN_SIGMAS**2 * variance) & (squared > _CLEAR_MPS**2)
    goes &= squared <= mistaken_mps**2
    if not goes.any():
        return bodies
    velocity = np.where(goes[:, None], bodies.measured_mps, bodies.velocity_mps)
    return replace(bodies, velocity_mps=velocity, moving=bodies.moving | goes)


def alike(bodies: Bodies, seen: Bodies) -> BoolArray:
    """(N, M) whether the velocities of M that are seen could be those of these N; not while they are young:
    then they could be anybody's."""
    spread = np.diagonal(bodies.covariance, axis1=1, axis2=2)[:, None]
    seen_spread = np.diagonal(seen.covariance, axis1=1, axis2=2)
    differs = bodies.velocity_mps[:, None] - seen.measured_mps
    same = np.all(differs**2 <= _APART_SIGMAS**2 * (spread + seen_spread), axis=2)
    return np.asarray(same & (seen.tracked_s > SETTLED_S))


@compiled(
    "boolean[:], float64[:], float64[:], float64[:], float64[:, :], float64[:, :], float64[:, :, :],"
    "float64, float64, float64"
)
def _out_or_coming(
    moving: BoolArray,
    tracked_s: FloatArray,
    unseen_s: FloatArray,
    widest_half_m: FloatArray,
    xy_m: FloatArray,
    measured_mps: FloatArray,
    covariance: FloatArray,
    x_m: float,
    y_m: float,
    heading_rad: float,
) -> BoolArray:
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    answers = np.zeros((2, len(moving)), np.bool_)
    out, comes = answers
    for k in range(len(moving)):
        # However long something stood there: the velocity of what has a new number was hardly measured.
        if moving[k] or tracked_s[k] <= SETTLED_S or widest_half_m[k] <= NOBODY_HALF_M:
            continue
        out[k] = unseen_s[k] > 0.0
        left_m = (xy_m[k, 1] - y_m) * cos - (xy_m[k, 0] - x_m) * sin
        left_mps = measured_mps[k, 1] * cos - measured_mps[k, 0] * sin
        spread = covariance[k]
        variance = (spread[0, 0] * sin - (spread[0, 1] + spread[1, 0]) * cos) * sin + spread[1, 1] * cos * cos
        clear_mps = max(_CLEAR_SIGMAS * math.sqrt(variance), _CLEAR_MPS)
        comes[k] = not out[k] and -np.sign(left_m) * left_mps > clear_mps
    return answers
