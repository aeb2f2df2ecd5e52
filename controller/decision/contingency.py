"""The geometry of the worst case: what bodies could reach, and whether an emergency stop ends short of that.

Called by controller/decision/worst_case.py alone, which makes a speed limit of the answers. What is assumed:

* A body may stop dead anywhere on its way, so the stretch of the path that it could block only grows.
* A body may change its velocity by a bounded acceleration, up to the greatest obstacle speed V_omax.
* The velocity of a body is known only with a spread.

A robot that cannot leave its path can promise no more than to stand when something touches it. So the
emergency stop from each speed, latency included, is followed in time against all that each body could reach.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.decision.corridor import Placed
from controller.profile import SpeedRamps
from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray

_STANDING_MPS = 0.02


@record(frozen=True, slots=True, eq=False)
class Reach:
    """What N obstacles could block at K times: inside (N, K) whether, lo_m, hi_m (N, K) which positions."""

    inside: NDArray[np.bool_]
    lo_m: FloatArray
    hi_m: FloatArray

    def select(self, rows: NDArray[np.bool_]) -> Reach:
        """Only these obstacles."""
        chosen = rows.nonzero()[0]
        if len(chosen) == len(rows):
            return self
        return Reach(self.inside.take(chosen, 0), self.lo_m.take(chosen, 0), self.hi_m.take(chosen, 0))


def reach(
    placed: Placed,
    times_s: FloatArray,
    since_s: FloatArray,
    spread_mps: tuple[FloatArray, FloatArray],
    speed_mps: FloatArray,
    manoeuvre_mps2: tuple[FloatArray, FloatArray],
    most_mps: float,
    margin_m: float,
    unsure_m: tuple[FloatArray, FloatArray] | None = None,
) -> Reach:
    """Grow the bodies by what they could do in times_s (K,) from now; they were placed since_s (N,) ago.

    unsure_m: how well that place was known, along the path and across it, (N,); None: exactly.
    spread_mps: by how much their velocities may be other than thought, manoeuvre_mps2: by how much they may
    change them; each along the path and across it, (N,). speed_mps (N,) measured speed, most_mps the top
    speed of any obstacle.
    """
    unsure_along, unsure_across = unsure_m or (np.zeros(len(since_s)), np.zeros(len(since_s)))
    return Reach(
        *_grown(
            placed.clear_m,
            placed.lo_m,
            placed.hi_m,
            times_s,
            since_s,
            spread_mps[0],
            spread_mps[1],
            speed_mps,
            manoeuvre_mps2[0],
            manoeuvre_mps2[1],
            unsure_along,
            unsure_across,
            most_mps,
            margin_m,
        )
    )


@record(frozen=True, slots=True, eq=False)
class Stops:
    """R emergency stops at K times: distance_m (R, K), moves (R, K) whether the robot does not stand yet."""

    distance_m: FloatArray
    moves: NDArray[np.bool_]


def stops(ramps: SpeedRamps, times_s: FloatArray) -> Stops:
    """Sampled at times_s (K,)."""
    distance, speed, _ = ramps.state(times_s[None, :])
    return Stops(distance, speed > _STANDING_MPS)


def room(stopping: Stops, s_m: float, reached: Reach) -> FloatArray:
    """(R,) for each stop of a robot at s_m: the least distance by which it stays short of everything while it
    still moves; negative where something could be touched, inf where nothing is in the way."""
    return _least_room(stopping.distance_m, stopping.moves, s_m, reached.inside, reached.lo_m, reached.hi_m)


def stands_in_time(stopping: Stops, reached: Reach) -> NDArray[np.bool_]:
    """(R,) which stops are over before anything could be in the way at all, however near it is."""
    first = int(reached.inside.any(axis=0).argmax())
    return ~stopping.moves[:, max(first - 1, 0)]


def gets_through(ramp: SpeedRamps, s_m: float, times_s: FloatArray, reached: Reach) -> bool:
    """Whether a single ramp to a speed stays clear of everything at all times."""
    at = s_m + ramp.distance(times_s[None, :])
    return not bool((reached.inside & (at > reached.lo_m) & (at < reached.hi_m)).any())


@compiled(
    "float64[:, :], float64[:, :], float64[:, :], float64[:], float64[:], float64[:], float64[:], float64[:],"
    "float64[:], float64[:], float64[:], float64[:], float64, float64"
)
def _grown(
    clear_m: FloatArray,
    lo_m: FloatArray,
    hi_m: FloatArray,
    times_s: FloatArray,
    since_s: FloatArray,
    spread_along_mps: FloatArray,
    spread_across_mps: FloatArray,
    speed_mps: FloatArray,
    change_along_mps2: FloatArray,
    change_across_mps2: FloatArray,
    unsure_along_m: FloatArray,
    unsure_across_m: FloatArray,
    most_mps: float,
    margin_m: float,
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """The fields of Reach."""
    shape = len(since_s), len(times_s)
    inside, lo, hi = np.empty(shape, np.bool_), np.empty(shape), np.empty(shape)
    for k in range(shape[0]):
        # Once in the way it may stay there: what it could block only grows.
        was_inside, lowest, highest = False, math.inf, -math.inf
        for j in range(shape[1]):
            t = times_s[j] + since_s[k]
            furthest = (most_mps + speed_mps[k]) * t
            across = min(spread_across_mps[k] * t + 0.5 * change_across_mps2[k] * t * t, furthest)
            if clear_m[k, j] - (unsure_across_m[k] + across) <= 0.0:
                along = min(spread_along_mps[k] * t + 0.5 * change_along_mps2[k] * t * t, furthest)
                along += unsure_along_m[k]
                was_inside = True
                lowest = min(lowest, lo_m[k, j] - along - margin_m)
                highest = max(highest, hi_m[k, j] + along)
            inside[k, j], lo[k, j], hi[k, j] = was_inside, lowest, highest
    return inside, lo, hi


@compiled("float64[:, :], boolean[:, :], float64, boolean[:, :], float64[:, :], float64[:, :]")
def _least_room(
    distance_m: FloatArray,
    moves: NDArray[np.bool_],
    s_m: float,
    inside: NDArray[np.bool_],
    lo_m: FloatArray,
    hi_m: FloatArray,
) -> FloatArray:
    """(R,) of R stops, K times and N obstacles."""
    least = np.full(len(distance_m), math.inf)
    for i in range(len(distance_m)):
        for j in range(distance_m.shape[1]):
            if not moves[i, j]:
                continue
            at = s_m + distance_m[i, j]
            for k in range(len(inside)):
                if inside[k, j] and at < hi_m[k, j]:
                    least[i] = min(least[i], lo_m[k, j] - at)
    return least
