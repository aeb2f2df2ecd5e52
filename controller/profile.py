"""Future speed profiles: jerk-limited ramps from the present state to many target speeds, in arrays.

The profile is that of ruckig's velocity interface and of controller/braking.py (a ramp to 0 is the stop), so
the decision predicts what the shaper (controller/shape.py) will drive.
"""

from __future__ import annotations

import math

import numpy as np

from controller.braking import BrakeLimits
from controller.decision.limits import Motion
from hal.compiled import compiled, inlined
from hal.types import FloatArray, Vector

_ROUNDED_TO_REST_MPS = 1e-9  # what rounding leaves of a speed at the end of a stop


class SpeedRamps:
    """N ramps: hold v for latency_s, then reach each target speed in the shortest time, then keep it.

    v_mps, a_mps2: (N,) present speed and acceleration.
    targets_mps: (N,) >= 0.
    accel_mps2, decel_mps2: bounds of the ramps up and down; a present acceleration outside them is held.
    jerk_mps3: bound of the jerk.
    latency_s: how long the present speed is held first.
    """

    v_mps: Vector
    a_mps2: Vector
    targets_mps: Vector
    accel_mps2: float
    decel_mps2: float
    jerk_mps3: float
    latency_s: float

    def __init__(
        self,
        v_mps: float | FloatArray,
        a_mps2: float | FloatArray,
        targets_mps: FloatArray,
        limits: BrakeLimits,
        *,
        accel_mps2: float | None = None,
        latency_s: float = 0.0,
    ) -> None:
        """v_mps, a_mps2: scalars or (N,). accel_mps2: that of limits if it is not given."""
        self.v_mps, self.a_mps2 = np.empty(len(targets_mps)), np.empty(len(targets_mps))
        self.v_mps[:], self.a_mps2[:], self.targets_mps = v_mps, a_mps2, targets_mps
        self.accel_mps2 = limits.decel_mps2 if accel_mps2 is None else accel_mps2
        self.decel_mps2, self.jerk_mps3, self.latency_s = limits.decel_mps2, limits.jerk_mps3, latency_s

    @property
    def duration_s(self) -> FloatArray:
        """(N,) time until the target speed is reached, latency included."""
        return self.latency_s + _durations(self)

    def state(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance m, speed m/s and acceleration m/s^2 after t_s, (N, K) each.

        t_s: (N, K), or (1, K) if the times are the same for all ramps.
        """
        return _states(self, t_s)

    def distance(self, t_s: FloatArray) -> FloatArray:
        """(N, K) distance m after t_s, which is (N, K) or (1, K)."""
        return _distances(self, t_s)


def ramps_from(motion: Motion, targets_mps: FloatArray, limits: BrakeLimits) -> SpeedRamps:
    """Ramps from the present motion to targets_mps (N,), up and down within limits."""
    return SpeedRamps(motion.v_mps, motion.a_mps2, targets_mps, limits, latency_s=motion.latency_s)


def stop_step(v_mps: float, a_mps2: float, limits: BrakeLimits, dt_s: float) -> tuple[float, float]:
    """Speed and acceleration after the first dt_s of the stop of braking.stop; never a negative speed."""
    lets_go = a_mps2 < 0.0 and v_mps <= a_mps2 * a_mps2 / (2.0 * limits.jerk_mps3)
    if lets_go or a_mps2 < -limits.decel_mps2:
        a = min(a_mps2 + limits.jerk_mps3 * dt_s, 0.0 if lets_go else -limits.decel_mps2)
        v = v_mps + (a_mps2 + a) / 2.0 * dt_s
        return (v, a) if v > 0.0 else (0.0, 0.0)
    ramp = SpeedRamps(v_mps, a_mps2, np.zeros(1), limits, accel_mps2=math.inf)
    _, speed, acceleration = ramp.state(np.full((1, 1), dt_s))
    v, a = float(speed[0, 0]), float(acceleration[0, 0])
    return (v, a) if v > _ROUNDED_TO_REST_MPS else (0.0, 0.0)


@inlined
def _phases(ramps: SpeedRamps, k: int) -> tuple[float, float, float, float, float]:
    """Durations of the three phases of ramp k (acceleration to its peak, at its peak, back to 0), the signed
    jerk of the first phase, and the signed peak."""
    v, a, target, jerk = ramps.v_mps[k], ramps.a_mps2[k], ramps.targets_mps[k], ramps.jerk_mps3
    # Up or down: compare the target with the speed that is reached if the acceleration goes to 0 now.
    sign = 1.0 if target >= v + a * abs(a) / (2.0 * jerk) else -1.0
    start = sign * a
    bound = max(ramps.accel_mps2 if sign > 0.0 else ramps.decel_mps2, start)
    wanted = sign * (target - v)
    peak = min(math.sqrt(max(jerk * wanted + start * start / 2.0, 0.0)), bound)
    in_ramps = (2.0 * peak * peak - start * start) / (2.0 * jerk)
    steady_s = max(wanted - in_ramps, 0.0) / max(peak, 1e-12) if peak > 0.0 else 0.0
    return max(peak - start, 0.0) / jerk, steady_s, peak / jerk, sign * jerk, sign * peak


@inlined
def _state(
    ramps: SpeedRamps, k: int, phases: tuple[float, float, float, float, float], t: float
) -> tuple[float, float, float]:
    """Distance, speed and acceleration of ramp k at t."""
    t1, t2, t3, j, peak = phases
    v, a = ramps.v_mps[k], ramps.a_mps2[k]
    v1 = v + a * t1 + j * t1**2 / 2.0
    v2 = v1 + peak * t2
    # How long each phase has lasted by t: latency, jerk, constant acceleration, jerk back, target speed.
    held = min(t, ramps.latency_s)
    x1 = min(t - held, t1)
    after = t - held - t1
    x2 = min(max(after, 0.0), t2)
    x3 = min(max(after - t2, 0.0), t3)
    x4 = max(after - t2 - t3, 0.0)
    distance = (
        v * (held + x1)
        + a * x1**2 / 2.0
        + j * x1**3 / 6.0
        + v1 * x2
        + peak * x2**2 / 2.0
        + v2 * x3
        + peak * x3**2 / 2.0
        - j * x3**3 / 6.0
        + ramps.targets_mps[k] * x4
    )
    speed = max(v + a * x1 + j * x1**2 / 2.0 + peak * (x2 + x3) - j * x3**2 / 2.0, 0.0)
    return distance, speed, peak - j * x3 if x2 + x3 > 0.0 else a + j * x1


@compiled(SpeedRamps)
def _durations(ramps: SpeedRamps) -> FloatArray:
    """(N,) durations of the ramps, without latency."""
    durations = np.empty(len(ramps.targets_mps))
    for k in range(len(durations)):
        t1, t2, t3, _, _ = _phases(ramps, k)
        durations[k] = t1 + t2 + t3
    return durations


@compiled(SpeedRamps, "float64[:, :]")
def _states(ramps: SpeedRamps, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """As SpeedRamps.state()."""
    shape = len(ramps.targets_mps), t_s.shape[1]
    distance, speed, acceleration = np.empty(shape), np.empty(shape), np.empty(shape)
    for k in range(shape[0]):
        phases = _phases(ramps, k)
        for i in range(shape[1]):
            t = t_s[min(k, len(t_s) - 1), i]
            distance[k, i], speed[k, i], acceleration[k, i] = _state(ramps, k, phases, t)
    return distance, speed, acceleration


@compiled(SpeedRamps, "float64[:, :]")
def _distances(ramps: SpeedRamps, t_s: FloatArray) -> FloatArray:
    """As SpeedRamps.distance()."""
    distance = np.empty((len(ramps.targets_mps), t_s.shape[1]))
    for k in range(len(distance)):
        phases = _phases(ramps, k)
        for i in range(t_s.shape[1]):
            distance[k, i], _, _ = _state(ramps, k, phases, t_s[min(k, len(t_s) - 1), i])
    return distance
