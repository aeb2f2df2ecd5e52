"""What is printed of a drive: reports while it goes on, and the summary at its end."""

from __future__ import annotations

import math

import numpy as np

from config.app import AppConfig
from controller.base.drive_lifecycle import Outcome
from controller.control import ControlStep
from controller.mission.result import DriveResult, MissionResult
from controller.realtime.runner import Punctuality
from controller.record.tally import FrameTally, SetpointTally, TimingTally, mean_speed_mps
from controller.terminal.console import STUCK_S, Console
from sim.simulation import Simulation


def report(console: Console, result: MissionResult, step: ControlStep) -> None:
    """Print one control step: progress, a new decision, a long standstill, new complaints of the base."""
    length_m, stops = result.loop.path.length_m, result.loop.lifecycle.stop_reason
    does = (
        f"{step.decision.action.value}: {step.decision.reason.sentence}"
        if stops is None
        else f"stops: {stops}"
    )
    console.progress(
        step.progress_m / length_m,
        f"{step.progress_m:5.1f}/{length_m:.1f} m  {step.setpoint.v_mps:4.2f} m/s  {does}",
    )
    seconds = result.seconds(step)
    if stops is None:
        console.decision(seconds, step.decision, step.setpoint.v_mps)
        console.standing(seconds, result.standstill.elapsed_s(step.now_ns), step.decision)
    else:
        console.stopping(seconds, step.setpoint.v_mps, stops)
    console.unanswered(seconds, step.unanswered)
    console.complaints(seconds, result.complaints.add(step.chassis.faults), step.chassis.battery_v)


def summary_rows(config: AppConfig, result: MissionResult) -> list[tuple[str, str]]:
    """The summary as (subject, text)."""
    rows = [("mission", _mission_text(config, result)), ("target", _target_text(result))]
    if result.last is not None and result.loop.lifecycle.outcome is not Outcome.REACHED:
        stood_s = result.standstill.elapsed_s(result.last.now_ns)
        if stood_s >= STUCK_S:
            rows.append(("standing", f"for the last {stood_s:.1f} s: {result.last.decision.reason.sentence}"))
    rows.extend(drive_rows(config, result))
    if math.isfinite(result.wall_s):
        ratio = result.duration_s / result.wall_s
        rows.append(
            (
                "speed",
                f"{result.duration_s:.1f} s simulated in {result.wall_s:.1f} s: {ratio:.2f} x real time",
            )
        )
    return rows


def drive_rows(config: AppConfig, result: DriveResult) -> list[tuple[str, str]]:
    """The part of the summary that every drive has, as (subject, text)."""
    rows = []
    if result.simulation is not None:
        rows.append(("contacts", _contact_text(result.simulation)))
    rows.append(("limits", _limits_text(config, result.setpoints)))
    if result.shaper_faults.count:
        rows.append(("shaper", result.shaper_faults.line()))
    if result.complaints.reported:
        rows.append(("base", result.complaints.line()))
    rows += perception_rows(result.timing, result.frames, result.cut_off)
    if result.punctuality is not None and result.punctuality.late_ns:
        rows.append(("control", _punctuality_text(result.punctuality)))
    return rows


def perception_rows(timing: TimingTally, frames: FrameTally, cut_off: list[str]) -> list[tuple[str, str]]:
    """How long perception took, which frames it has left out, and why outputs are not whole."""
    rows = [("perception", timing.line())]
    if frames.line():
        rows.append(("frames", frames.line()))
    return rows + [("cut off", reason) for reason in cut_off]


def _punctuality_text(punctuality: Punctuality) -> str:
    """How late the control steps began."""
    late_ms = np.array(punctuality.late_ns) / 1e6
    return (
        f"steps began {np.median(late_ms):.2f} ms late (median), {np.percentile(late_ms, 99):.2f} ms (p99), "
        f"{late_ms.max():.2f} ms at worst; {punctuality.skipped} of {punctuality.steps} skipped"
    )


def _mission_text(config: AppConfig, result: MissionResult) -> str:
    outcome = result.loop.lifecycle.outcome
    over = f"given up: runner.max_duration_s of {config.runner.max_duration_s} s is over"
    ended = over if outcome is None else outcome.value
    if outcome is not Outcome.REACHED and result.loop.lifecycle.stop_reason:
        ended += f" ({result.loop.lifecycle.stop_reason})"
    length_m = 0.0 if result.last is None else result.last.progress_m
    mean = mean_speed_mps(length_m, result.duration_s)
    where = (
        "" if config.simulation is None else f"{config.simulation.scenario}, seed {config.simulation.seed}: "
    )
    return f"{where}{ended}; {length_m:.2f} m in {result.duration_s:.1f} s, {mean:.2f} m/s on average"


def _target_text(result: MissionResult) -> str:
    if result.last is None:
        return "not known"
    left_m = result.loop.path.length_m - result.last.progress_m
    beside_m = abs(result.last.lateral_m)
    text = f"{length_text(left_m, '+')} to go by odometry, {length_text(beside_m)} beside the path"
    if result.simulation is not None:
        target = result.loop.path.pose(result.loop.path.length_m)
        truth = result.simulation.body_pose
        off_m = math.hypot(target.x_m - truth.x_m, target.y_m - truth.y_m)
        text += f"; true distance to the target point {length_text(off_m)}"
    return text


def length_text(length_m: float, sign: str = "") -> str:
    """A length in centimetres, or in metres from one metre on. sign: "+" writes a plus sign, too."""
    if round(abs(length_m), 3) < 1.0:
        return f"{100.0 * length_m:{sign}.1f} cm"
    return f"{length_m:{sign}.2f} m"


def _contact_text(simulation: Simulation) -> str:
    """What was touched, and the nearest approach."""
    referee = simulation.referee
    count = len(referee.contacts)
    text = f"{count}" + (f" with {', '.join(referee.contacts)}" if count else "")
    if referee.closest is not None:
        text += f"; closest {referee.closest.distance_m:.2f} m to {referee.closest.name}"
    return text


def _limits_text(config: AppConfig, tally: SetpointTally) -> str:
    """Whether the setpoints that were sent kept the limits."""
    limits = config.robot.limits
    kept = "kept" if tally.violations == 0 else f"broken {tally.violations} times"
    return (
        f"{kept} in {tally.count} setpoints sent: v <= {tally.max_speed_mps:.3f} m/s, "
        f"|a| <= {tally.max_accel_mps2:.3f} m/s^2, |jerk| <= {tally.max_jerk_mps3:.3f} m/s^3 "
        f"(comfort {limits.max_accel_mps2:g}, {limits.max_jerk_mps3:g}; "
        f"{_beyond_comfort(tally)}), {tally.reversals} reversals"
    )


def _beyond_comfort(tally: SetpointTally) -> str:
    if not tally.emergency_count:
        return "kept by all"
    by = f"{tally.hard_braking_count} braked harder, {tally.high_jerk_count} had more jerk"
    return f"{tally.emergency_count} setpoints beyond: {by}"
