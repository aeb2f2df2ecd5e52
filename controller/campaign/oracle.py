"""The shortest possible time of a robot that knows all motions in advance.

Dynamic programming over (time, position, speed). The acceleration is one of -A, 0, +A for a step dt, so
speeds are multiples of A dt and positions of A dt^2 / 2: a lattice on which every step is exact,

    v' = v + a dt,   s' = s + v dt + a dt^2 / 2    ->    k' = k + i,   n' = n + 2 k + i,   i in {-1, 0, 1}

and all positions of one speed are the bits of one integer, so that a step is a few shifts. dt is chosen so
that the top speed is a multiple of A dt. A standing robot that something walks into is not at fault, so only
moving states are removed where something stands.

The time without obstacles is computed exactly (s-curve, controller/braking.py). The lattice gives only the
delay that obstacles cause.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller import braking
from controller.campaign.stage import Stage
from hal.compiled import compiled
from hal.types import FloatArray

# Speeds above 0: at 1.5 m/s and 0.3 m/s^2 a step of time is 0.21 s, and one of the way 6.5 mm. A robot that
# is slower, or speeds up faster, may get fewer, so that no step of time is shorter than _LEAST_STEP_S: the
# work grows with the cube of their number.
_LEVELS, _LEAST_STEP_S = 24, 0.1
_GRID_M = 0.01  # of the speeds along the path; they are asked for at every tenth place
_NEVER = -1


@dataclass(frozen=True, slots=True)
class OracleTime:
    """total_s: the shortest time to the target; inf if it cannot be reached within the horizon. delay_s: the
    share of it that obstacles cause."""

    total_s: float
    delay_s: float


class Lattice:
    """The lattice for one top speed and acceleration. length_m is rounded to it (about 5 mm)."""

    def __init__(self, top_mps: float, accel_mps2: float, length_m: float) -> None:
        self._levels = max(min(_LEVELS, math.floor(top_mps / (accel_mps2 * _LEAST_STEP_S))), 1)
        self.dt_s = top_mps / (self._levels * accel_mps2)
        self.speeds_mps = accel_mps2 * self.dt_s * np.arange(self._levels + 1)
        self.step_m = 0.5 * accel_mps2 * self.dt_s**2
        # From rest to rest, the lattice reaches only even numbers of position steps.
        self.end = 2 * round(0.5 * length_m / self.step_m)
        self._all_positions = (1 << (self.end + 1)) - 1
        self._allowed = [self._all_positions] * (self._levels + 1)

    def limit(self, s_m: FloatArray, speed_mps: FloatArray) -> None:
        """Remove states faster than speed_mps (N,) at s_m (N,), which must increase."""
        limit_mps = np.interp(np.arange(self.end + 1) * self.step_m, s_m, speed_mps)
        for k, speed in enumerate(self.speeds_mps.tolist()):
            self._allowed[k] = _bits(limit_mps >= speed - 1e-9)

    def steps_to_end(self, blocked: list[list[tuple[float, float]]]) -> int:
        """The number of steps until the robot stands at the end; -1 if there are not enough steps.

        blocked: for each step, the intervals of s that are blocked.
        """
        states = [1] + [0] * self._levels
        for step, intervals in enumerate(blocked):
            if step:
                states = self._step(states)
            free_positions = self._all_positions
            for low_m, high_m in intervals:
                low = max(math.ceil(low_m / self.step_m), 0)
                high = min(math.floor(high_m / self.step_m), self.end)
                if high >= low:
                    free_positions &= ~(((1 << (high - low + 1)) - 1) << low)
            if free_positions != self._all_positions:
                states[1:] = [bits & free_positions for bits in states[1:]]
            if states[0] >> self.end & 1:
                return step
        return _NEVER

    def _step(self, states: list[int]) -> list[int]:
        next_states = []
        for k, allowed in enumerate(self._allowed):
            bits = states[k] << (2 * k)
            if k > 0:
                bits |= states[k - 1] << (2 * k - 1)
            if k < self._levels:
                bits |= states[k + 1] << (2 * k + 1)
            next_states.append(bits & allowed)
        return next_states


def _bits(flags: NDArray[np.bool_]) -> int:
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")


def free_time_s(s_m: FloatArray, speed_mps: FloatArray, accel_mps2: float, jerk_mps3: float) -> float:
    """The time from rest at the first s to rest at the last one, nowhere faster than speed_mps.

    Exact for the acceleration limit. The jerk limit adds A / J if the profile has one start and one stop and
    reaches A, and otherwise the additional time of the s-curve.
    """
    v2 = np.minimum(speed_mps, math.inf) ** 2
    v2[0] = v2[-1] = 0.0
    v = np.sqrt(_reachable(v2, 2.0 * accel_mps2 * np.diff(s_m)))
    trapezoid_s = float((2.0 * np.diff(s_m) / np.maximum(v[:-1] + v[1:], 1e-9)).sum())
    peak = float(v.max())
    jerk_s = braking.stop(peak, 0.0, braking.BrakeLimits(accel_mps2, jerk_mps3)).time_s - peak / accel_mps2
    return trapezoid_s + jerk_s


@compiled("float64[:], float64[:]")
def _reachable(v2: FloatArray, rise: FloatArray) -> FloatArray:
    """Squares of speeds (N,), limited so that they neither rise nor fall by more than rise (N - 1,)."""
    v2 = v2.copy()
    for k in range(len(rise)):
        v2[k + 1] = min(v2[k + 1], v2[k] + rise[k])
    for k in range(len(rise) - 1, -1, -1):
        v2[k] = min(v2[k], v2[k + 1] + rise[k])
    return v2


def solve(stage: Stage, top_mps: float, horizon_s: float) -> OracleTime:
    """The oracle's time for a mission. top_mps: the speed that the range of the camera allows."""
    limits = stage.robot.limits
    length = stage.path.length_m
    s_m = np.linspace(0.0, length, max(2, math.ceil(length / _GRID_M) + 1))
    speed = np.minimum(np.array([stage.path.speed_limit(s) for s in s_m[::10]]), top_mps)
    speed = np.interp(s_m, s_m[::10], speed)
    free_s = free_time_s(s_m, speed.copy(), limits.max_accel_mps2, limits.max_jerk_mps3)
    lattice = Lattice(top_mps, limits.max_accel_mps2, length)
    lattice.limit(s_m, speed)
    times_s = np.arange(0.0, horizon_s, lattice.dt_s)
    blocked = stage.blocked(times_s)
    if not any(blocked):
        return OracleTime(free_s, 0.0)
    steps = lattice.steps_to_end(blocked)
    if steps == _NEVER:
        return OracleTime(math.inf, math.inf)
    free_steps = lattice.steps_to_end([[] for _ in blocked])
    delay_s = (steps - free_steps) * lattice.dt_s
    return OracleTime(free_s + delay_s, delay_s)
