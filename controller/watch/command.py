"""`treadwatch watch`: opens base and camera, watches until it is told to end, and prints a summary."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import dataclass

from config.app import AppConfig, LockstepRunner, RealtimeRunner
from controller.base.drive_lifecycle import Outcome
from controller.base.ego_speed import EgoSpeed
from controller.base.localise import Localiser
from controller.build import (
    build_decision,
    build_path,
    build_simulation,
    require_camera,
    straight_ahead,
)
from controller.build_chassis import build_listener
from controller.errors import UserError
from controller.mission.command import load_for_drive
from controller.mission.options import MissionOptions
from controller.realtime.messages import STREAM_ENDED
from controller.realtime.rig import HEAD_START_S, perception_beside, warn_of_cut_off
from controller.realtime.runner import Punctuality, run_realtime
from controller.realtime.service import ServiceManager, StopRequest
from controller.record.observations import STANDARD_OUTPUT
from controller.record.recorder import require_writable
from controller.terminal.console import Console
from controller.watch.loop import WatchLoop
from controller.watch.no_base import NoBase
from controller.watch.result import WatchResult
from controller.watch.summary import summary_rows
from controller.watch.view import View
from hal.api import ChassisListener
from hal.clocks import NS_PER_S, MonotonicClock
from hal.errors import DeviceRefused, HalError
from hal.geometry import mount_of
from hal.types import PlanarPose
from sim.simulation import Simulation


@dataclass(frozen=True, slots=True)
class WatchOptions:
    """The command line of `treadwatch watch`.

    duration_s: from the first frame on; None: until a signal. no_chassis: a camera alone.
    """

    mission: MissionOptions
    duration_s: float | None = None
    no_chassis: bool = False


def run_watch(options: WatchOptions) -> int:
    """Watch once; returns the exit code: 0 if it ended as asked and everything is written, else 1.

    Raises ConfigError, HalError, UserError.
    """
    given = options.mission
    config = load_for_drive(given)
    if isinstance(config.runner, LockstepRunner):
        raise UserError(
            f"{given.config_path}: runner.kind 'lockstep' is simulated time, and watching happens in real "
            "time; set it to 'realtime', as in config/sim-realtime.yaml"
        )
    console = Console(given.quiet, aside=given.observations == STANDARD_OUTPUT)
    require_camera(config)
    require_writable(given.recording())
    result = WatchResult(mount=mount_of(config.robot))
    loop = _watch(config, config.runner, options, console, result)
    console.summary(summary_rows(config, loop, result))
    return 0 if loop.outcome is Outcome.STOPPED and result.frames.processed and not result.cut_off else 1


def _watch(
    config: AppConfig,
    runner: RealtimeRunner,
    options: WatchOptions,
    console: Console,
    result: WatchResult,
) -> WatchLoop:
    clock = MonotonicClock()
    start_ns = clock.now_ns() + round(HEAD_START_S * NS_PER_S)
    with ExitStack() as devices:
        chassis, simulation = _open_base(config, options, devices, start_ns)
        loop = build_watch_loop(config, chassis, options.duration_s)
        service, stop = ServiceManager(os.environ, os.getpid()), StopRequest().listen()
        view = View(console, config.robot.camera_mount)
        # How long to watch is for the loop to say, not for the configuration of a drive.
        endless = runner.model_copy(update={"max_duration_s": None})
        with (
            perception_beside(config, start_ns, options.mission.recording()) as link,
            console.beside_a_drive(),
        ):
            moments = run_realtime(endless, clock, simulation, link, loop, stop, Punctuality())
            for moment in moments:
                service.feed_watchdog(moment.control.now_ns)
                for message in moment.arrived:
                    if not result.frames.processed:
                        service.ready("watching")
                    result.take_message(message)
                    view.take_message(message)
                result.take(moment.control)
                warn_of_cut_off(link, result.cut_off, console, "; watching goes on without it")
                view.show(result, moment.control)
            service.stopping(str(loop.reason))
            stop.closing()
        warn_of_cut_off(link, result.cut_off, console)
        if link.refused_reason is not None:
            raise DeviceRefused(link.refused_reason)
        if link.lost_reason == STREAM_ENDED and loop.outcome is Outcome.BROKEN_OFF:
            loop.reason, loop.outcome = "the recording has ended", Outcome.STOPPED
    return loop


def build_watch_loop(config: AppConfig, chassis: ChassisListener, duration_s: float | None) -> WatchLoop:
    """Listening, deciding for a straight way ahead, and comparing the odometry with the images."""
    mount = mount_of(config.robot)
    localiser = Localiser(PlanarPose(0.0, 0.0, 0.0), mount)
    straight = straight_ahead(config.robot)
    return WatchLoop(chassis, build_decision(config), straight, localiser, EgoSpeed(mount), duration_s)


def _open_base(
    config: AppConfig, options: WatchOptions, devices: ExitStack, start_ns: int
) -> tuple[ChassisListener, Simulation | None]:
    """The base, and the simulated world if there is one. start_ns: its time zero. Raises HalError."""
    if options.no_chassis:
        return NoBase(), None
    start = build_path(config).start
    chassis, emulator = build_listener(config, start, MonotonicClock().now_ns())
    simulation = None
    if emulator is not None:
        simulation = devices.enter_context(build_simulation(config, emulator, start_ns))
    try:
        return devices.enter_context(chassis), simulation
    except HalError as error:
        raise UserError(f"{error}; to look through the camera alone, add --no-chassis") from error
