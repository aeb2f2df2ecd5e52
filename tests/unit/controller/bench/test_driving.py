from __future__ import annotations

import math
from types import TracebackType
from typing import Self

import numpy as np
import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from config.plant import PlantConfig
from controller.bench.busy_scene import OBSTACLES, busy_scene
from controller.bench.driving import TimedChassis, measure_control, measure_exchange
from controller.build import build_control, build_path
from controller.build_chassis import build_base, build_base_in_memory
from hal.types import ChassisMode, ChassisState, PlanarPose, Setpoint
from sim.plant import TrackedPlant
from tests.support.bench_clocks import Ticks, every

MISSION = CONFIG_DIR / "sim.yaml"
ROBOCLAW = CONFIG_DIR / "hil-roboclaw.yaml"


class Stubborn:
    """A base that never arms."""

    def __init__(self) -> None:
        self.plant = TrackedPlant(PlantConfig())
        self.asked: list[Setpoint | None] = []
        self.open = False

    def __enter__(self) -> Self:
        self.open = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.open = False

    def advance_to(self, now_ns: int) -> None:
        self.plant.advance_to(now_ns)

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        assert self.open
        self.asked.append(setpoint)
        pose = PlanarPose(0.0, 0.0, 0.0)
        return ChassisState(
            now_ns, ChassisMode.STANDBY, "stubborn", None, math.nan, math.nan, pose, math.nan, (), None
        )

    def arm(self, now_ns: int) -> None:
        assert self.open

    def stop(self, now_ns: int) -> None:
        assert self.open


def test_the_stopwatch_runs_during_the_exchange_only() -> None:
    chassis = TimedChassis(Stubborn(), every(7))
    with chassis:
        chassis.arm(0)
        assert chassis.exchange(None, 5).stamp_ns == 5
        chassis.stop(6)
    assert chassis.spent_ns == 7


def test_exchanges_of_an_armed_roboclaw() -> None:
    chassis, emulator, _ = build_base_in_memory(load_app(ROBOCLAW), PlanarPose(0.0, 0.0, 0.0), 0)
    ticks = Ticks()
    exchange = measure_exchange(TimedChassis(chassis, every(1000)), emulator, 20, ticks)
    assert exchange.count == ticks.count == 20
    assert exchange.median_ms == pytest.approx(0.001)
    assert emulator.plant.twist[0] > 0.01, "the base was driven, not merely talked to"


def test_exchanges_of_an_armed_bunker() -> None:
    chassis, emulator = build_base(load_app(MISSION), PlanarPose(0.0, 0.0, 0.0), 0)
    assert emulator is not None
    exchange = measure_exchange(TimedChassis(chassis, every(1000)), emulator, 20, Ticks())
    assert exchange.count == 20
    assert emulator.plant.twist[0] > 0.01


def test_a_base_that_does_not_obey_ends_the_measurement() -> None:
    stubborn = Stubborn()
    with pytest.raises(RuntimeError, match="obeyed in 0 of 260 exchanges"):
        measure_exchange(TimedChassis(stubborn, every(1)), stubborn, 10, Ticks())
    assert not stubborn.open
    assert {setpoint.v_mps for setpoint in stubborn.asked if setpoint is not None} == {0.0}


def test_control_steps_leave_out_the_exchange() -> None:
    config = load_app(MISSION)
    chassis, emulator = build_base(config, build_path(config).start, 0)
    assert emulator is not None
    stopwatch_ns = every(1000)
    timed = TimedChassis(chassis, stopwatch_ns)
    loop = build_control(config, timed)
    ticks = Ticks()
    figures = measure_control(loop, timed, emulator, 10, stopwatch_ns, ticks)
    # Four readings: around the step and, inside it, around the exchange: 3 us less 1 us.
    assert figures.step.count == ticks.count == 10
    assert figures.step.median_ms == pytest.approx(0.002)
    assert figures.as_json() == {"obstacles": OBSTACLES, "step": figures.step.as_json()}


def test_the_busy_scene_has_moving_and_resting_obstacles_and_a_free_way() -> None:
    pose = PlanarPose(1.0, 2.0, 0.1)
    scene = busy_scene(5_000_000, 3, pose)
    assert len(scene.obstacles) == OBSTACLES == 10
    assert {obstacle.moving for obstacle in scene.obstacles} == {False, True}
    assert len({obstacle.id for obstacle in scene.obstacles}) == OBSTACLES
    assert all(obstacle.moving == bool(np.any(obstacle.velocity_mps != 0.0)) for obstacle in scene.obstacles)
    assert np.isinf(scene.free_space.nearest_m).all()
    assert (scene.captured_ns, scene.sequence, scene.robot_pose) == (5_000_000, 3, pose)
