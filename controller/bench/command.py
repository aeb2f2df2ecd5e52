"""`treadwatch bench`: everything that is worth measuring, on fixed seeds, one thing after the other."""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from pathlib import Path as FilePath

import click

from config.app import AppConfig, load_app, load_replay
from config.camera import SimulatedCameraConfig
from config.chassis import RoboclawChassisConfig
from config.loader import CONFIG_DIR
from config.perception import PerceptionConfig
from config.robot import Body
from controller.bench.driving import (
    ControlFigures,
    TimedChassis,
    measure_control,
    measure_exchange,
    roboclaw_in_memory,
)
from controller.bench.figures import Durations
from controller.bench.machine import describe_machine, one_opencv_thread
from controller.bench.mission_speed import LockstepFigures, measure_lockstep
from controller.bench.perception import PerceptionFigures, measure_perception
from controller.bench.progress import progress
from controller.bench.reel import Reel, cruise, recorded_reel, render_reel
from controller.bench.rendering import RendererFigures, measure_renderer
from controller.bench.report import BenchReport
from controller.build import (
    build_base,
    build_control,
    build_path,
    mount_of,
    open_simulated_camera,
    scenario_of,
)
from controller.errors import UserError
from hal.clocks import SimulatedClock
from sim.camera import SimulatedCamera
from sim.render import Renderer
from sim.world import World
from vision.perception import Perception

_MISSION = CONFIG_DIR / "sim.yaml"
_ROBOCLAW = CONFIG_DIR / "robot-roboclaw.yaml"
_REPLAY = CONFIG_DIR / "replay.yaml"
_RECORDING = CONFIG_DIR.parent / "tests" / "recordings" / "desk_rpy"

_SIZES = ((640, 480), (848, 480))
_RECORDING_PASSES = 6
_RENDERED = 60
_CONTROL_STEPS = 500
_STRETCH_S = 10.0

_stopwatch_ns = time.perf_counter_ns


def run_bench(frames: int, json_path: FilePath | None) -> None:
    """Measure, print the tables, write json_path. frames: of each simulated reel. Raises UserError."""
    if json_path is not None:
        _prepare(json_path)
    with one_opencv_thread():
        report = measure_all(frames)
    for line in report.lines():
        click.echo(line)
    if json_path is not None:
        json_path.write_text(report.to_text(), encoding="utf-8")
        click.echo(f"every figure: {json_path}")


def measure_all(
    frames: int,
    *,
    rendered: int = _RENDERED,
    recording_passes: int = _RECORDING_PASSES,
    control_steps: int = _CONTROL_STEPS,
    stretch_s: float = _STRETCH_S,
) -> BenchReport:
    """One run of everything. The recording is left out where this installation has none."""
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    config = load_app(_MISSION)
    perception = {f"simulated_{w}x{h}": _simulated_reel_figures(config, w, h, frames) for w, h in _SIZES}
    if _RECORDING.is_dir():
        perception[f"recorded_{_RECORDING.name}"] = _recorded_reel_figures(recording_passes)
    control, agilex = _driving_figures(config, control_steps)
    return BenchReport(
        taken_at=datetime.now(UTC).isoformat(timespec="seconds"),
        machine=describe_machine(),
        perception=perception,
        renderer=_renderer_figures(config, rendered),
        control=control,
        drivers={
            "agilex_virtual_can": agilex,
            "roboclaw_in_memory": _roboclaw_figures(config, control_steps),
        },
        lockstep=_lockstep_figures(config, stretch_s),
    )


def _prepare(json_path: FilePath) -> None:
    """Find out before measuring, not after it, that the figures cannot be written."""
    try:
        json_path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"{json_path.parent}: cannot be made ({error.strerror}); choose another --json"
        ) from error
    if not os.access(json_path if json_path.exists() else json_path.parent, os.W_OK):
        raise UserError(f"{json_path}: may not be written; choose another --json or mend its permissions")


