"""Drives along a path in lock-step with a simulated world; called by controller/mission/command.py."""

from __future__ import annotations

import time
from contextlib import ExitStack

from config.app import AppConfig, LockstepRunner
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
from controller.lockstep import run_lockstep
from controller.mission.options import MissionOptions
from controller.mission.result import MissionResult
from controller.mission.summary import report
from controller.realtime.service import StopRequest
from controller.record.recorder import RunRecorder, open_recorder
from controller.record.tally import SetpointTally
from controller.terminal.console import Console
from hal.clocks import SimulatedClock


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
