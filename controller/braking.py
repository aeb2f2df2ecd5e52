"""The one stopping model: how far and how long a jerk-limited stop takes, from any speed and acceleration.

decide, shape, the speed that the camera's range admits, the envelope report, the campaign's oracle and the
tests all ask this file, so "the distance we brake at >= the distance the profile needs" can be tested.

Plain floats on purpose: nobody needs these for arrays in the control loop (controller/profile.py samples
whole profiles in arrays), and a compiled call costs a fraction of a microsecond.

Symbols: A is the greatest deceleration, J the greatest jerk, tau the latency, V_o the obstacle's own speed
towards the robot. An infinite J with tau = 0 gives the formulas of Daeef 2020 (problem statement).
"""

from __future__ import annotations

import math

from config.robot import Limits
from hal.compiled import compiled, inlined
from hal.records import record

_ROUNDS = 60  # of Newton's method, or of bisection: a double has no more bits
_CONVERGED = 1e-14


@record(frozen=True, slots=True)
class BrakeLimits:
    """How hard a stop may be. jerk_mps3 may be infinite (the paper's model); both must be positive."""

    decel_mps2: float
    jerk_mps3: float

    def __post_init__(self) -> None:
        if not (0 < self.decel_mps2 < math.inf and self.jerk_mps3 > 0):
            raise ValueError(f"limits must be positive: {self.decel_mps2} m/s2, {self.jerk_mps3} m/s3")


@record(frozen=True, slots=True)
class Stop:
    """What a stop takes until standstill."""

    distance_m: float
    time_s: float


def comfort(limits: Limits) -> BrakeLimits:
    """The everyday stop."""
    return BrakeLimits(limits.max_accel_mps2, limits.max_jerk_mps3)


def emergency(limits: Limits) -> BrakeLimits:
    """The hardest stop that the robot is allowed."""
    return BrakeLimits(limits.emergency_decel_mps2, limits.emergency_jerk_mps3)


def stop(v_mps: float, a_mps2: float, limits: BrakeLimits) -> Stop:
    """The shortest stop that ends with v = 0 and a = 0.

    An acceleration outside the limits is first brought inside them. Where the speed is too small to let go of
    a deceleration in time (v < a^2 / 2J, only after a fault), the deceleration drops to zero at standstill:
    the robot never reverses. Raises ValueError for a negative or unknown speed or acceleration.
    """
    distance_m, time_s = _one_stop(v_mps, a_mps2, limits.decel_mps2, limits.jerk_mps3)
    if math.isnan(distance_m):
        raise _unknown(v_mps, a_mps2)
    return Stop(distance_m, time_s)


def required_distance(
    v_mps: float,
    a_mps2: float,
    closing_mps: float,
    latency_s: float,
    limits: BrakeLimits,
    margin_m: float = 0.0,
) -> float:
    """The distance at which something must be seen so that the robot stands before it arrives, in metres.

    S_n = (V + V_o) tau + S(V, a) + V_o T(V, a) + margin. closing_mps: V_o, the obstacle's own speed
    towards the robot; what moves away counts as standing. Raises ValueError as stop(), and for any NaN.
    """
    decel_mps2, jerk_mps3 = limits.decel_mps2, limits.jerk_mps3
    required_m = margin_m + _required_m(v_mps, a_mps2, closing_mps, latency_s, decel_mps2, jerk_mps3)
    if math.isnan(required_m):
        raise _unknown(v_mps, a_mps2, closing_mps, latency_s, margin_m)
    return required_m


def speed_for_distance(
    distance_m: float,
    limits: BrakeLimits,
    *,
    latency_s: float = 0.0,
    closing_mps: float = 0.0,
    margin_m: float = 0.0,
    a_mps2: float = 0.0,
) -> float:
    """The greatest speed with required_distance(...) <= distance_m: its inverse; 0 where none fits.

    a_mps2: the present acceleration. Without it, where A is reached, this is v = -A b + sqrt(A^2 b^2 + 2 A d)
    with b = tau + A / 2J + V_o / A, else the root of a cubic in sqrt(v). Raises ValueError for NaN.
    """
    free_m = distance_m - margin_m
    v_mps = _speed_for(free_m, a_mps2, closing_mps, latency_s, limits.decel_mps2, limits.jerk_mps3)
    if math.isnan(v_mps):
        raise _unknown(distance_m, a_mps2, closing_mps, latency_s, margin_m)
    return v_mps


def slowing_distance(v_mps: float, end_mps: float, limits: BrakeLimits) -> float:
    """From steady v down to steady end_mps <= v: by symmetry the mean speed times the time, in metres."""
    if not 0.0 <= end_mps <= v_mps:
        raise ValueError(f"can only slow down to a speed in 0..{v_mps} m/s, asked for {end_mps}")
    return _slowing_m(v_mps, end_mps, limits.decel_mps2, limits.jerk_mps3)


