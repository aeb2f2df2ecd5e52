"""The geometry of the worst case: what bodies could reach, and whether an emergency stop ends short of that.

Called by controller/decision/worst_case.py alone, which makes a speed limit of the answers. What is assumed:

* A body may stop dead anywhere on its way, so the stretch of the path that it could block only grows.
* A body may change its velocity by a bounded acceleration, up to the greatest obstacle speed V_omax.
* The velocity of a body is known only with a spread.

A robot that cannot leave its path can promise no more than to stand when something touches it. So the
emergency stop from each speed, latency included, is followed in time against all that each body could reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.decision.corridor import Placed
from controller.profile import SpeedRamps
from hal.types import FloatArray

_STANDING_MPS = 0.02


@dataclass(frozen=True, slots=True, eq=False)
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
    unsure_m: tuple[FloatArray | float, FloatArray | float] = (0.0, 0.0),
) -> Reach:
    """Grow the bodies by what they could do in times_s (K,) from now; they were placed since_s (N,) ago.

    unsure_m: how well that place was known, along the path and across it, (N,). spread_mps: by how much their
    velocities may be other than thought, manoeuvre_mps2: by how much they may change them; each along the
    path and across it, (N,). speed_mps (N,) measured speed, most_mps the top speed of any obstacle.
    """
    t = times_s + since_s[:, None]
    furthest = (most_mps + speed_mps)[:, None] * t
    along, across = (
        np.reshape(unsure, (-1, 1))
        + np.minimum(spread[:, None] * t + 0.5 * change[:, None] * t * t, furthest)
        for unsure, spread, change in zip(unsure_m, spread_mps, manoeuvre_mps2, strict=True)
    )
    inside = placed.clear_m - across <= 0.0
    # Once in the way it may stay there: what it could block only grows.
    lo = np.where(inside, placed.lo_m - along - margin_m, np.inf)
    hi = np.where(inside, placed.hi_m + along, -np.inf)
    return Reach(
        np.logical_or.accumulate(inside, axis=1),
        np.minimum.accumulate(lo, axis=1),
        np.maximum.accumulate(hi, axis=1),
    )


@dataclass(frozen=True, slots=True, eq=False)
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
    at = (s_m + stopping.distance_m)[:, None, :]
    matters = reached.inside & (at < reached.hi_m) & stopping.moves[:, None, :]
    least: FloatArray = np.where(matters, reached.lo_m - at, np.inf).min(axis=(1, 2), initial=np.inf)
    return least


def stands_in_time(stopping: Stops, reached: Reach) -> NDArray[np.bool_]:
    """(R,) which stops are over before anything could be in the way at all, however near it is."""
    first = int(reached.inside.any(axis=0).argmax())
    return ~stopping.moves[:, max(first - 1, 0)]


def gets_through(ramp: SpeedRamps, s_m: float, times_s: FloatArray, reached: Reach) -> bool:
    """Whether a single ramp to a speed stays clear of everything at all times."""
    at = s_m + ramp.distance(times_s[None, :])
    return not bool((reached.inside & (at > reached.lo_m) & (at < reached.hi_m)).any())
