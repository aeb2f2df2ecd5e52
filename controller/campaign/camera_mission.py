"""A mission in which only the world is simulated: rendered frames, perception, driver, bus and emulated base.

The parts are those of `treadwatch run` in lockstep. Faults occur where they would occur in reality: frames
are lost, repeated or without depth before perception gets them, or the base stops answering.
"""

from __future__ import annotations

import math
import time
from contextlib import ExitStack
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory

from config.app import AppConfig, LockstepRunner, SimulationConfig
from config.scenario import as_yaml
from controller.base.drive_lifecycle import SETTLE_S, Outcome
from controller.build import (
    build_control_loop,
    build_path,
    build_perceiver,
    build_simulation,
    open_faulty_camera,
    video_settings,
)
from controller.build_chassis import build_base
from controller.campaign.drive_log import DriveLog
from controller.campaign.noise_mission import GIVE_UP_S
from controller.campaign.policies import build_policy
from controller.campaign.stage import Stage
from controller.errors import UserError
from controller.lockstep import run_lockstep
from controller.mission.scenario_faults import with_slip_and_vibration
from controller.record.recorder import RecordingOptions, RunRecorder, open_recorder
from controller.record.tally import SetpointTally
from hal.clocks import NS_PER_S, SimulatedClock
from hal.types import ChassisMode, PlanarPose
from sim.plant import PLANT_REST_MPS
from sim.simulation import Simulation

_NO_RECORDING = RecordingOptions(timed=False)


def drive_camera(stage: Stage, config: AppConfig, policy: str, keep: FilePath | None = None) -> DriveLog:
    """Drive once. keep: folder for the recording, the observations and the video; None: none are written."""
    try:
        temporary = TemporaryDirectory(prefix="treadwatch-")
    except OSError as error:
        raise UserError(
            f"no temporary folder can be made ({error.strerror}); set TMPDIR to one that can be written"
        ) from error
    with temporary as folder:
        scenario = FilePath(folder) / "scenario.yaml"
        scenario.write_text(as_yaml(stage.case.scenario), encoding="utf-8")
        return _drive(stage, _mission_config(config, stage, scenario), policy, keep)


def _mission_config(config: AppConfig, stage: Stage, scenario: FilePath) -> AppConfig:
    """The configuration with this mission's world, slip and vibration."""
    assert isinstance(config.runner, LockstepRunner), "checked by controller/campaign/command.py"
    simulation = config.simulation or SimulationConfig(scenario=str(scenario))
    changed = {"scenario": str(scenario), "seed": stage.case.seed}
    runner = {"max_duration_s": stage.case.scenario.duration_s}
    mission = config.model_copy(
        update={
            "simulation": simulation.model_copy(update=changed),
            "runner": config.runner.model_copy(update=runner),
        }
    )
    return with_slip_and_vibration(mission, stage.case.faults)


def _drive(stage: Stage, config: AppConfig, policy: str, keep: FilePath | None) -> DriveLog:
    assert isinstance(config.runner, LockstepRunner)
    clock = SimulatedClock()
    path = build_path(config)
    chassis, emulator = build_base(config, path.start, clock.now_ns())
    assert emulator is not None, "lock-step is refused by AppConfig without an emulated base"
    simulation = build_simulation(config, emulator, clock.now_ns())
    camera = open_faulty_camera(config, clock, lambda _stamp_ns: simulation.body_pose, clock.now_ns())
    loop = build_control_loop(config, path, build_policy(policy, config, stage), chassis)
    options = _NO_RECORDING if keep is None else prepare_recording(keep, stage)
    log = DriveLog(SetpointTally(config.robot.limits, 1.0 / config.runner.control_rate_hz))
    with ExitStack() as devices:
        devices.enter_context(simulation)
        devices.enter_context(chassis)
        devices.enter_context(camera)
        files = devices.enter_context(open_recorder(options, video_settings(config)))
        recorder = RunRecorder(files, path)
        perceiver = build_perceiver(config, loop.localiser, loop.localiser.body_pose, time.perf_counter_ns)
        monitor = _ProgressMonitor(stage, simulation, log)
        for moment in run_lockstep(
            config.runner, clock, simulation, camera, perceiver, loop, stage.case.faults.late_by
        ):
            for look in moment.looks:
                recorder.add_look(look)
            recorder.add_step(moment.control)
            t_s = moment.control.now_ns / NS_PER_S
            armed = moment.control.chassis.mode is ChassisMode.ARMED
            monitor.step(t_s, armed)
            log.add(t_s, simulation.body_pose, monitor.s_m, monitor.v_mps, moment.control.decision)
            log.setpoints.add(moment.control.chassis.sent, moment.control.chassis.mode)
            if monitor.given_up:
                break
        outcome = loop.lifecycle.outcome
        recorder.finish("drive ended" if outcome is None else outcome.value)
    if loop.lifecycle.outcome is Outcome.REACHED:
        log.reached_s = log.times_s[-1] - SETTLE_S - monitor.armed_s
    return log


def prepare_recording(folder: FilePath, stage: Stage) -> RecordingOptions:
    """Make the folder, write the mission's world into it, and return options to record there. Raises
    UserError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "scenario.yaml").write_text(as_yaml(stage.case.scenario), encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror}); choose another --report") from error
    return RecordingOptions(
        folder / "observations.jsonl", folder / "video.mp4", folder / "recording", timed=False
    )


class _ProgressMonitor:
    """The true position and speed of the robot along its path, and whether anything will still happen."""

    def __init__(self, stage: Stage, simulation: Simulation, log: DriveLog) -> None:
        self._stage, self._simulation, self._log = stage, simulation, log
        self.s_m, self.v_mps, self.armed_s = 0.0, 0.0, math.nan
        self._previous: tuple[float, PlanarPose] | None = None
        self._standing_s = 0.0

    @property
    def given_up(self) -> bool:
        """Whether the robot has stood for long, and nothing else moves any more."""
        if not self._log.times_s or self._log.times_s[-1] < self._stage.world.end_s + GIVE_UP_S:
            return False
        return self._standing_s >= GIVE_UP_S

    def step(self, t_s: float, armed: bool) -> None:
        """Update; called once a control step."""
        pose = self._simulation.body_pose
        self.s_m = self._stage.path.project(pose, self.s_m).s_m
        if armed and math.isnan(self.armed_s):
            self.armed_s = t_s
        if self._previous is not None:
            dt_s = t_s - self._previous[0]
            travelled_m = math.hypot(pose.x_m - self._previous[1].x_m, pose.y_m - self._previous[1].y_m)
            self.v_mps = travelled_m / dt_s
            self._standing_s = self._standing_s + dt_s if self.v_mps < PLANT_REST_MPS else 0.0
        self._previous = (t_s, pose)