def speed_before_section(distance_m: float, section_mps: float, limits: BrakeLimits) -> float:
    """The greatest steady speed from which section_mps is met within distance_m. ValueError: below 0, NaN."""
    if not section_mps >= 0.0 or math.isnan(distance_m):
        raise ValueError(f"a section has a place and a speed >= 0, got {distance_m} m, {section_mps} m/s")
    if distance_m <= 0.0:
        return section_mps
    return _before_section(distance_m, section_mps, limits.decel_mps2, limits.jerk_mps3)


def letting_go_distance(v_mps: float, a_mps2: float, limits: BrakeLimits) -> float:
    """How far an accelerating robot comes until its speed is steady, if it lets go of a at once, in metres.

    v T + a^3 / 3J^2 with T = a / J: the terms of a in stop(). 0 for one that brakes.
    """
    if a_mps2 <= 0.0:
        return 0.0
    ease_s = a_mps2 / limits.jerk_mps3
    return v_mps * ease_s + a_mps2 * ease_s * ease_s / 3.0


def paper_braking_distance(v_mps: float, decel_mps2: float) -> float:
    """S_r of Daeef 2020, eq. 2: stop() with infinite jerk."""
    return stop(v_mps, 0.0, BrakeLimits(decel_mps2, math.inf)).distance_m


def paper_stopping_time(v_mps: float, decel_mps2: float) -> float:
    """T_t of Daeef 2020: stop() with infinite jerk."""
    return stop(v_mps, 0.0, BrakeLimits(decel_mps2, math.inf)).time_s


def paper_detection_distance(v_mps: float, closing_mps: float, decel_mps2: float) -> float:
    """S_n of Daeef 2020: required_distance() with infinite jerk, no latency and no margin."""
    return required_distance(v_mps, 0.0, closing_mps, 0.0, BrakeLimits(decel_mps2, math.inf))


def _unknown(*given: float) -> ValueError:
    return ValueError(f"a stop needs a known speed >= 0, acceleration, distances and times, got {given}")


@inlined
def _steady_stop_s(v_mps: float, big_a: float, j: float) -> float:
    """How long from a = 0: a trapezoid of deceleration, or a triangle when A is not reached."""
    reached = v_mps * j >= big_a * big_a
    return v_mps / big_a + big_a / j if reached else 2.0 * math.sqrt(v_mps / j)


@inlined
def _stop_within(v_mps: float, a_mps2: float, big_a: float, j: float) -> tuple[float, float]:
    """Distance and time of stop() from an acceleration within the limits."""
    if a_mps2 < 0.0 and v_mps <= a_mps2 * a_mps2 / (2.0 * j):
        # Easing a < 0 off at J, the robot stands before a has gone.
        time_s = (-a_mps2 - math.sqrt(max(a_mps2 * a_mps2 - 2.0 * j * v_mps, 0.0))) / j
        return v_mps * time_s + a_mps2 * time_s**2 / 2.0 + j * time_s**3 / 6.0, time_s
    speed_at_rest_of_a = v_mps + a_mps2 * a_mps2 / (2.0 * j)
    time_s = _steady_stop_s(speed_at_rest_of_a, big_a, j)
    distance_m = 0.5 * speed_at_rest_of_a * time_s
    return distance_m + a_mps2 * v_mps / j + a_mps2**3 / (3.0 * j * j), time_s + a_mps2 / j


@inlined
def _stop(v_mps: float, a_mps2: float, big_a: float, j: float) -> tuple[float, float]:
    """Distance and time of stop(); NaN from a speed below 0, or from what is not known."""
    if not (0.0 <= v_mps < math.inf and math.isfinite(a_mps2)):
        return math.nan, math.nan
    if math.isinf(j):
        return v_mps * v_mps / (2.0 * big_a), v_mps / big_a
    ease_s = (abs(a_mps2) - big_a) / j
    if ease_s <= 0.0 or (a_mps2 < 0.0 and v_mps <= a_mps2 * a_mps2 / (2.0 * j)):
        return _stop_within(v_mps, a_mps2, big_a, j)
    # First bring the acceleration inside the limits.
    towards = math.copysign(j, a_mps2)
    eased_m = v_mps * ease_s + a_mps2 * ease_s**2 / 2.0 - towards * ease_s**3 / 6.0
    eased_mps = v_mps + a_mps2 * ease_s - towards * ease_s**2 / 2.0
    rest_m, rest_s = _stop_within(max(eased_mps, 0.0), math.copysign(big_a, a_mps2), big_a, j)
    return eased_m + rest_m, ease_s + rest_s


@inlined
def _required(
    v_mps: float, a_mps2: float, towards_mps: float, latency_s: float, big_a: float, j: float
) -> float:
    distance_m, time_s = _stop(v_mps, a_mps2, big_a, j)
    return (v_mps + towards_mps) * latency_s + distance_m + towards_mps * time_s


