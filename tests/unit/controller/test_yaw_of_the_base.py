"""What config.chassis says that a base turns by at most is what its driver sends without slowing it."""

from __future__ import annotations

import pytest

from config.app import AppConfig, load_app
from config.chassis import AgilexChassisConfig
from config.loader import CONFIG_DIR
from controller.build_chassis import build_can_driver, build_serial_driver, build_serial_emulator
from hal.api import Chassis
from hal.chassis.agilex_models import model_of
from hal.links.scripted import can_pair, serial_pair
from hal.types import ChassisMode, Setpoint
from sim.emulators.agilex import AgilexEmulator
from sim.plant import TrackedPlant
from sim.simulation import Emulator
from tests.support.chassis_rig import PERIOD_NS, PLANT

SHIPPED = sorted(path for path in CONFIG_DIR.glob("*.yaml") if path.stem != "replay")


def in_memory(config: AppConfig) -> tuple[Chassis, Emulator]:
    plant = TrackedPlant(PLANT)
    if isinstance(config.chassis, AgilexChassisConfig):
        near, far = can_pair()
        return build_can_driver(config.chassis, near), AgilexEmulator(
            far, plant, model=model_of(config.chassis)
        )
    here, there = serial_pair()
    driver = build_serial_driver(config.chassis, here)
    return driver, build_serial_emulator(config.chassis, there, plant)


def sent(config: AppConfig, v_mps: float, w_radps: float) -> tuple[float, float]:
    """What the driver makes of this command."""
    chassis, emulator = in_memory(config)
    with emulator, chassis:
        chassis.arm(0)
        for now_ns in range(PERIOD_NS, 200 * PERIOD_NS, PERIOD_NS):
            emulator.advance_to(now_ns)
            state = chassis.exchange(Setpoint(now_ns, 0.0, 0.0, 0.0), now_ns)
            if state.mode is ChassisMode.ARMED:
                break
        assert state.mode is ChassisMode.ARMED, state.reason
        for _ in range(4):
            now_ns += PERIOD_NS
            emulator.advance_to(now_ns)
            state = chassis.exchange(Setpoint(now_ns, v_mps, 0.0, w_radps), now_ns)
    assert state.sent is not None
    return state.sent.v_mps, state.sent.w_radps


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_no_driver_slows_what_the_files_that_ship_admit(path: str) -> None:
    """The greatest speed and the sharpest turn together, to either side; a little more is slowed."""
    config = load_app(CONFIG_DIR / path)
    limits = config.robot.limits
    for left in (1.0, -1.0):
        asked = limits.max_speed_mps, left * limits.max_yaw_rate_radps
        assert sent(config, *asked) == asked
    most_radps = config.chassis.top_yaw_rate_radps(limits.max_speed_mps)
    assert sent(config, limits.max_speed_mps, 0.999 * most_radps)[0] == limits.max_speed_mps
    assert sent(config, limits.max_speed_mps, 1.01 * most_radps)[0] < limits.max_speed_mps
