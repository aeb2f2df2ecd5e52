"""Where a mover is at any time: a pure function of time, so that ground truth exists for every instant."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.scenario import Go, MotionPlan
from hal.geometry import wrap_angle_rad
from hal.types import FloatArray, PlanarPose

# Sharper corners are not rounded: the mover stops and turns on the spot.
_ROUNDED_CORNER_RAD = math.radians(60.0)
# How far before and after a rounded corner the heading changes.
_CORNER_RADIUS_M = 0.3


@dataclass(frozen=True, slots=True)
class MotionState:
    """Pose on the floor, velocity along the floor's axes, and the distance covered so far."""

    x_m: float
    y_m: float
    heading_rad: float
    vx_mps: float
    vy_mps: float
    yaw_rate_radps: float
    distance_m: float

    @property
    def speed_mps(self) -> float:
        """Magnitude of the velocity."""
        return math.hypot(self.vx_mps, self.vy_mps)


@dataclass(frozen=True, slots=True)
class _Leg:
    """A straight run between two points, or without a length a place to stand or to turn on the spot.

    turn_in_rad, turn_out_rad: half of the corner at its beginning and at its end, if that is rounded, else 0.
    """

    x_m: float
    y_m: float
    heading_rad: float
    length_m: float = 0.0
    cruise_mps: float = 0.0
    turn_in_rad: float = 0.0
    turn_out_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class _Phase:
    """A phase of constant acceleration along a leg, or of constant yaw rate on the spot."""

    start_s: float
    leg: _Leg
    along_m: float
    speed_mps: float
    accel_mps2: float
    yaw_rate_radps: float
    heading_rad: float
    distance_before_m: float