@inlined
def _slowing(v_mps: float, end_mps: float, big_a: float, j: float) -> float:
    return 0.5 * (v_mps + end_mps) * _steady_stop_s(v_mps - end_mps, big_a, j)


@inlined
def _solve_from_steady(
    linear_s: float, towards_mps: float, constant_m: float, big_a: float, j: float
) -> float:
    """The u >= 0 with S_0(u) + linear_s u + V_o T_0(u) + constant_m = 0."""
    b = linear_s + big_a / (2.0 * j) + towards_mps / big_a
    c = constant_m + towards_mps * big_a / j
    discriminant = big_a * big_a * b * b - 2.0 * big_a * c
    if discriminant >= 0.0:
        u = -big_a * b + math.sqrt(discriminant)
        if u * j >= big_a * big_a:
            return u
    # A is not reached: x^3 / sqrt(J) + linear x^2 + 2 V_o x / sqrt(J) + constant = 0 with x = sqrt(u).
    root_j = math.sqrt(j)
    low, high = 0.0, big_a / root_j
    x = high
    for _ in range(_ROUNDS):
        value = ((x / root_j + linear_s) * x + 2.0 * towards_mps / root_j) * x + constant_m
        slope = (3.0 * x / root_j + 2.0 * linear_s) * x + 2.0 * towards_mps / root_j
        low, high = (low, x) if value > 0.0 else (x, high)
        newton = x - value / slope if slope > 0.0 else low
        following = newton if low <= newton <= high else 0.5 * (low + high)
        if abs(following - x) <= _CONVERGED:
            break
        x = following
    return x * x


@inlined
def _bisect_speed(
    free_m: float, a_mps2: float, towards_mps: float, latency_s: float, big_a: float, j: float
) -> float:
    """The rare states: the law is not one closed form, but it still grows with the speed."""
    # high is an upper bound of the speed: easing the acceleration off sheds a^2 / J at most, and a stop from
    # the rest takes v^2 / 2A, more than free_m. free_m is negative only by rounding.
    low, high = 0.0, math.sqrt(2.0 * big_a * max(free_m, 0.0)) + abs(a_mps2) + a_mps2**2 / j
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        if _required(middle, a_mps2, towards_mps, latency_s, big_a, j) <= free_m:
            low = middle
        else:
            high = middle
    return low


@compiled("float64, float64, float64, float64")
def _one_stop(v_mps: float, a_mps2: float, big_a: float, j: float) -> tuple[float, float]:
    return _stop(v_mps, a_mps2, big_a, j)


@compiled("float64, float64, float64, float64, float64, float64")
def _required_m(
    v_mps: float, a_mps2: float, closing_mps: float, latency_s: float, big_a: float, j: float
) -> float:
    return _required(v_mps, a_mps2, max(closing_mps, 0.0), latency_s, big_a, j)


@compiled("float64, float64, float64, float64")
def _slowing_m(v_mps: float, end_mps: float, big_a: float, j: float) -> float:
    return _slowing(v_mps, end_mps, big_a, j)


@compiled("float64, float64, float64, float64, float64, float64")
def _speed_for(
    free_m: float, a_mps2: float, closing_mps: float, latency_s: float, big_a: float, j: float
) -> float:
    """speed_for_distance() without a margin; NaN where anything is."""
    if math.isnan(free_m) or math.isnan(a_mps2) or math.isnan(closing_mps) or math.isnan(latency_s):
        return math.nan
    towards_mps = max(closing_mps, 0.0)
    # What comes nearer during the latency is lost even to a standing robot; infinite values leave no speed.
    if not (free_m > towards_mps * latency_s and towards_mps + latency_s < math.inf):
        return 0.0
    if abs(a_mps2) > big_a:
        return _bisect_speed(free_m, a_mps2, towards_mps, latency_s, big_a, j)
    # In terms of u = v + a^2 / 2J, every a adds only a linear term and a constant to the law for a = 0.
    extra_s = latency_s + a_mps2 / j
    shift_mps = a_mps2 * a_mps2 / (2.0 * j)
    constant_m = a_mps2**3 / (3.0 * j * j) - extra_s * shift_mps + towards_mps * extra_s - free_m
    speed = _solve_from_steady(extra_s, towards_mps, constant_m, big_a, j) - shift_mps
    if a_mps2 < 0.0 and speed < shift_mps:
        return _bisect_speed(free_m, a_mps2, towards_mps, latency_s, big_a, j)
    return max(speed, 0.0)


@compiled("float64, float64, float64, float64")
def _before_section(distance_m: float, section_mps: float, big_a: float, j: float) -> float:
    low, high = section_mps, section_mps + math.sqrt(2.0 * big_a * distance_m)
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        if _slowing(middle, section_mps, big_a, j) <= distance_m:
            low = middle
        else:
            high = middle
    return low
