"""A base whose YAML says that a motor is mirrored is emulated with that motor mirrored."""

import pytest

from config.app import hil_file, load_app
from controller.build_chassis import build_serial_driver, build_serial_emulator
from hal.links.scripted import serial_pair
from hal.types import ChassisMode, Setpoint
from sim.plant import TrackedPlant
from tests.support.chassis_rig import MS, PLANT


@pytest.mark.parametrize("kind", ["roboclaw", "roboteq"])
@pytest.mark.parametrize("mirrored", [("invert_left",), ("invert_right",), ("invert_left", "invert_right")])
def test_base_with_mirrored_motors_drives_straight_ahead(kind: str, mirrored: tuple[str, ...]) -> None:
    config = load_app(hil_file(kind)).chassis
    config = config.model_copy(update=dict.fromkeys(mirrored, True))
    near, far = serial_pair()
    base, plant = build_serial_driver(config, near), TrackedPlant(PLANT)
    emulator = build_serial_emulator(config, far, plant)
    for k in range(1, 251):
        now_ns = k * 20 * MS
        emulator.advance_to(now_ns)
        v_mps = 0.5 if k > 100 else 0.0
        state = base.exchange(Setpoint(now_ns, v_mps, 0.0, 0.0), now_ns)
        if k == 50:
            base.arm(now_ns)
    assert state.mode is ChassisMode.ARMED, state.reason
    assert plant.twist == pytest.approx((0.5, 0.0), abs=0.01)
    assert (state.v_mps, state.w_radps) == pytest.approx((0.5, 0.0), abs=0.01)
