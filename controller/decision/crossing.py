"""Conflicts with bodies that cross the robot's path, and the speeds that solve them. Keeps no state.

A conflict lasts from the time when a body enters the swept corridor until it leaves it, and has the stretch
of the path that the body blocks meanwhile. controller/decision/watched.py asks likely_enters which bodies
enter; find_conflicts says when and where. choices gives two speeds for a conflict: up to yield_mps the robot
lets the body pass first, from first_mps on it passes before the body. controller/decision/moving_limits.py
turns these choices into limits and keeps them from step to step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.decision.corridor import Placed
from controller.profile import SpeedRamps
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import Flags, FloatArray

# The spread of the sideways velocity makes an entry less likely, but by no more than this distance: a body
# that heads for the corridor must not count as unlikely to enter only because it needs long to get there.
_MAX_ENTRY_SPREAD_M = 0.5


@record(frozen=True, slots=True)
class Conflict:
    """When and where one body is in the way.

    row: index of the body.
    in_s, out_s: when it enters and leaves, from now; out_s is inf if it does not leave within the horizon.
    lo_in_m, hi_in_m: it blocks the robot's positions between these when it enters.
    lo_out_m: it blocks those from here on when it leaves, or at the horizon.
    """

    row: int
    in_s: float
    out_s: float
    lo_in_m: float
    lo_out_m: float
    hi_in_m: float


def likely_enters(
    placed: Placed,
    times_s: FloatArray,
    sigma_side_mps: FloatArray,
    position_uncertainty_m: FloatArray | None = None,
) -> Flags:
    """(N,) which bodies are, or are likely to come, within the swept width. times_s (K,) begins at 0 = now.

    Likely: even if the sideways velocity is less by its spread, so that noise does not make the robot brake.
    Less likely entries are covered by controller/decision/worst_case_limit.py. position_uncertainty_m (N,):
    the bodies may be this much nearer to the corridor than where they are placed.
    """
    nearer_m = np.zeros(len(sigma_side_mps)) if position_uncertainty_m is None else position_uncertainty_m
    return _likely_enters(placed.clearance_m, times_s, sigma_side_mps, nearer_m)


def find_conflicts(
    placed: Placed,
    times_s: FloatArray,
    sigma_side_mps: FloatArray,
    margin_m: FloatArray,
    rows: NDArray[np.intp],
) -> list[Conflict]:
    """The conflicts with the bodies rows (R,), which come in, within margin_m (N,) of the corridor.

    A body has left only once it is clear of the margin despite the whole spread of its velocity: leaving must
    be certain before the robot relies on it.
    """
    conflicts = _conflicts(placed, times_s, sigma_side_mps, margin_m, rows)
    return [
        Conflict(row, *times_and_places)
        for row, times_and_places in zip(rows.tolist(), conflicts.tolist(), strict=True)
        if math.isfinite(times_and_places[0])
    ]


@record(frozen=True, slots=True)
class Choice:
    """The speeds that solve one conflict.

    With speeds up to yield_mps the robot lets the body pass first; with speeds from first_mps on it passes
    before the body (inf: with none).
    """

    yield_mps: float
    first_mps: float


def choices(
    conflict: Conflict,
    ramps: SpeedRamps,
    s_m: float,
    margin_m: float,
    leave_s: float,
    enter_s: float,
) -> Choice:
    """Both bounds, for the robot at s_m. The speeds to which its ramps lead grow from 0 on.

    margin_m: distance kept to the stretch that is blocked. leave_s: least time from the obstacle's leaving
    until the robot arrives. enter_s: least time from the robot's having passed until the obstacle enters.
    """
    times = np.array([conflict.in_s, max(conflict.in_s - enter_s, 0.0), conflict.out_s + leave_s])
    if math.isinf(conflict.out_s):
        times[2] = times[0]
    return Choice(*_bounds(conflict, ramps.distance(times[None, :]), ramps.targets_mps, s_m, margin_m))


@inlined
def _likely(clearance_m: float, t_s: float, sigma_mps: float) -> float:
    """The clearance clearance_m at t_s, plus the bounded spread of the sideways velocity."""
    return clearance_m + min(sigma_mps * t_s, _MAX_ENTRY_SPREAD_M)


@inlined
def _zero_crossing_s(from_s: float, from_m: float, to_s: float, to_m: float) -> float:
    """When a value that changes linearly from from_m at from_s to to_m at to_s is 0."""
    return from_s + from_m / (from_m - to_m) * (to_s - from_s)


@inlined
def _enters_s(clearance_m: FloatArray, margin_m: float, times_s: FloatArray, sigma_mps: float) -> float:
    """When a body likely comes within margin_m, interpolated between the samples; inf: never."""
    before_m = clearance_m[0] - margin_m
    if before_m <= 0.0:
        return 0.0
    for j in range(1, len(times_s)):
        here_m = _likely(clearance_m[j] - margin_m, times_s[j], sigma_mps)
        if here_m <= 0.0:
            return _zero_crossing_s(times_s[j - 1], before_m, times_s[j], here_m)
        before_m = here_m
    return math.inf


@inlined
def _leaves_s(
    clearance_m: FloatArray, margin_m: float, times_s: FloatArray, sigma_mps: float, after_s: float
) -> float:
    """When, later than after_s, a body is certainly farther away than margin_m; inf: never."""
    before_m = math.inf
    for j in range(len(times_s)):
        here_m, t_s = clearance_m[j] - margin_m - sigma_mps * times_s[j], float(times_s[j])
        if here_m > 0.0 and t_s > after_s:
            return t_s if before_m > 0.0 else _zero_crossing_s(times_s[j - 1], before_m, t_s, here_m)
        before_m = here_m
    return math.inf


@inlined
def _interpolated(t_s: float, times_s: FloatArray, values: FloatArray) -> float:
    """The value at t_s, interpolated between the samples; the first or last value outside of them."""
    for j in range(1, len(times_s)):
        if t_s <= times_s[j]:
            share = max((t_s - times_s[j - 1]) / (times_s[j] - times_s[j - 1]), 0.0)
            return float(values[j - 1] + share * (values[j] - values[j - 1]))
    return float(values[-1])


@compiled("float64[:, :], float64[:], float64[:], float64[:]")
def _likely_enters(
    clearance_m: FloatArray, times_s: FloatArray, sigma_mps: FloatArray, nearer_m: FloatArray
) -> Flags:
    """(N,) which bodies' clearance is 0 or less now, or is likely to be at some time."""
    found = np.zeros(len(clearance_m), np.bool_)
    for k in range(len(clearance_m)):
        found[k] = clearance_m[k, 0] - nearer_m[k] <= 0.0
        for j in range(len(times_s)):
            if found[k]:
                break
            found[k] = _likely(clearance_m[k, j] - nearer_m[k], times_s[j], sigma_mps[k]) <= 0.0
    return found


