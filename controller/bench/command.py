"""`treadwatch bench`: all measurements of processing time, with fixed seeds, one after the other."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path as FilePath

from config.app import AppConfig, load_app, load_replay
from config.camera import SimulatedCameraConfig
from config.loader import CONFIG_DIR
from config.perception import PerceptionConfig
from config.robot import Body
from controller.bench.driving import (
    ControlFigures,
    TimedChassis,
    measure_control,
)
from controller.bench.exchanges import measure_exchanges
from controller.bench.figures import Stopwatches
from controller.bench.machine import describe_machine, one_opencv_thread
from controller.bench.mission_speed import LockstepFigures, measure_lockstep
from controller.bench.perception import PerceptionFigures, measure_perception
from controller.bench.progress import progress
from controller.bench.reel import Reel, cruise, recorded_reel, render_reel
from controller.bench.rendering import RendererFigures, measure_renderer
from controller.bench.report import BenchReport
from controller.build import (
    build_control,
    build_path,
    open_replay,
    open_simulated_camera,
    scenario_of,
)
from controller.build_chassis import build_base
from controller.errors import UserError
from controller.terminal.outlet import say, say_result
from hal.clocks import SimulatedClock
from hal.geometry import mount_of
from sim.rendering.camera import SimulatedCamera
from sim.rendering.render import Renderer
from sim.simulation import Emulator
from sim.world import World
from vision.perception import Perception

_REPLAY = CONFIG_DIR / "replay.yaml"


@dataclass(frozen=True, slots=True)
class Plan:
    """What is measured, and how much of it.

    mission: configuration of a simulated mission in lock-step.
    sizes: of the simulated camera; the renderer is measured at the first.
    frames: number of frames of each simulated reel.
    recording: left out if it is not installed.
    recording_passes: how often perception runs over the recording.
    pictures: number of rendered pictures.
    control_steps: number of control steps and of exchanges of each driver.
    duration_s: simulated duration of the lock-step mission.
    """

    mission: FilePath = CONFIG_DIR / "sim.yaml"
    sizes: tuple[tuple[int, int], ...] = ((640, 480), (848, 480))
    frames: int = 150
    recording: FilePath = CONFIG_DIR.parent / "tests" / "recordings" / "desk_rpy"
    recording_passes: int = 6
    pictures: int = 60
    control_steps: int = 500
    duration_s: float = 10.0


_stopwatches = Stopwatches(processor_ns=time.process_time_ns, elapsed_ns=time.perf_counter_ns)


def run_bench(frames: int, json_path: FilePath | None) -> None:
    """Measure, print tables, write json_path if given. frames: of each simulated reel. Raises UserError."""
    if json_path is not None:
        _check_writable(json_path)
    with one_opencv_thread():
        report = measure_all(Plan(frames=frames))
    say_line = say_result if json_path is None else say
    for line in report.lines():
        say_line(line)
    if json_path is not None:
        try:
            json_path.write_text(report.to_text(), encoding="utf-8")
        except OSError as error:
            raise UserError(
                f"{json_path}: cannot be written ({error.strerror}); choose another --json"
            ) from error
        say(f"every figure: {json_path}")


def measure_all(plan: Plan) -> BenchReport:
    """Run all measurements. Raises ConfigError, HalError."""
    start_s, start_cpu_s = time.perf_counter(), time.process_time()
    config = load_app(plan.mission)
    perception = {f"simulated_{w}x{h}": _simulated_reel_figures(config, plan, w, h) for w, h in plan.sizes}
    if plan.recording.is_dir():
        perception[f"recorded_{plan.recording.name}"] = _recorded_reel_figures(plan)
    renderer = _renderer_figures(config, plan)
    control = _control_figures(config, plan)
    drivers = measure_exchanges(plan.control_steps, _stopwatches.processor_ns)
    lockstep = _lockstep_figures(config, plan)
    return BenchReport(
        taken_at=datetime.now(UTC).isoformat(timespec="seconds"),
        cpu_share=(time.process_time() - start_cpu_s) / (time.perf_counter() - start_s),
        machine=describe_machine(),
        perception=perception,
        renderer=renderer,
        control=control,
        drivers=drivers,
        lockstep=lockstep,
    )


def _check_writable(json_path: FilePath) -> None:
    """Check before measuring, not after it, that the figures can be written. Raises UserError."""
    try:
        json_path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"{json_path.parent}: cannot be made ({error.strerror}); choose another --json"
        ) from error
    if not os.access(json_path if os.path.exists(json_path) else json_path.parent, os.W_OK):
        raise UserError(f"{json_path}: may not be written; choose another --json or mend its permissions")


def _simulated_camera(config: AppConfig, plan: Plan, width: int, height: int) -> SimulatedCamera:
    """A camera of this size on a robot that drives along the mission's path at constant speed."""
    assert isinstance(config.camera, SimulatedCameraConfig), "the mission's camera is simulated"
    middle = {"cx": 0.5 * (width - 1), "cy": 0.5 * (height - 1)}
    camera = config.camera.model_copy(update={"width": width, "height": height, **middle})
    path = build_path(config)
    return open_simulated_camera(
        config.model_copy(update={"camera": camera}),
        SimulatedClock(),
        lambda stamp_ns: cruise(path, stamp_ns),
        start_ns=0,
    )


