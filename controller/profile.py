"""What the speed will be: jerk-limited ramps from the present state to many target speeds, in arrays.

The law is that of ruckig's velocity interface and of controller/braking.py (a ramp to 0 is the stop), so what
the decision foresees is what the shaper will drive.
"""

from __future__ import annotations

import math

import numpy as np

from config.robot import Limits
from controller.braking import BrakeLimits
from controller.decision.limits import Motion
from hal.types import FloatArray

_STANDING_MPS = 1e-9


class SpeedRamps:
    """N ramps: hold v for latency_s, then reach each target speed in the shortest time, then keep it.

    targets_mps: (N,) >= 0. v_mps, a_mps2: scalars or (N,). accel_mps2 and decel_mps2 bound the ramps up and
    down (a present acceleration outside them is held, not cut), jerk_mps3 both.
    """

    def __init__(
        self,
        v_mps: float | FloatArray,
        a_mps2: float | FloatArray,
        targets_mps: FloatArray,
        *,
        accel_mps2: float,
        decel_mps2: float,
        jerk_mps3: float,
        latency_s: float = 0.0,
    ) -> None:
        # Columns (N, 1): what is asked for are tables of N ramps at K times.
        target = targets_mps[:, None]
        v, a = np.empty(target.shape), np.empty(target.shape)
        v[:, 0], a[:, 0] = v_mps, a_mps2
        # Up or down, judged by the speed that remains when a has been let go of.
        sign = np.where(target >= v + a * np.abs(a) / (2.0 * jerk_mps3), 1.0, -1.0)
        start = sign * a
        bound = np.maximum(np.where(sign > 0.0, accel_mps2, decel_mps2), start)
        wanted = sign * (target - v)
        peak = np.minimum(np.sqrt(np.maximum(jerk_mps3 * wanted + start * start / 2.0, 0.0)), bound)
        self._t1 = np.maximum(peak - start, 0.0) / jerk_mps3
        self._t3 = peak / jerk_mps3
        in_ramps = (2.0 * peak * peak - start * start) / (2.0 * jerk_mps3)
        self._t2 = np.where(peak > 0.0, np.maximum(wanted - in_ramps, 0.0) / np.maximum(peak, 1e-12), 0.0)
        self._v, self._a, self._target = v, a, target
        self._jerk, self._peak = sign * jerk_mps3, sign * peak
        self._v1 = v + a * self._t1 + self._jerk * self._t1**2 / 2.0
        self._v2 = self._v1 + self._peak * self._t2
        self._latency_s = latency_s

    @property
    def duration_s(self) -> FloatArray:
        """(N,) until the target speed is reached, latency included."""
        duration: FloatArray = self._latency_s + self._t1 + self._t2 + self._t3
        return duration[:, 0]

    def state(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance m, speed m/s and acceleration m/s^2 after t_s: (N, K), or (1, K) for the same times of
        all ramps; all results are (N, K)."""
        phases = self._split(t_s)
        _, x1, x2, x3, _ = phases
        a, j, peak = self._a, self._jerk, self._peak
        speed = self._v + a * x1 + j * x1**2 / 2.0 + peak * (x2 + x3) - j * x3**2 / 2.0
        acceleration = np.where(x2 + x3 > 0.0, peak - j * x3, a + j * x1)
        return self._distance(*phases), np.maximum(speed, 0.0), acceleration

    def distance(self, t_s: FloatArray) -> FloatArray:
        """(N, K) distance m after t_s: (N, K) or (1, K)."""
        return self._distance(*self._split(t_s))

    def _distance(
        self, held: FloatArray, x1: FloatArray, x2: FloatArray, x3: FloatArray, x4: FloatArray
    ) -> FloatArray:
        j, peak = self._jerk, self._peak
        distance: FloatArray = (
            self._v * (held + x1)
            + self._a * x1**2 / 2.0
            + j * x1**3 / 6.0
            + self._v1 * x2
            + peak * x2**2 / 2.0
            + self._v2 * x3
            + peak * x3**2 / 2.0
            - j * x3**3 / 6.0
            + self._target * x4
        )
        return distance

    def _split(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """How long each phase has lasted at t_s: latency, jerk, constant, jerk back, done."""
        t1, t2, t3 = self._t1, self._t2, self._t3
        held = np.minimum(t_s, self._latency_s)
        rest = t_s - held
        x1 = np.minimum(rest, t1)
        after = rest - t1
        x2 = np.minimum(np.maximum(after, 0.0), t2)
        after = after - t2
        x3 = np.minimum(np.maximum(after, 0.0), t3)
        return held, x1, x2, x3, np.maximum(after - t3, 0.0)


def comfortable(limits: Limits, motion: Motion, targets_mps: FloatArray) -> SpeedRamps:
    """From now on, within the everyday limits, to targets_mps (N,)."""
    return SpeedRamps(
        motion.v_mps,
        motion.a_mps2,
        targets_mps,
        accel_mps2=limits.max_accel_mps2,
        decel_mps2=limits.max_accel_mps2,
        jerk_mps3=limits.max_jerk_mps3,
        latency_s=motion.latency_s,
    )


def stop_step(v_mps: float, a_mps2: float, limits: BrakeLimits, dt_s: float) -> tuple[float, float]:
    """Speed and acceleration dt_s into the stop of braking.stop; never below zero speed."""
    lets_go = a_mps2 < 0.0 and v_mps <= a_mps2 * a_mps2 / (2.0 * limits.jerk_mps3)
    if lets_go or a_mps2 < -limits.decel_mps2:
        a = min(a_mps2 + limits.jerk_mps3 * dt_s, 0.0 if lets_go else -limits.decel_mps2)
        v = v_mps + (a_mps2 + a) / 2.0 * dt_s
        return (v, a) if v > 0.0 else (0.0, 0.0)
    ramp = SpeedRamps(
        v_mps,
        a_mps2,
        np.zeros(1),
        accel_mps2=math.inf,
        decel_mps2=limits.decel_mps2,
        jerk_mps3=limits.jerk_mps3,
    )
    _, speed, acceleration = ramp.state(np.full((1, 1), dt_s))
    v, a = float(speed[0, 0]), float(acceleration[0, 0])
    return (v, a) if v > _STANDING_MPS else (0.0, 0.0)
