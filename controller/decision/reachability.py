"""The geometry of the worst case: what bodies could reach, and whether an emergency stop ends short of that.

Called by controller/decision/worst_case_limit.py alone, which makes a speed limit of the answers. What is
assumed:

* A body may stop dead anywhere on its way, so the stretch of the path that it could block only grows.
* A body may change its velocity by a bounded acceleration, up to the greatest obstacle speed V_omax.
* The velocity of a body is known only with a spread. Where it has just changed, it may have changed by more,
  but in the same direction: whoever walks out of the way faster and faster does not come back by that.

A robot that cannot leave its path can guarantee no more than to stand when something touches it. So the
emergency stop from each speed, latency included, is compared at each time with all that each body could
reach by then.
"""

from __future__ import annotations

import math

import numpy as np

from controller.decision.corridor import Placed
from controller.decision.manoeuvres import Manoeuvres
from controller.profile import SpeedRamps
from hal.compiled import compiled
from hal.records import record
from hal.types import FlagMatrix, Flags, FloatArray, Matrix

_STOPPED_MPS = 0.02  # at the end of a stop, a slower robot counts as one that has stopped


@record(frozen=True, slots=True, eq=False)
class Reach:
    """What N bodies could block at K times; each (N, K).

    inside: whether the body could be in the corridor.
    block_from_s_m, block_to_s_m: it could block the robot's positions between these.
    """

    inside: FlagMatrix
    block_from_s_m: Matrix
    block_to_s_m: Matrix


def reach(
    placed: Placed,
    times_s: FloatArray,
    manoeuvres: Manoeuvres,
    max_mps: float,
    margin_m: float,
    counts: Flags,
) -> Reach:
    """Grow N bodies by what they could do until times_s (K,) from now.

    placed: the bodies at these times, and maybe later ones, if they keep their velocity.
    max_mps: top speed of any obstacle.
    margin_m: added before each body.
    counts: (N,) which bodies count; the others block nothing.
    """
    return Reach(*_grown(placed, times_s, manoeuvres, max_mps, margin_m, counts))


@record(frozen=True, slots=True, eq=False)
class Stops:
    """R emergency stops at K times: distance_m (R, K); moves (R, K): whether the robot still moves."""

    distance_m: Matrix
    moves: FlagMatrix


def stops(ramps: SpeedRamps, times_s: FloatArray) -> Stops:
    """Sample the R stops at times_s (K,); ramps: R ramps to speed 0."""
    distance, speed, _ = ramps.state(times_s[None, :])
    return Stops(distance, speed > _STOPPED_MPS)


def passes_clear(ramp: SpeedRamps, s_m: float, times_s: FloatArray, reached: Reach) -> bool:
    """Whether the robot touches nothing that could be blocked, at any time, along a single ramp."""
    distance_m = ramp.distance(times_s[None, :])
    always, all_bodies = np.ones(distance_m.shape, np.bool_), np.ones(len(reached.inside), np.bool_)
    return count_safe_stops(Stops(distance_m, always), s_m, reached, all_bodies) == 1


@compiled(Placed, "float64[:]", Manoeuvres, "float64, float64, boolean[:]")
def _grown(
    placed: Placed,
    times_s: FloatArray,
    by: Manoeuvres,
    max_mps: float,
    margin_m: float,
    counts: Flags,
) -> tuple[FlagMatrix, FloatArray, FloatArray]:
    """The fields of Reach."""
    shape = len(by.since_s), len(times_s)
    inside, lo, hi = np.empty(shape, np.bool_), np.empty(shape), np.empty(shape)
    for k in range(shape[0]):
        # A body may stay in the way once it is there, so what it could block only grows.
        was_inside, lowest, highest = False, math.inf, -math.inf
        for j in range(shape[1]):
            t = times_s[j] + by.since_s[k]
            furthest = (max_mps + by.speed_mps[k]) * t
            inwards_mps = max(-np.sign(placed.d_m[k, j]) * by.surprise_left_mps[k], by.spread_left_mps[k])
            across = min(inwards_mps * t + 0.5 * by.change_left_mps2[k] * t * t, furthest)
            if counts[k] and placed.clearance_m[k, j] - (by.uncertain_left_m[k] + across) <= 0.0:
                changes_m = 0.5 * by.change_along_mps2[k] * t * t
                back_mps = max(-by.surprise_along_mps[k], by.spread_along_mps[k])
                on_mps = max(by.surprise_along_mps[k], by.spread_along_mps[k])
                back = min(back_mps * t + changes_m, furthest) + by.uncertain_along_m[k]
                on = min(on_mps * t + changes_m, furthest) + by.uncertain_along_m[k]
                was_inside = True
                lowest = min(lowest, placed.block_from_s_m[k, j] - back - margin_m)
                highest = max(highest, placed.block_to_s_m[k, j] + on)
            inside[k, j], lo[k, j], hi[k, j] = was_inside, lowest, highest
    return inside, lo, hi


@compiled(Stops, "float64", Reach, "boolean[:]")
def count_safe_stops(stopping: Stops, s_m: float, reached: Reach, counts: Flags) -> int:
    """How many of the R stops, from the first one on, touch none of the bodies in the mask counts (N,).

    The robot starts at s_m. Once it stands, being touched is no fault of its own.
    """
    for i in range(len(stopping.moves)):
        for j in range(stopping.moves.shape[1]):
            if not stopping.moves[i, j]:
                continue
            at_m = s_m + stopping.distance_m[i, j]
            for k in range(len(counts)):
                blocks = reached.block_from_s_m[k, j] < at_m < reached.block_to_s_m[k, j]
                if counts[k] and reached.inside[k, j] and blocks:
                    return i
    return len(stopping.moves)
