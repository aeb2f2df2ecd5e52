"""The faults of a scenario file happen in `treadwatch run`: camera, tracks and feedback."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from config.app import AppConfig, LockstepRunner, load_app
from config.camera import SimulatedCameraConfig
from config.loader import CONFIG_DIR
from controller.build import build_faults, build_simulation, open_camera, open_faulty_camera
from controller.build_chassis import build_base
from controller.mission.lockstep_drive import drive_lockstep
from controller.mission.options import MissionOptions
from controller.mission.scenario_faults import unused_faults_warning, with_scenario_faults
from controller.terminal.console import Console
from hal.clocks import NS_PER_S, SimulatedClock
from hal.errors import FrameTimeout
from hal.types import PlanarPose

CONFIG_FILE = CONFIG_DIR / "sim.yaml"
EVERY_FAULT = Path(__file__).parents[3] / "scenarios" / "faults.yaml"
START_NS = 5 * NS_PER_S  # the world begins later than the clock, as in real time


def app(**simulation: object) -> AppConfig:
    config = load_app(CONFIG_FILE)
    assert config.simulation is not None
    assert isinstance(config.camera, SimulatedCameraConfig)
    small = {"width": 64, "height": 48, "fx": 46.0, "fy": 61.0, "cx": 31.5, "cy": 23.5, "fps": 10.0}
    changed = {"scenario": str(EVERY_FAULT), **simulation}
    config = config.model_copy(
        update={
            "simulation": config.simulation.model_copy(update=changed),
            "camera": config.camera.model_copy(update=small),
        }
    )
    return with_scenario_faults(config)


def test_frames_are_lost_frozen_and_without_depth_on_glass() -> None:
    clock = SimulatedClock(START_NS)
    camera = open_faulty_camera(app(), clock, lambda _: None, START_NS)
    with camera:
        frames = [camera.read(2.0) for _ in range(24)]
    times = [round((frame.captured_ns - START_NS) / NS_PER_S, 1) for frame in frames]
    assert times == pytest.approx([0.1 * k for k in [*range(10), *range(15, 29)]])
    by_time = dict(zip(times, frames, strict=True))
    assert np.array_equal(by_time[1.9].colour, by_time[2.4].colour), "frozen"
    assert not np.array_equal(by_time[1.9].colour, by_time[2.5].colour)
    # The glass is 9 m ahead in the middle of the image, the floor below it is not glass.
    assert not by_time[0.0].depth[16:22, 28:36].any()
    assert by_time[0.0].depth[26:32, 28:36].all()


def test_late_frames_arrive_late_and_in_order_in_real_time() -> None:
    clock = SimulatedClock(START_NS)
    with open_camera(app(), clock, lambda _: None, START_NS) as camera:
        arrivals = []
        while clock.now_ns() < START_NS + 6.5 * NS_PER_S:
            try:
                frame = camera.read(0.05)
            except FrameTimeout:
                continue
            arrivals.append((frame.captured_ns, clock.now_ns()))
    delays = {round((at - START_NS) / NS_PER_S, 1): (now - at) / NS_PER_S for at, now in arrivals}
    assert delays[3.9] == pytest.approx(0.0)
    assert all(delays[t_s] == pytest.approx(0.2) for t_s in (4.0, 4.5, 5.9))
    assert delays[6.4] == pytest.approx(0.0)
    assert sorted(arrivals) == arrivals
    assert {4.0, 4.1, 4.2, 5.8, 5.9, 6.0, 6.1} <= set(delays), "none is skipped"


def test_slip_and_vibration_reach_plant_and_camera() -> None:
    config = app()
    assert config.simulation is not None
    assert isinstance(config.camera, SimulatedCameraConfig)
    assert config.simulation.plant.slip_factor == pytest.approx(1.0 / 0.85)
    assert config.simulation.plant.distance_slip == 0.02
    assert (config.camera.vibration_deg, config.camera.vibration_hz) == (0.3, 8.0)


def test_tracks_that_slip_count_too_much() -> None:
    config = app()
    _, emulator = build_base(config, PlanarPose(0.0, 0.0, 0.0), 0)
    assert emulator is not None
    emulator.plant.command_tracks(1.0, 1.0)
    emulator.plant.advance_to(10 * NS_PER_S)
    assert emulator.plant.track_travel_m[0] == pytest.approx(1.02 * emulator.plant.pose.x_m)
    assert emulator.plant.twist[0] == pytest.approx(1.0 / 1.02)


def test_a_base_that_loses_its_feedback_answers_no_more() -> None:
    config = app()
    chassis, emulator = build_base(config, PlanarPose(0.0, 0.0, 0.0), 0)
    assert emulator is not None
    simulation = build_simulation(config, emulator, 0)
    frozen = []
    emulator.freeze = lambda: frozen.append(True)  # type: ignore[method-assign]
    with simulation, chassis:
        simulation.advance_to(round(4.99 * NS_PER_S))
        assert not frozen
        simulation.advance_to(5 * NS_PER_S)
    assert frozen


def test_a_drive_meets_the_faults_of_its_scenario(tmp_path: Path) -> None:
    config = app()
    runner = config.runner
    assert isinstance(runner, LockstepRunner)
    runner = runner.model_copy(update={"max_duration_s": 6.0})
    observations = tmp_path / "observations.jsonl"
    options = MissionOptions(config_path=CONFIG_FILE, observations=observations, quiet=True)
    result = drive_lockstep(config, runner, options, Console(quiet=True))
    stamps = [json.loads(line)["stamp"] for line in observations.read_text().splitlines()]
    assert not [stamp for stamp in stamps if 1.0 <= stamp < 1.5]
    assert result.last is not None
    assert math.isnan(result.last.chassis.v_mps) or result.last.chassis.mode.value == "lost"
    assert build_faults(config).feedback_lost_s == 5.0


def test_an_external_base_has_none_of_the_faults_of_a_base() -> None:
    assert unused_faults_warning(app()) is None
    told = unused_faults_warning(app(base="external"))
    assert told is not None
    assert "faults.yaw_slip, faults.distance_slip, faults.feedback_lost_s: not simulated" in told
