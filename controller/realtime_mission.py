"""A drive in real time: start the perception process, step the control loop, end in an orderly way."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing.process import BaseProcess
from pathlib import Path as FilePath

from config.app import AppConfig, RealtimeRunner
from config.chassis import AgilexChassisConfig, AnyChassisConfig, CanLinkConfig
from controller.build import build_control, build_path, build_simulation
from controller.build_chassis import build_base
from controller.channel import Channel, channel_sockets
from controller.console import Console
from controller.ending import Outcome
from controller.perception_process import perceive_forever
from controller.punctual import PunctualChassis
from controller.realtime import PerceptionLink, Punctuality, run_realtime
from controller.recorder import RecordingOptions
from controller.result import MissionOptions, MissionResult
from controller.scheduling import become_realtime
from controller.service import ServiceManager, stop_on_signals
from controller.summary import report
from controller.tally import SetpointTally, TimingTally
from controller.workers import held_ctrl_c
from hal.clocks import NS_PER_S, MonotonicClock
from hal.errors import DeviceRefused
from hal.types import ChassisMode

# The perception process needs a moment to import and open the camera; a simulated world starts after that.
HEAD_START_S = 3.0
GOODBYE_S = 5.0


def drive_realtime(
    config: AppConfig, runner: RealtimeRunner, options: MissionOptions, console: Console
) -> MissionResult:
    """Drive on the machine's clock. Raises ConfigError, HalError, UserError, and nothing has moved then."""
    clock = MonotonicClock()
    start_ns = clock.now_ns() + round(HEAD_START_S * NS_PER_S)
    path = build_path(config, options.config_path)
    chassis, emulator = build_base(config, path.start, clock.now_ns())
    simulation = None
    if emulator is not None:
        simulation = build_simulation(config, options.config_path, emulator, start_ns)
    service = ServiceManager(os.environ, os.getpid())
    recording = RecordingOptions(options.observations, options.video)
    punctuality = Punctuality()
    with ExitStack() as devices:
        if simulation is not None:
            devices.enter_context(simulation)
        period_ns = round(NS_PER_S / runner.control_rate_hz)
        punctual = devices.enter_context(PunctualChassis(chassis, clock, period_ns))
        loop = build_control(config, options.config_path, punctual)
        link = devices.enter_context(perception_beside(config, options.config_path, start_ns, recording))
        stop = devices.enter_context(stop_on_signals())
        result = MissionResult(
            loop,
            SetpointTally(config.robot.limits, 1.0 / runner.control_rate_hz),
            TimingTally(),
            simulation=simulation,
            punctuality=punctuality,
        )
        # Last, so that the processes and threads started before keep ordinary scheduling.
        for refused in become_realtime(runner.priority):
            console.event(f"not permitted, running without: {refused}")
        moments = run_realtime(runner, clock, simulation, link, loop, service, stop, punctuality)
        told_ready = told_stopping = was_armed = False
        for moment in moments:
            result.take(moment.control)
            was_armed = was_armed or moment.control.chassis.mode is ChassisMode.ARMED
            for message in moment.arrived:
                result.timing.add(message.timing_ms)
            if link.newest is not None and not told_ready:
                told_ready = True
                service.ready("driving")
            if loop.ending.stop_reason is not None and not told_stopping:
                told_stopping = True
                service.stopping(loop.ending.stop_reason)
            report(console, result, moment.control)
    if loop.ending.outcome in (Outcome.NOT_ARMED, Outcome.CHASSIS_FAULT) and not was_armed:
        raise DeviceRefused(f"{describe_base(config.chassis)}: {loop.ending.stop_reason}; nothing has moved")
    return result


def describe_base(chassis: AnyChassisConfig) -> str:
    """What was tried: the kind of base, and the link as configured."""
    link = chassis.link
    kind = f"{chassis.kind} {chassis.model}" if isinstance(chassis, AgilexChassisConfig) else chassis.kind
    if isinstance(link, CanLinkConfig):
        return f"{kind} on CAN {link.interface} {link.channel!r}"
    return f"{kind} on serial port {link.url} at {link.baud} baud"


@contextmanager
def perception_beside(
    config: AppConfig, config_path: FilePath, start_ns: int, recording: RecordingOptions
) -> Iterator[PerceptionLink]:
    """The perception process; when the block ends, its channel is closed, and it with that. start_ns: time
    zero of a simulated world."""
    here, there = channel_sockets()
    process: BaseProcess = multiprocessing.get_context("spawn").Process(
        target=perceive_forever,
        args=(config, config_path, there, start_ns, recording),
        name="perception",
        daemon=True,
    )
    with held_ctrl_c():
        process.start()
    # Ours must be the only open copy of the other end, or its death would not show.
    there.close()
    channel = Channel(here)
    try:
        yield PerceptionLink(channel)
    finally:
        channel.close()
        process.join(GOODBYE_S)
        if process.is_alive():
            process.kill()
            process.join()
