"""Bodies whose fragments lie on one straight edge: what that edge cannot tell of their motion.

An edge looks the same all along its length. Where it breaks into fragments there is often no corner: the
break comes from noise, or from the raster of the image, and does not move with the body. The ends slide along
the edge then, all of them alike, so that many ends agree on a wrong velocity, and the length of the fragments
changes as if the body came nearer or went away. What the ends tell is the motion across the edge.

vision/tracker.py calls it after the velocities of bodies have been computed by their ends
(vision/motion/least_squares.py). Single fragments are left to vision/motion/limbs.py and sliding.py.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.motion.least_squares import (
    MOVED_CHI2,
    ROBUST_CHI2,
    BodyVelocities,
    end_chi2,
    end_information,
)
from vision.motion.sliding import SLIDING_MPS
from vision.motion.velocities import EndResiduals

_MIN_ENDS = 4  # two fragments
# Of the ends from their edge, root mean square. The sides of a pole that is not far away are farther apart.
_STRAIGHT_PX = 2.0
_LONG = 4.0  # minimum length of the edge relative to that, both as standard deviations of the ends
_ON_EDGE = 2.0  # times that: an end farther from the edge is not on it
_MOVED_ACROSS_CHI2 = 10.8  # 99.9 % of static ends, 1 degree of freedom


def without_way_along(
    body: BodyVelocities, motion: EndResiduals, owner: NDArray[np.intp], focal_px: float
) -> BodyVelocities:
    """body, with what the ends on one edge cannot tell taken out.

    Where all ends that agree with the velocity of a body lie on one straight edge, its covariance gains 3 m/s
    along the edge and along the line of sight, and ends on that edge contradict standing still only if they
    have moved across it.

    owner (2N,): body of each end, -1 for none. focal_px: of the camera.
    """
    owner = np.ascontiguousarray(owner, np.int64)
    straight = _STRAIGHT_PX / focal_px
    middle, direction = _edges(body, motion, owner, straight)
    if not direction.any():
        return body
    covariance, contradicts_static = _across(body, motion, owner, middle, direction, straight)
    return replace(body, covariance=covariance, contradicts_static=contradicts_static)


@compiled(BodyVelocities, EndResiduals, "int64[::1], float64")
def _edges(
    body: BodyVelocities, motion: EndResiduals, owner: NDArray[np.int64], straight: float
) -> tuple[FloatArray, FloatArray]:
    """Middle of each body's agreeing ends, as a ray with z = 1, and unit vector along their edge, (G, 2).

    The vector is 0 where the ends do not lie on one edge. straight: as _STRAIGHT_PX, in rays.
    """
    bodies = len(body.ends)
    sums, information = np.zeros((bodies, 6)), np.empty(3)
    for k in range(len(owner)):
        g = owner[k]
        if not (motion.usable[k] and 0 <= g < bodies and body.ends[g] >= _MIN_ENDS):
            continue
        end_information(motion.covariance[k], motion.depth_effect[k], information)
        if end_chi2(motion, k, body.velocity_mps[g], information) <= ROBUST_CHI2:
            x, y = motion.ray[k, 0], motion.ray[k, 1]
            sums[g, 0] += 1.0
            sums[g, 1] += x
            sums[g, 2] += y
            sums[g, 3] += x * x
            sums[g, 4] += x * y
            sums[g, 5] += y * y
    middle, direction = np.zeros((bodies, 2)), np.zeros((bodies, 2))
    for g in range(bodies):
        count = sums[g, 0]
        if count < _MIN_ENDS:
            continue
        x, y = sums[g, 1] / count, sums[g, 2] / count
        xx, xy, yy = sums[g, 3] / count - x * x, sums[g, 4] / count - x * y, sums[g, 5] / count - y * y
        # Variances of the ends across and along their best straight line.
        mean, root = 0.5 * (xx + yy), math.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
        across = max(mean - root, 0.0)
        middle[g, 0], middle[g, 1] = x, y
        if across <= straight * straight and mean + root > _LONG * _LONG * across:
            angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
            direction[g, 0], direction[g, 1] = math.cos(angle), math.sin(angle)
    return middle, direction


@compiled(BodyVelocities, EndResiduals, "int64[::1], float64[:, ::1], float64[:, ::1], float64")
def _across(
    body: BodyVelocities,
    motion: EndResiduals,
    owner: NDArray[np.int64],
    middle: FloatArray,
    direction: FloatArray,
    straight: float,
) -> tuple[FloatArray, FloatArray]:
    """covariance and contradicts_static as of without_way_along. middle, direction, straight: see _edges."""
    covariance, contradicts = body.covariance.copy(), body.contradicts_static.copy()
    moved = np.zeros(len(body.ends))
    for k in range(len(owner)):
        g = owner[k]
        if motion.usable[k] and 0 <= g < len(moved):
            # Of the normal of the edge; all 0 where there is none.
            a, b = -direction[g, 1], direction[g, 0]
            residual_m = a * motion.residual_m[k, 0] + b * motion.residual_m[k, 1]
            effect_m = a * motion.depth_effect[k, 0] + b * motion.depth_effect[k, 1]
            xx, xy, yy = motion.covariance[k]
            variance = a * a * xx + 2.0 * a * b * xy + b * b * yy + effect_m * effect_m
            away = a * (motion.ray[k, 0] - middle[g, 0]) + b * (motion.ray[k, 1] - middle[g, 1])
            across = residual_m * residual_m > _MOVED_ACROSS_CHI2 * variance
            moved[g] += motion.static_chi2[k] > MOVED_CHI2 and (across or abs(away) > _ON_EDGE * straight)
    for g in range(len(moved)):
        along, x, y = direction[g], middle[g, 0], middle[g, 1]
        if along[0] == 0.0 and along[1] == 0.0:
            continue
        length = math.sqrt(x * x + y * y + 1.0)
        sight, way = (x / length, y / length, 1.0 / length), (along[0], along[1], 0.0)
        for i in range(3):
            for j in range(3):
                covariance[g, i, j] += SLIDING_MPS**2 * (sight[i] * sight[j] + way[i] * way[j])
        contradicts[g] = moved[g] / body.ends[g]
    return covariance, contradicts