class Trajectory:
    """A motion plan from a start pose, divided once into phases of constant acceleration."""

    def __init__(self, start: PlanarPose, motion: MotionPlan | None, shift_s: float = 0.0) -> None:
        """shift_s moves the plan in time (the seed's jitter)."""
        self._phases: list[_Phase] = []
        self._cursor = start
        self._distance_m = 0.0
        self._time_s = -math.inf
        self._add_standstill(start.heading_rad)
        if motion is not None:
            self._time_s = motion.start_s + shift_s
            self._plan(motion)
        self._starts = [phase.start_s for phase in self._phases]
        self._phase_table: tuple[FloatArray, NDArray[np.bool_]] | None = None

    def at(self, t_s: float) -> MotionState:
        """The state at t_s. Before the first step the mover stands at the start, after the last at the
        end."""
        phase = self._phases[max(bisect_right(self._starts, t_s) - 1, 0)]
        leg = phase.leg
        dt_s = t_s - phase.start_s if math.isfinite(phase.start_s) else 0.0
        speed = phase.speed_mps + phase.accel_mps2 * dt_s
        travelled_m = phase.speed_mps * dt_s + 0.5 * phase.accel_mps2 * dt_s * dt_s
        along_m = phase.along_m + travelled_m
        c, s = math.cos(leg.heading_rad), math.sin(leg.heading_rad)
        if phase.yaw_rate_radps != 0.0 or leg.length_m == 0.0:
            heading, yaw_rate = phase.heading_rad + phase.yaw_rate_radps * dt_s, phase.yaw_rate_radps
        else:
            heading, yaw_rate = _rounded_heading(leg, along_m, speed)
        return MotionState(
            x_m=leg.x_m + along_m * c,
            y_m=leg.y_m + along_m * s,
            heading_rad=wrap_angle_rad(heading),
            vx_mps=speed * c,
            vy_mps=speed * s,
            yaw_rate_radps=yaw_rate,
            distance_m=phase.distance_before_m + travelled_m,
        )

    def sample(self, times_s: FloatArray) -> FloatArray:
        """The same as at() for times_s (T,), as (T, 5): x, y, heading, vx, vy."""
        phase = np.maximum(np.searchsorted(self._starts, times_s, side="right") - 1, 0)
        table, rounded = self._table()
        start, x, y, c, s, along, speed, accel, heading, yaw_rate = table[phase].T
        elapsed = np.where(np.isfinite(start), times_s - start, 0.0)
        along = along + (speed * elapsed + 0.5 * accel * elapsed * elapsed)
        speed = speed + accel * elapsed
        heading = heading + yaw_rate * elapsed
        for k in np.flatnonzero(rounded[phase]).tolist():
            heading[k] = _rounded_heading(self._phases[phase[k]].leg, float(along[k]), float(speed[k]))[0]
        wrapped = (heading + math.pi) % (2.0 * math.pi) - math.pi
        return np.stack((x + along * c, y + along * s, wrapped, speed * c, speed * s), axis=1)

    def _table(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The phases as numbers, (P, 10), and the phases (P,) in which the heading changes along the way."""
        if self._phase_table is None:
            rows, rounded = [], []
            for phase in self._phases:
                leg = phase.leg
                c, s = math.cos(leg.heading_rad), math.sin(leg.heading_rad)
                turns = phase.yaw_rate_radps != 0.0 or leg.length_m == 0.0
                heading = phase.heading_rad if turns else leg.heading_rad
                rows.append(
                    (
                        phase.start_s,
                        leg.x_m,
                        leg.y_m,
                        c,
                        s,
                        phase.along_m,
                        phase.speed_mps,
                        phase.accel_mps2,
                        heading,
                        phase.yaw_rate_radps,
                    )
                )
                rounded.append(not turns and (leg.turn_in_rad != 0.0 or leg.turn_out_rad != 0.0))
            self._phase_table = np.array(rows), np.array(rounded)
        return self._phase_table

    @property
    def end_s(self) -> float:
        """When the last step ends; -inf for a body that never moves."""
        return self._phases[-1].start_s

    def _plan(self, motion: MotionPlan) -> None:
        run: list[Go] = []
        for step in motion.steps:
            if isinstance(step, Go):
                run.append(step)
                continue
            self._add_run(run, motion)
            run = []
            self._add_standstill(self._cursor.heading_rad)
            self._time_s += step.duration_s
        self._add_run(run, motion)
        self._add_standstill(self._cursor.heading_rad)

    def _add_standstill(self, heading_rad: float) -> None:
        self._add(_Leg(self._cursor.x_m, self._cursor.y_m, heading_rad))

    def _add(
        self,
        leg: _Leg,
        along_m: float = 0.0,
        speed_mps: float = 0.0,
        accel_mps2: float = 0.0,
        yaw_rate_radps: float = 0.0,
    ) -> None:
        """Add a phase that begins now."""
        phase = _Phase(
            start_s=self._time_s,
            leg=leg,
            along_m=along_m,
            speed_mps=speed_mps,
            accel_mps2=accel_mps2,
            yaw_rate_radps=yaw_rate_radps,
            heading_rad=self._cursor.heading_rad,
            distance_before_m=self._distance_m,
        )
        self._phases.append(phase)

    def _add_run(self, run: list[Go], motion: MotionPlan) -> None:
        legs = self._legs(run)
        turn_rate = math.radians(motion.turn_rate_degps)
        junctions = _junction_speeds(legs, motion.accel_mps2)
        for index, leg in enumerate(legs):
            if leg.turn_in_rad == 0.0:
                self._turn_to(leg, turn_rate)
            self._add_leg(leg, junctions[index], junctions[index + 1], motion.accel_mps2)

    def _legs(self, run: list[Go]) -> list[_Leg]:
        """The runs between distinct points, with every corner up to the limit rounded."""
        corners = [(self._cursor.x_m, self._cursor.y_m)]
        speeds: list[float] = []
        for step in run:
            if math.hypot(step.x_m - corners[-1][0], step.y_m - corners[-1][1]) > 1e-9:
                corners.append((step.x_m, step.y_m))
                speeds.append(step.speed_mps)
        pairs = list(itertools.pairwise(corners))
        headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairs]
        turns = [wrap_angle_rad(b - a) for a, b in itertools.pairwise(headings)]
        halves = [0.0, *(0.5 * turn if abs(turn) <= _ROUNDED_CORNER_RAD else 0.0 for turn in turns), 0.0]
        return [
            _Leg(a[0], a[1], headings[i], math.dist(a, b), speeds[i], halves[i], halves[i + 1])
            for i, (a, b) in enumerate(pairs)
        ]

    def _turn_to(self, leg: _Leg, turn_rate_radps: float) -> None:
        turn = wrap_angle_rad(leg.heading_rad - self._cursor.heading_rad)
        if abs(turn) > 1e-6:
            spot = _Leg(leg.x_m, leg.y_m, leg.heading_rad)
            self._add(spot, yaw_rate_radps=math.copysign(turn_rate_radps, turn))
            self._time_s += abs(turn) / turn_rate_radps
        self._cursor = PlanarPose(leg.x_m, leg.y_m, leg.heading_rad)

    def _add_leg(self, leg: _Leg, entry_mps: float, exit_mps: float, accel: float) -> None:
        peak = min(leg.cruise_mps, math.sqrt(accel * leg.length_m + 0.5 * (entry_mps**2 + exit_mps**2)))
        up_m = (peak**2 - entry_mps**2) / (2.0 * accel)
        down_m = (peak**2 - exit_mps**2) / (2.0 * accel)
        start_m = self._distance_m
        for along_m, speed, rate, duration_s in (
            (0.0, entry_mps, accel, (peak - entry_mps) / accel),
            (up_m, peak, 0.0, (leg.length_m - up_m - down_m) / peak),
            (leg.length_m - down_m, peak, -accel, (peak - exit_mps) / accel),
        ):
            if duration_s > 1e-12:
                self._distance_m = start_m + along_m
                self._add(leg, along_m, speed, rate)
                self._time_s += duration_s
        self._distance_m = start_m + leg.length_m
        c, s = math.cos(leg.heading_rad), math.sin(leg.heading_rad)
        self._cursor = PlanarPose(
            leg.x_m + leg.length_m * c,
            leg.y_m + leg.length_m * s,
            wrap_angle_rad(leg.heading_rad),
        )


def _junction_speeds(legs: list[_Leg], accel: float) -> list[float]:
    """The speeds at the ends of the legs that both neighbours allow and the acceleration can reach."""
    speeds = [0.0]
    for before, after in itertools.pairwise(legs):
        speeds.append(min(before.cruise_mps, after.cruise_mps) if after.turn_in_rad != 0.0 else 0.0)
    speeds.append(0.0)
    # Going straight on is a corner of zero, which does not need a stop.
    for index, (before, after) in enumerate(itertools.pairwise(legs)):
        if abs(wrap_angle_rad(after.heading_rad - before.heading_rad)) < 1e-9:
            speeds[index + 1] = min(before.cruise_mps, after.cruise_mps)
    for index, leg in enumerate(legs):
        reachable = math.sqrt(speeds[index] ** 2 + 2.0 * accel * leg.length_m)
        speeds[index + 1] = min(speeds[index + 1], reachable)
    for index in range(len(legs) - 1, -1, -1):
        reachable = math.sqrt(speeds[index + 1] ** 2 + 2.0 * accel * legs[index].length_m)
        speeds[index] = min(speeds[index], reachable)
    return speeds


def _rounded_heading(leg: _Leg, along_m: float, speed: float) -> tuple[float, float]:
    """Heading and yaw rate on a leg. Half of a rounded corner is turned before the corner, half after it."""
    radius = min(_CORNER_RADIUS_M, 0.5 * leg.length_m)
    remaining_m = leg.length_m - along_m
    if leg.turn_in_rad != 0.0 and along_m < radius:
        rate_per_m = leg.turn_in_rad / radius
        return leg.heading_rad - leg.turn_in_rad + rate_per_m * along_m, rate_per_m * speed
    if leg.turn_out_rad != 0.0 and remaining_m < radius:
        rate_per_m = leg.turn_out_rad / radius
        return leg.heading_rad + leg.turn_out_rad - rate_per_m * remaining_m, rate_per_m * speed
    return leg.heading_rad, 0.0
