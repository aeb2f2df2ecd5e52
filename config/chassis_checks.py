"""What must fit between a chassis, the robot's limits and the control rate; config/app.py asks."""

from __future__ import annotations

import math

from config.chassis import (
    COMMAND_EARLY,
    AnyChassisConfig,
    RoboclawChassisConfig,
    RoboteqChassisConfig,
)
from config.robot import Robot

# At a lower rate, encoders, status and voltages would grow stale between their turns.
_ROBOCLAW_RATE_HZ = 40.0


def check_top_speed(robot: Robot, chassis: AnyChassisConfig) -> None:
    """The base must be as fast as the robot may be. Raises ValueError."""
    if robot.limits.max_speed_mps > chassis.top_speed_mps:
        raise ValueError(
            f"robot.limits.max_speed_mps ({robot.limits.max_speed_mps:g}) is more than the base "
            f"makes by its section chassis, {chassis.top_speed_mps:g} m/s"
        )


def check_turns(robot: Robot, chassis: AnyChassisConfig) -> None:
    """The base must be able to turn as fast as the robot may. Raises ValueError.

    The driver slows a turn that the base cannot make, together with the speed, in one step.
    """
    limits = robot.limits
    makes_radps = chassis.top_yaw_rate_radps(limits.max_speed_mps)
    if limits.max_yaw_rate_radps > makes_radps:
        raise ValueError(
            f"robot.limits.max_yaw_rate_radps ({limits.max_yaw_rate_radps:g}) is more than the base makes by "
            f"its section chassis, {makes_radps:.4g} rad/s where it goes at robot.limits.max_speed_mps "
            f"({limits.max_speed_mps:g}): lower the yaw rate, or the speed if that leaves too little"
        )


def check_protocol(robot: Robot, chassis: AnyChassisConfig, rate_hz: float) -> None:
    """What only one kind of motor controller asks for. rate_hz: of the control loop. Raises ValueError."""
    if isinstance(chassis, RoboclawChassisConfig):
        _check_ramp(robot, chassis)
        if rate_hz < _ROBOCLAW_RATE_HZ:
            raise ValueError(
                f"runner.control_rate_hz must be at least {_ROBOCLAW_RATE_HZ:g} with a RoboClaw, "
                "which answers one request an exchange"
            )
    if isinstance(chassis, RoboteqChassisConfig):
        _check_watchdog(chassis, rate_hz)


def _check_ramp(robot: Robot, chassis: RoboclawChassisConfig) -> None:
    """The motor controller must brake as hard as the stopping model assumes. Raises ValueError.

    The outer track of a bend of radius R brakes 1 + width / 2R times as hard as the middle of the robot. No
    bend and no arc is tighter than half the body's width.
    """
    hardest_mps2 = robot.limits.emergency_decel_mps2
    needed_mps2 = hardest_mps2 * (1.0 + chassis.effective_width_m / robot.body.width_m)
    ramp_mps2 = chassis.accel_qpps2 / chassis.counts_per_m
    if ramp_mps2 < needed_mps2:
        raise ValueError(
            f"chassis.accel_qpps2 ({chassis.accel_qpps2}) is a ramp of {ramp_mps2:.3g} m/s2, but to stop at "
            f"robot.limits.emergency_decel_mps2 ({hardest_mps2:g}) the outer track of the tightest bend has "
            f"to slow down at {needed_mps2:.3g} m/s2: the base would stop later than is reckoned with; write "
            f"at least {math.ceil(needed_mps2 * chassis.counts_per_m)}, or lower the limit"
        )


def _check_watchdog(chassis: RoboteqChassisConfig, rate_hz: float) -> None:
    """Commands must follow each other within half of the watchdog. Raises ValueError.

    After a longer pause the driver sends zero first, so it would stop the robot before every command.
    """
    exchange_ms = 1000.0 / rate_hz
    exchanges = math.ceil(COMMAND_EARLY * chassis.command_period_ms / exchange_ms - 1e-9)
    apart_ms = exchange_ms * max(exchanges, 1)
    if 2.0 * apart_ms >= chassis.watchdog_ms:
        raise ValueError(
            f"chassis.watchdog_ms ({chassis.watchdog_ms}) must be more than twice the {apart_ms:g} ms from "
            f"one command to the next (chassis.command_period_ms {chassis.command_period_ms}, a quarter "
            f"early at most, in whole steps of runner.control_rate_hz {rate_hz:g}): raise it, or command "
            "more often"
        )