def _simulated_camera(config: AppConfig, width: int, height: int) -> SimulatedCamera:
    """A camera of this size on a body that cruises along the mission's path."""
    assert isinstance(config.camera, SimulatedCameraConfig), "sim.yaml simulates its camera"
    middle = {"cx": 0.5 * (width - 1), "cy": 0.5 * (height - 1)}
    camera = config.camera.model_copy(update={"width": width, "height": height, **middle})
    path = build_path(config, _MISSION)
    return open_simulated_camera(
        config.model_copy(update={"camera": camera}),
        _MISSION,
        SimulatedClock(),
        lambda stamp_ns: cruise(path, stamp_ns),
        start_ns=0,
    )


def _simulated_reel_figures(config: AppConfig, width: int, height: int, frames: int) -> PerceptionFigures:
    camera, path = _simulated_camera(config, width, height), build_path(config, _MISSION)
    size = f"{width}x{height}"
    with progress(f"rendering frames, {size}", frames) as tick:
        reel = render_reel(camera, path, mount_of(config), frames, tick)
    return _reel_figures(f"perception, {size}", reel, config.perception, config.robot.body, passes=1)


def _recorded_reel_figures(passes: int) -> PerceptionFigures:
    replay = load_replay(_REPLAY)
    reel = recorded_reel(_RECORDING)
    label = f"perception, recording {_RECORDING.name}"
    return _reel_figures(label, reel, replay.perception, replay.robot.body, passes)


def _reel_figures(
    label: str, reel: Reel, config: PerceptionConfig, body: Body, passes: int
) -> PerceptionFigures:
    def make() -> Perception:
        return Perception(config, reel.mount, body.height_m, body.clearance_m)

    with progress(label, 2 * passes * len(reel.frames)) as tick:
        return measure_perception(reel, make, passes, _stopwatch_ns, tick)


def _renderer_figures(config: AppConfig, frames: int) -> RendererFigures:
    assert config.simulation is not None, "sim.yaml simulates its world"
    camera = _simulated_camera(config, *_SIZES[0])
    world = World(scenario_of(config.simulation, _MISSION), config.simulation.seed)
    renderer = Renderer(world, camera.intrinsics)
    with progress("renderer", frames + 1) as tick:
        return measure_renderer(camera, renderer, frames, _stopwatch_ns, tick)


def _driving_figures(config: AppConfig, steps: int) -> tuple[ControlFigures, Durations]:
    """The control step, and the exchange of the mission's chassis driver, each in a run of its own."""
    start = build_path(config, _MISSION).start
    chassis, emulator = build_base(config, start, 0)
    assert emulator is not None, "sim.yaml emulates its base"
    timed = TimedChassis(chassis, _stopwatch_ns)
    loop = build_control(config, _MISSION, timed)
    with progress("control step", steps) as tick:
        control = measure_control(loop, timed, emulator, steps, _stopwatch_ns, tick)
    chassis, emulator = build_base(config, start, 0)
    assert emulator is not None, "sim.yaml emulates its base"
    with progress("driver, AgileX over virtual CAN", steps) as tick:
        return control, measure_exchange(TimedChassis(chassis, _stopwatch_ns), emulator, steps, tick)


def _roboclaw_figures(config: AppConfig, exchanges: int) -> Durations:
    roboclaw = load_app(_ROBOCLAW).chassis
    assert isinstance(roboclaw, RoboclawChassisConfig), "robot-roboclaw.yaml drives a RoboClaw"
    assert config.simulation is not None, "sim.yaml simulates its base"
    chassis, emulator = roboclaw_in_memory(roboclaw, config.simulation.plant)
    with progress("driver, RoboClaw in memory", exchanges) as tick:
        return measure_exchange(TimedChassis(chassis, _stopwatch_ns), emulator, exchanges, tick)


def _lockstep_figures(config: AppConfig, stretch_s: float) -> LockstepFigures:
    steps = round(stretch_s * config.runner.control_rate_hz)
    with progress("lock-step mission", steps) as tick:
        return measure_lockstep(config, _MISSION, stretch_s, _stopwatch_ns, tick)