def _simulated_reel_figures(config: AppConfig, plan: Plan, width: int, height: int) -> PerceptionFigures:
    camera, path = _simulated_camera(config, plan, width, height), build_path(config)
    size = f"{width}x{height}"
    with progress(f"rendering frames, {size}", plan.frames) as tick:
        reel = render_reel(camera, path, mount_of(config.robot), plan.frames, tick)
    return _reel_figures(f"perception, {size}", reel, config.perception, config.robot.body, passes=1)


def _recorded_reel_figures(plan: Plan) -> PerceptionFigures:
    replay = load_replay(_REPLAY)
    recording, _ = open_replay(plan.recording, "none")
    reel = recorded_reel(recording)
    label = f"perception, recording {plan.recording.name}"
    return _reel_figures(label, reel, replay.perception, replay.robot.body, plan.recording_passes)


def _reel_figures(
    label: str, reel: Reel, config: PerceptionConfig, body: Body, passes: int
) -> PerceptionFigures:
    def make() -> Perception:
        return Perception(config, reel.mount, body.height_m, body.clearance_m)

    with progress(label, 3 * passes * len(reel.frames)) as tick:
        return measure_perception(reel, make, config.fragments, passes, _stopwatches, tick)


def _renderer_figures(config: AppConfig, plan: Plan) -> RendererFigures:
    assert config.simulation is not None, "the mission is simulated"
    camera = _simulated_camera(config, plan, *plan.sizes[0])
    world = World(scenario_of(config), config.simulation.seed)
    renderer = Renderer(world, camera.intrinsics)
    with progress("renderer", plan.pictures + 1) as tick:
        return measure_renderer(camera, renderer, plan.pictures, _stopwatches.processor_ns, tick)


def _control_figures(config: AppConfig, plan: Plan) -> ControlFigures:
    """Measure the control step, without the exchange of the mission's chassis driver."""
    timed, emulator = _base(config, plan)
    loop = build_control(config, timed)
    with progress("control step", plan.control_steps) as tick:
        return measure_control(loop, timed, emulator, plan.control_steps, _stopwatches.processor_ns, tick)


def _base(config: AppConfig, plan: Plan) -> tuple[TimedChassis, Emulator]:
    chassis, emulator = build_base(config, build_path(config).start, 0)
    assert emulator is not None, "the mission's base is emulated"
    return TimedChassis(chassis, _stopwatches.processor_ns), emulator


def _lockstep_figures(config: AppConfig, plan: Plan) -> LockstepFigures:
    steps = round(plan.duration_s * config.runner.control_rate_hz)
    with progress("lock-step mission", steps) as tick:
        return measure_lockstep(config, plan.duration_s, _stopwatches, tick)
