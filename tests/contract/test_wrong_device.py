"""Every serial driver in front of what it was not made for: one line, and nothing moves."""

from __future__ import annotations

import random
from itertools import permutations

import pytest

from config.app import HIL_BASES, hil_file, load_app
from config.chassis import AnyChassisConfig, CanLinkConfig
from controller.build_chassis import build_serial_driver, build_serial_emulator
from hal.links.scripted import ScriptedSerialLink, serial_pair
from hal.types import ChassisMode, ChassisState, Setpoint
from sim.plant import TrackedPlant
from sim.simulation import Emulator
from tests.support.chassis_rig import MS, PLANT

GIVES_UP = "arming gave up after 3."


def chassis_config(kind: str) -> AnyChassisConfig:
    return load_app(hil_file(kind)).chassis


SERIAL_BASES = [kind for kind in HIL_BASES if not isinstance(chassis_config(kind).link, CanLinkConfig)]


def emulator(kind: str, link: ScriptedSerialLink) -> Emulator:
    return build_serial_emulator(chassis_config(kind), link, TrackedPlant(PLANT))


def try_to_arm(kind: str, near: ScriptedSerialLink, base: Emulator | None) -> ChassisState:
    """Five seconds of a program that wants to drive."""
    chassis = build_serial_driver(chassis_config(kind), near)
    chassis.arm(0)
    for k in range(1, 251):
        now_ns = k * 20 * MS
        if base is not None:
            base.advance_to(now_ns)
        v_mps = 0.0 if k < 200 else 0.5
        state = chassis.exchange(Setpoint(now_ns, v_mps, 0.0, 0.0), now_ns)
        assert state.mode is not ChassisMode.ARMED
        assert state.sent is None or state.sent.v_mps == 0.0
    return state


@pytest.mark.parametrize(("kind", "other"), list(permutations(SERIAL_BASES, 2)))
def test_another_kind_of_base_answers(kind: str, other: str) -> None:
    near, far = serial_pair()
    base = emulator(other, far)
    state = try_to_arm(kind, near, base)
    assert state.reason.startswith(GIVES_UP)
    assert "check " in state.reason
    assert "\n" not in state.reason
    assert base.plant.track_travel_m == (0.0, 0.0)


@pytest.mark.parametrize("kind", SERIAL_BASES)
def test_a_line_where_nobody_answers_is_told(kind: str) -> None:
    state = try_to_arm(kind, serial_pair()[0], None)
    assert state.reason.startswith(GIVES_UP)
    assert "not one byte came; check port, power" in state.reason


@pytest.mark.parametrize("kind", SERIAL_BASES)
def test_at_a_wrong_baud_rate_arming_gives_up_with_a_hint(kind: str) -> None:
    """Bits sampled at another rate: other bytes, of about the same number."""
    rng = random.Random(7)
    near, far = serial_pair()
    base = emulator(kind, far)
    near.set_filter(lambda data: rng.randbytes(len(data)))
    far.set_filter(lambda data: rng.randbytes(len(data)))
    # A controller that only answers may have nothing to say to such noise.
    near.deliver(rng.randbytes(50))
    state = try_to_arm(kind, near, base)
    assert state.reason.startswith(GIVES_UP)
    assert "baud" in state.reason
    assert base.plant.track_travel_m == (0.0, 0.0)


def test_a_base_at_another_address_is_silence_with_a_hint_to_the_address() -> None:
    near, far = serial_pair()
    config = chassis_config("roboclaw").model_copy(update={"address": 0x83})
    base = build_serial_emulator(config, far, TrackedPlant(PLANT))
    state = try_to_arm("roboclaw", near, base)
    assert "not one byte came; check port, power" in state.reason
    assert "address" in state.reason
