"""`treadwatch envelope`: what this robot with this camera can guarantee, in numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from config.app import AppConfig, LockstepRunner
from config.robot import Limits
from controller import braking
from controller.braking import BrakeLimits


@dataclass(frozen=True, slots=True)
class Latency:
    """From light on the sensor until the tracks obey.

    scene_s: age of the scene. period_s: one command period. chassis_s: delay of the chassis.
    """

    scene_s: float
    period_s: float
    chassis_s: float

    @property
    def total_s(self) -> float:
        """The sum: tau in the formulas."""
        return self.scene_s + self.period_s + self.chassis_s


@dataclass(frozen=True, slots=True)
class Paper:
    """Braking distance S_r (eq. 2), stopping time T_t and S_n of Daeef 2020: infinite jerk, no latency."""

    s_r_m: float
    t_t_s: float
    s_n_m: float


@dataclass(frozen=True, slots=True)
class StopTerms:
    """S_n with jerk and latency, split as in S_n = (V + V_o) tau + S + V_o T + margin.

    brake: the limits of the stop.
    stop_m, stop_s: S and T.
    jerk_m, jerk_s: what the jerk limit adds to S and T.
    latency_m, approach_m, margin_m: (V + V_o) tau, V_o T and the margin.
    s_n_m: the sum.
    admits_mps, admits_static_mps: greatest speed for which S_n fits the camera's range, with V_o and with 0.
    """

    brake: BrakeLimits
    stop_m: float
    stop_s: float
    jerk_m: float
    jerk_s: float
    latency_m: float
    approach_m: float
    margin_m: float
    s_n_m: float
    admits_mps: float
    admits_static_mps: float


@dataclass(frozen=True, slots=True)
class Envelope:
    """The stops at top speed before an obstacle that comes at V_omax; the report in numbers."""

    v_mps: float
    obstacle_mps: float
    range_m: float
    latency: Latency
    paper: Paper
    comfort: StopTerms
    emergency: StopTerms


def envelope(limits: Limits, range_m: float, latency: Latency, margin_m: float) -> Envelope:
    """Compute the report. range_m: from the robot's front to where the camera sees for certain."""
    v, v_o, a = limits.max_speed_mps, limits.max_obstacle_speed_mps, limits.max_accel_mps2
    paper = Paper(
        braking.paper_braking_distance(v, a),
        braking.paper_stopping_time(v, a),
        braking.paper_detection_distance(v, v_o, a),
    )
    terms = [
        _terms(brake, v, v_o, range_m, latency.total_s, margin_m)
        for brake in (braking.comfort(limits), braking.emergency(limits))
    ]
    return Envelope(v, v_o, range_m, latency, paper, *terms)


def _terms(
    brake: BrakeLimits, v: float, v_o: float, range_m: float, tau_s: float, margin_m: float
) -> StopTerms:
    stop = braking.stop(v, 0.0, brake)
    admits = [
        braking.speed_for_distance(range_m, brake, latency_s=tau_s, closing_mps=closing, margin_m=margin_m)
        for closing in (v_o, 0.0)
    ]
    return StopTerms(
        brake=brake,
        stop_m=stop.distance_m,
        stop_s=stop.time_s,
        jerk_m=stop.distance_m - braking.paper_braking_distance(v, brake.decel_mps2),
        jerk_s=stop.time_s - braking.paper_stopping_time(v, brake.decel_mps2),
        latency_m=(v + v_o) * tau_s,
        approach_m=v_o * stop.time_s,
        margin_m=margin_m,
        s_n_m=braking.required_distance(v, 0.0, v_o, tau_s, brake, margin_m),
        admits_mps=admits[0],
        admits_static_mps=admits[1],
    )


def envelope_of(config: AppConfig) -> Envelope:
    """The envelope of the robot, camera and runner in a configuration."""
    runner, decision, robot = config.runner, config.decision, config.robot
    # In real time the age is measured. The worst case is the oldest scene with which the robot still drives.
    scene_s = runner.perception_latency_s if isinstance(runner, LockstepRunner) else decision.sight.stale_s
    latency = Latency(scene_s, 1.0 / runner.control_rate_hz, decision.chassis_delay_s)
    sees_m = min(decision.sight.range_m, config.perception.max_depth_m)
    front_m = robot.body.front_m - robot.camera_mount.forward_m
    return envelope(robot.limits, sees_m - front_m, latency, decision.margins.least_m)


def describe_envelope(config: AppConfig) -> Iterator[str]:
    """The report, line by line."""
    result = envelope_of(config)
    paper, tau = result.paper, result.latency
    yield f"At {result.v_mps:g} m/s against an obstacle that approaches at {result.obstacle_mps:g} m/s"
    yield ""
    yield f"Daeef 2020 (deceleration {result.comfort.brake.decel_mps2:g} m/s2, no jerk limit, no latency)"
    yield _row("S_r = V^2 / 2A", paper.s_r_m, "m", "braking distance")
    yield _row("T_t = V / A", paper.t_t_s, "s", "time to stop")
    yield _row("S_n = S_r + V_o T_t", paper.s_n_m, "m", "required detection distance")
    yield ""
    yield (
        f"Latency tau = {tau.total_s:.3f} s: scene {tau.scene_s:.3f} + command period {tau.period_s:.3f} "
        f"+ chassis {tau.chassis_s:.3f}"
    )
    for name, terms in (("Comfort", result.comfort), ("Emergency", result.emergency)):
        yield ""
        yield from _describe(name, terms, result.range_m)
    yield ""
    yield from _not_covered(config)


def _describe(name: str, terms: StopTerms, range_m: float) -> Iterator[str]:
    fits = "within" if terms.s_n_m <= range_m else "BEYOND"
    yield f"{name} braking ({terms.brake.decel_mps2:g} m/s2, {terms.brake.jerk_mps3:g} m/s3)"
    yield _row("S", terms.stop_m, "m", f"of which the jerk limit {terms.jerk_m:.2f} m")
    yield _row("T", terms.stop_s, "s", f"of which the jerk limit {terms.jerk_s:.2f} s")
    yield _row("(V + V_o) tau", terms.latency_m, "m", "travelled by both before it brakes")
    yield _row("V_o T", terms.approach_m, "m", "travelled by the obstacle while it brakes")
    yield _row("margin", terms.margin_m, "m", "kept at standstill")
    yield _row("S_n, the sum", terms.s_n_m, "m", f"{fits} the {range_m:.2f} m that are seen")
    yield _row("V that the range admits", terms.admits_mps, "m/s", "for an obstacle that approaches at V_o")
    yield _row("", terms.admits_static_mps, "m/s", "for an obstacle that stands")


def _row(name: str, value: float, unit: str, note: str) -> str:
    return f"  {name:<24} {round(value, 2):>7g} {unit:<4} {note}"


def _not_covered(config: AppConfig) -> Iterator[str]:
    sight = config.decision.sight
    yield "Not covered: the sides and the rear; what comes into view nearer than S_n; glass and mirrors"
    yield f"that give a false depth; low obstacles nearer than {sight.near_m:g} m to the camera, or below its"
    yield f"view, that were never seen; what is nearer than {config.perception.min_depth_m:g} m; obstacles"
    yield "faster than V_o."
    yield "This is no safety rating: it does not replace a certified detection of persons (ISO 3691-4)"
    yield "nor an emergency stop."
