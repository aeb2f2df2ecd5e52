"""Missions in the plane made of known numbers, for tests of the campaign."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from config.app import AppConfig, load_app
from config.faults import NO_FAULTS, Faults, LateWindow, Window
from config.loader import CONFIG_DIR
from config.path import LineSpec, PathSpec
from config.robot import Robot
from config.scenario import BodySpec, Crate, Go, MotionPlan, RobotBody, Room, Scenario
from controller.campaign.drive_log import DriveLog
from controller.campaign.judge import Row
from controller.campaign.stage import Stage
from controller.decision.decision import Action, Decision, Reason
from controller.record.tally import SetpointTally
from sim.families import Case

CONFIG: AppConfig = load_app(CONFIG_DIR / "sim.yaml")
PERIOD_S = 0.02


def stage(
    *bodies: BodySpec,
    length_m: float = 10.0,
    faults: Faults = NO_FAULTS,
    blocked: bool = False,
    duration_s: float = 60.0,
) -> Stage:
    """A straight path along x from the origin in a wide hall."""
    scenario = Scenario(
        name="made",
        duration_s=duration_s,
        outcome="blocked" if blocked else "target",
        path=PathSpec(segments=(LineSpec(kind="line", length_m=length_m),)),
        room=Room(x_min_m=-30.0, x_max_m=60.0, y_min_m=-30.0, y_max_m=30.0),
        bodies=bodies,
        faults=faults,
    )
    return Stage(Case("made", 1, scenario), Robot())


def silent(start_s: float, end_s: float) -> Faults:
    """No frames from start_s to end_s."""
    return Faults(no_frames=(Window(start_s=start_s, end_s=end_s),))


def frozen(start_s: float, end_s: float) -> Faults:
    """The same image from start_s to end_s."""
    return Faults(frozen_frames=(Window(start_s=start_s, end_s=end_s),))


def late(start_s: float, end_s: float, delay_s: float) -> Faults:
    """Frames of start_s to end_s arrive delay_s late."""
    return Faults(late_frames=(LateWindow(start_s=start_s, end_s=end_s, delay_s=delay_s),))


def crate(
    x_m: float, y_m: float = 0.0, size_m: float = 0.6, height_m: float = 1.0, name: str = "crate"
) -> Crate:
    """Square, along the axes."""
    return Crate(
        kind="crate", name=name, x_m=x_m, y_m=y_m, length_m=size_m, width_m=size_m, height_m=height_m
    )


def mover(
    x_m: float,
    y_m: float,
    to_x_m: float,
    to_y_m: float,
    speed_mps: float,
    start_s: float = 0.0,
    name: str = "mover",
) -> RobotBody:
    """A robot of 1.0 x 1.0 m that goes off at once at full speed (nearly)."""
    heading_deg = math.degrees(math.atan2(to_y_m - y_m, to_x_m - x_m))
    motion = MotionPlan(
        start_s=start_s, accel_mps2=20.0, steps=(Go(kind="go", x_m=to_x_m, y_m=to_y_m, speed_mps=speed_mps),)
    )
    return RobotBody(
        kind="robot",
        name=name,
        x_m=x_m,
        y_m=y_m,
        heading_deg=heading_deg,
        length_m=1.0,
        width_m=1.0,
        height_m=1.0,
        motion=motion,
    )


def log_of(speeds_mps: list[float], period_s: float = PERIOD_S, s_m: float = 0.0) -> DriveLog:
    """A drive along x with these speeds, one a control step."""
    log = DriveLog(SetpointTally(CONFIG.robot.limits, period_s))
    for k, v_mps in enumerate(speeds_mps):
        decision = Decision(Action.KEEP, v_mps, Reason("free", ""))
        log.times_s.append(k * period_s)
        log.poses.append((s_m, 0.0, 0.0))
        log.s_m.append(s_m)
        log.v_mps.append(v_mps)
        log.actions.append(decision.action)
        log.rules.append("made")
        log.sentences.append("")
        s_m += v_mps * period_s
    return log


def made_row(seed: int, **changes: Any) -> Row:
    made = Row(
        "crossing_left", seed, "ours", "noise", reached=True, expected=True, contacts=0, contacts_at_fault=0,
        touched=(), time_s=11.0, oracle_time_s=10.0, min_clearance_m=0.5, max_jerk_mps3=0.6,
        max_accel_mps2=0.3, reversals=0, limit_violations=0, false_stops=0, flaps=0,
    )  # fmt: skip
    return replace(made, **changes)
