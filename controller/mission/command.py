"""`treadwatch run`: put the parts together, drive the path, and print a summary."""

from __future__ import annotations

import time
from contextlib import ExitStack

from config.app import AppConfig, LockstepRunner, load_app
from controller.base.drive_lifecycle import Outcome
from controller.build import (
    build_control,
    build_faults,
    build_path,
    build_perceiver,
    build_simulation,
    open_faulty_camera,
    require_camera,
    video_settings,
)
from controller.build_chassis import build_base
from controller.errors import UserError
from controller.lockstep import run_lockstep
from controller.mission.blind_bends import blind_bend_warning
from controller.mission.close_by import close_by_warning
from controller.mission.options import MissionOptions, scenario_as_typed
from controller.mission.possible_world import require_possible_world
from controller.mission.result import MissionResult
from controller.mission.scenario_faults import unused_faults_warning, with_scenario_faults
from controller.mission.short_arcs import short_arc_warning
from controller.realtime.mission import drive_realtime
from controller.realtime.service import StopRequest
from controller.record.observations import STANDARD_OUTPUT
from controller.record.recorder import RunRecorder, open_recorder
from controller.record.tally import SetpointTally
from controller.terminal.console import Console
from controller.terminal.summary import report, summary_rows
from hal.clocks import SimulatedClock


def run_mission(options: MissionOptions) -> int:
    """Drive once; returns the exit code: 0 if it succeeded (MissionResult.succeeded), else 1.

    Raises ConfigError, HalError, UserError.
    """
    config = load_for_drive(options)
    if config.governor is not None:
        raise UserError(
            f"{options.config_path}: has a 'governor' and no path to drive; use `treadwatch govern`"
        )
    console = Console(options.quiet, aside=options.observations == STANDARD_OUTPUT)
    require_possible_world(config)
    for warning_of in (short_arc_warning, close_by_warning, blind_bend_warning, unused_faults_warning):
        warning = warning_of(config)
        if warning is not None:
            console.warning(warning)
    if isinstance(config.runner, LockstepRunner):
        result = drive_lockstep(config, config.runner, options, console)
    else:
        result = drive_realtime(config, config.runner, options, console)
    console.summary(summary_rows(config, result))
    return 0 if result.succeeded else 1


def load_for_drive(options: MissionOptions) -> AppConfig:
    """The configuration of a drive: of the file, with what the command line and the scenario change in it.

    Raises ConfigError, UserError.
    """
    return with_scenario_faults(with_overrides(load_app(options.config_path), options))


def with_overrides(config: AppConfig, options: MissionOptions) -> AppConfig:
    """The configuration with another scenario or seed. Raises UserError where nothing is simulated."""
    changes: dict[str, object] = {}
    if options.scenario is not None:
        changes["scenario"] = scenario_as_typed(options.scenario)
    if options.seed is not None:
        changes["seed"] = options.seed
    if not changes:
        return config
    if config.simulation is None:
        raise UserError(
            f"--{' and --'.join(changes)}: {options.config_path} simulates nothing; leave the option out"
        )
    return config.model_copy(update={"simulation": config.simulation.model_copy(update=changes)})


def drive_lockstep(
    config: AppConfig, runner: LockstepRunner, options: MissionOptions, console: Console
) -> MissionResult:
    """Drive in one thread, in simulated time."""
    require_camera(config)
    clock = SimulatedClock()
    path = build_path(config)
    chassis, emulator = build_base(config, path.start, clock.now_ns())
    assert emulator is not None, "lock-step is refused by AppConfig without an emulated base"
    simulation = build_simulation(config, emulator, clock.now_ns())
    camera = open_faulty_camera(config, clock, lambda _stamp_ns: simulation.body_pose, clock.now_ns())
    # Recordings must be repeatable, so durations that were measured on this machine are left out of them.
    recording = options.recording(timed=False)
    with ExitStack() as devices:
        devices.enter_context(simulation)
        devices.enter_context(chassis)
        devices.enter_context(camera)
        recorder = devices.enter_context(open_recorder(recording, video_settings(config)))
        stop = StopRequest().listen()
        devices.callback(stop.closing)
        loop = build_control(config, chassis)
        setpoints = SetpointTally(config.robot.limits, 1.0 / runner.control_rate_hz)
        result = MissionResult(loop=loop, setpoints=setpoints, simulation=simulation)
        perceiver = build_perceiver(config, loop.localiser, loop.localiser.body_pose, time.perf_counter_ns)
        run_recorder = RunRecorder(recorder, path)
        began_s = time.perf_counter()
        late_by = build_faults(config).late_by
        for moment in run_lockstep(runner, clock, simulation, camera, perceiver, loop, late_by):
            step = moment.control
            result.take(step)
            for look in moment.looks:
                result.timing.add(look.timing_ms)
                run_recorder.add_look(look)
            run_recorder.add_step(step)
            report(console, result, step)
            if result.standstill.elapsed_s(step.now_ns) >= runner.max_standing_s:
                given_up = f"stood for runner.max_standing_s of {runner.max_standing_s:g} s"
                loop.request_stop(given_up, Outcome.BROKEN_OFF)
            if stop:
                loop.request_stop(f"{stop.reason} received")
        outcome = loop.lifecycle.outcome
        run_recorder.finish("drive ended" if outcome is None else outcome.value)
        result.wall_s = time.perf_counter() - began_s
    return result