@compiled(Placed, "float64[:], float64[:], float64[:], int64[:]")
def _conflicts(
    placed: Placed,
    times_s: FloatArray,
    sigma_mps: FloatArray,
    margin_m: FloatArray,
    rows: NDArray[np.intp],
) -> FloatArray:
    """(R, 5) in_s, out_s, lo_in_m, lo_out_m and hi_in_m of Conflict for the bodies rows (R,).

    in_s is inf where there is no conflict.
    """
    found = np.empty((len(rows), 5))
    for i in range(len(rows)):
        k = rows[i]
        in_s = _enters_s(placed.clearance_m[k], margin_m[k], times_s, sigma_mps[k])
        out_s = _leaves_s(placed.clearance_m[k], margin_m[k], times_s, sigma_mps[k], in_s)
        found[i, 0], found[i, 1] = in_s, out_s
        found[i, 2] = _interpolated(in_s, times_s, placed.block_from_s_m[k])
        found[i, 3] = _interpolated(out_s, times_s, placed.block_from_s_m[k])
        found[i, 4] = _interpolated(in_s, times_s, placed.block_to_s_m[k])
    return found


@compiled(Conflict, "float64[:, :], float64[:], float64, float64")
def _bounds(
    conflict: Conflict, distance_m: FloatArray, speeds_mps: FloatArray, s_m: float, margin_m: float
) -> tuple[float, float]:
    """The fields of Choice.

    distance_m (N, 3): how far the robot at s_m comes with each of speeds_mps (N,) until the body enters,
    until the robot should have passed, and until the body has left.
    """
    leaves = math.isfinite(conflict.out_s)
    yield_mps = math.inf if leaves else 0.0
    before_m = 0.0
    for k in range(len(speeds_mps) if leaves else 0):
        before_it_m = conflict.lo_in_m - (distance_m[k, 0] + s_m)
        room_m = min(before_it_m, conflict.lo_out_m - (distance_m[k, 2] + s_m)) - margin_m
        if room_m < 0.0:
            # Interpolate the speed at which the room becomes 0; if even standing is too near, it is 0.
            yield_mps = 0.0
            if k > 0:
                share = before_m / (before_m - room_m)
                yield_mps = speeds_mps[k - 1] + share * (speeds_mps[k] - speeds_mps[k - 1])
            break
        before_m = room_m
    for k in range(len(speeds_mps)):
        if distance_m[k, 1] + s_m > conflict.hi_in_m:
            return yield_mps, speeds_mps[k]
    return yield_mps, math.inf
