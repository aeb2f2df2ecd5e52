"""Conflicts with bodies that cross the robot's path, and the speeds that solve them. Nothing is remembered.

A conflict is the time between a body's entering the swept corridor and its leaving it, with the stretch of
the robot's way that the body blocks meanwhile. comes_in tells which bodies enter
(controller/decision/appraise.py asks it), find_conflicts tells when and where. choices gives two speeds for a
conflict: up to yield_mps the robot lets the body pass first, from first_mps on it passes before the body.
controller/decision/moving.py makes limits of these choices and keeps them from step to step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.decision.corridor import Placed
from controller.profile import SpeedRamps
from hal.types import FloatArray

# So unlikely that it will not come into the way, an obstacle that heads for it cannot become.
_MOST_SPREAD_M = 0.5


@dataclass(frozen=True, slots=True)
class Conflict:
    """row: of the body. in_s, out_s: from now; out_s is inf where it does not leave within the horizon.
    lo_in_m to hi_in_m: positions of the robot that it blocks when it enters; lo_out_m: from where on it does
    when it leaves, or at the horizon."""

    row: int
    in_s: float
    out_s: float
    lo_in_m: float
    lo_out_m: float
    hi_in_m: float


def comes_in(
    placed: Placed, times_s: FloatArray, sigma_side_mps: FloatArray, unsure_m: FloatArray | float = 0.0
) -> NDArray[np.bool_]:
    """(N,) which bodies are, or are likely to come, within the swept width. times_s (K,) begins at 0 = now.

    Likely: with the spread of the sideways velocity taken off, so that nobody is braked for because of noise.
    What an unlikely entry could do is watched by controller/decision/contingency.py. unsure_m (N,): so much
    nearer to the way they may be than where they are placed.
    """
    clear = placed.clear_m - np.reshape(unsure_m, (-1, 1))
    found: NDArray[np.bool_] = (clear[:, 0] <= 0.0) | (
        (clear + _likely(times_s, sigma_side_mps)).min(axis=1) <= 0.0
    )
    return found


def find_conflicts(
    placed: Placed,
    times_s: FloatArray,
    sigma_side_mps: FloatArray,
    margin_m: FloatArray,
    rows: NDArray[np.intp],
) -> list[Conflict]:
    """For the bodies rows, which come in: when they are within margin_m (N,) of the corridor.

    Leaving must be certain, the spread added: hope is no reason to go.
    """
    clear = placed.clear_m.take(rows, 0) - margin_m[rows, None]
    likely = clear + _likely(times_s, sigma_side_mps[rows])
    certain = clear - sigma_side_mps[rows, None] * times_s
    found = []
    for k, row in enumerate(rows.tolist()):
        entry = 0.0 if clear[k, 0] <= 0.0 else max(_first_below(likely[k], times_s), 0.0)
        if math.isinf(entry):
            continue
        found.append(_conflict(placed, times_s, row, entry, _first_above(certain[k], times_s, entry)))
    return found


def _likely(times_s: FloatArray, sigma_side_mps: FloatArray) -> FloatArray:
    return np.minimum(sigma_side_mps[:, None] * times_s, _MOST_SPREAD_M)


def _first_below(values: FloatArray, times_s: FloatArray) -> float:
    """When values first fall to 0, between the samples; inf: never."""
    below = values <= 0.0
    if not below.any():
        return math.inf
    k = int(below.argmax())
    if k == 0:
        return float(times_s[0])
    share = values[k - 1] / (values[k - 1] - values[k])
    return float(times_s[k - 1] + share * (times_s[k] - times_s[k - 1]))


def _first_above(values: FloatArray, times_s: FloatArray, after_s: float) -> float:
    above = (values > 0.0) & (times_s > after_s)
    if not above.any():
        return math.inf
    k = int(above.argmax())
    if k == 0 or values[k - 1] > 0.0:
        return float(times_s[k])
    share = -values[k - 1] / (values[k] - values[k - 1])
    return float(times_s[k - 1] + share * (times_s[k] - times_s[k - 1]))


def _conflict(placed: Placed, times_s: FloatArray, row: int, in_s: float, out_s: float) -> Conflict:
    end_s = min(out_s, float(times_s[-1]))
    lo, hi = placed.lo_m[row], placed.hi_m[row]
    return Conflict(
        row,
        in_s,
        out_s,
        float(np.interp(in_s, times_s, lo)),
        float(np.interp(end_s, times_s, lo)),
        float(np.interp(in_s, times_s, hi)),
    )


@dataclass(frozen=True, slots=True)
class Choice:
    """For one conflict: speeds up to yield_mps let it pass first, speeds from first_mps on pass before it
    (inf: none does)."""

    yield_mps: float
    first_mps: float


def choices(
    conflict: Conflict,
    ramps: SpeedRamps,
    speeds_mps: FloatArray,
    s_m: float,
    margin_m: float,
    leave_s: float,
    enter_s: float,
) -> Choice:
    """Both bounds, for the robot at s_m whose ramps lead to speeds_mps (N,), growing, from 0 on.

    leave_s: how long after the obstacle has left, enter_s: how long before it enters, the robot may come.
    """
    times = np.array([conflict.in_s, max(conflict.in_s - enter_s, 0.0), conflict.out_s + leave_s])
    leaves = math.isfinite(conflict.out_s)
    if not leaves:
        times[2] = times[0]
    at_in, at_first, at_out = ramps.distance(times[None, :]).T + s_m
    room = np.minimum(conflict.lo_in_m - at_in, conflict.lo_out_m - at_out) - margin_m
    yield_mps = _greatest_with_room(room, speeds_mps) if leaves else 0.0
    passes = at_first > conflict.hi_in_m
    first_mps = float(speeds_mps[int(passes.argmax())]) if passes.any() else math.inf
    return Choice(yield_mps, first_mps)


def _greatest_with_room(room: FloatArray, speeds_mps: FloatArray) -> float:
    """Where the falling room becomes 0, between two speeds; 0 where even standing is too near."""
    short = room < 0.0
    if not short.any():
        return math.inf
    k = int(short.argmax())
    if k == 0:
        return 0.0
    share = room[k - 1] / (room[k - 1] - room[k])
    return float(speeds_mps[k - 1] + share * (speeds_mps[k] - speeds_mps[k - 1]))
