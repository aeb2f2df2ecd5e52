"""Drives along a path in real time; called by controller/mission/command.py."""

from __future__ import annotations

from config.app import AppConfig, RealtimeRunner
from config.chassis import AgilexChassisConfig, AnyChassisConfig, CanLinkConfig
from controller.base.drive_lifecycle import Outcome
from controller.build import build_control
from controller.mission.options import MissionOptions
from controller.mission.result import MissionResult
from controller.mission.summary import report
from controller.realtime.rig import realtime_rig
from controller.record.tally import SetpointTally
from controller.terminal.console import Console
from hal.errors import DeviceRefused
from hal.types import ChassisMode


def drive_realtime(
    config: AppConfig, runner: RealtimeRunner, options: MissionOptions, console: Console
) -> MissionResult:
    """Drive the mission. Raises ConfigError, HalError or UserError only if nothing has moved."""
    with realtime_rig(config, runner, options.recording()) as rig:
        loop = build_control(config, rig.chassis)
        result = MissionResult(
            loop=loop,
            setpoints=SetpointTally(config.robot.limits, 1.0 / runner.control_rate_hz),
            simulation=rig.simulation,
            punctuality=rig.punctuality,
            cut_off=rig.cut_off,
        )
        was_armed = False
        with rig.under_way(loop, console, lambda service: service.ready("driving")) as moments:
            for moment in moments:
                result.take(moment.control)
                was_armed = was_armed or moment.control.chassis.mode is ChassisMode.ARMED
                for message in moment.arrived:
                    result.take_message(message)
                report(console, result, moment.control)
    if loop.lifecycle.outcome in (Outcome.NOT_ARMED, Outcome.CHASSIS_FAULT) and not was_armed:
        raise DeviceRefused(
            f"{describe_base(config.chassis)}: {loop.lifecycle.stop_reason}; nothing has moved"
        )
    return result


def describe_base(chassis: AnyChassisConfig) -> str:
    """The kind of base and its link as configured, for messages."""
    link = chassis.link
    kind = f"{chassis.kind} {chassis.model}" if isinstance(chassis, AgilexChassisConfig) else chassis.kind
    if isinstance(link, CanLinkConfig):
        return f"{kind} on CAN {link.interface} {link.channel!r}"
    return f"{kind} on serial port {link.url} at {link.baud} baud"
