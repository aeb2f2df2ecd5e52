"""What the composition of the chassis takes from the configuration."""

from __future__ import annotations

import pytest

from config.app import hil_file, load_app
from controller.build_chassis import build_base_in_memory
from hal.types import ChassisMode, PlanarPose, Setpoint
from tests.support.chassis_rig import MS


@pytest.mark.parametrize("kind", ["agilex", "kobuki", "roboclaw", "roboteq"])
@pytest.mark.parametrize(("changes", "age_ms"), [({}, 100), ({"command_timeout_ms": 300}, 300)])
def test_a_command_is_too_old_after_the_time_of_the_configuration(
    kind: str, changes: dict[str, int], age_ms: int
) -> None:
    config = load_app(hil_file(kind))
    config = config.model_copy(update={"chassis": config.chassis.model_copy(update=changes)})
    chassis, emulator, _ = build_base_in_memory(config, PlanarPose(0.0, 0.0, 0.0), 0)
    now_ns = 0
    with emulator, chassis:
        for step in range(100):
            now_ns += 20 * MS
            emulator.advance_to(now_ns)
            if step == 50:
                chassis.arm(now_ns)
            held = Setpoint(now_ns, 0.0, 0.0, 0.0)
            state = chassis.exchange(held, now_ns)
        while now_ns - held.stamp_ns < age_ms * MS:
            assert state.mode is ChassisMode.ARMED
            now_ns += 20 * MS
            emulator.advance_to(now_ns)
            state = chassis.exchange(held, now_ns)
        assert state.mode is ChassisMode.ARMED
        state = chassis.exchange(held, now_ns + 1)
    assert state.mode is ChassisMode.ESTOP
    assert state.reason == f"output guard: the command is {age_ms} ms old"
