"""The models as data: what the manuals say, and what is done with it."""

from __future__ import annotations

from typing import get_args

import pytest

from config.agilex import AGILEX_TOP_SPEED_MPS, AGILEX_TOP_YAW_RATE_RADPS, NO_SERIAL, AgilexModelName
from config.chassis import CanLinkConfig, SerialLinkConfig
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import (
    ActuatorFast,
    ActuatorSlow,
    AgilexMessage,
    ControlModeCommand,
    MotionFeedback,
    SystemState,
    decode,
    encode,
)
from hal.chassis.agilex_models import BUNKER, MODELS, SCOUT, TRACER, track_width_of
from hal.links.scripted import ScriptedCanLink
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.chassis_rig import MS, agilex_config, can_link_config


def test_every_name_of_the_configuration_has_its_data() -> None:
    assert set(MODELS) == set(get_args(AgilexModelName))
    assert set(AGILEX_TOP_SPEED_MPS) == set(AGILEX_TOP_YAW_RATE_RADPS) == set(MODELS)
    assert {name for name, model in MODELS.items() if model.mode_serial is None} == set(NO_SERIAL)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_can_be_driven_over_can(name: str) -> None:
    model = MODELS[name]
    assert model.command_mode(over_serial=False) == 1
    assert model.mode_standby not in model.modes_remote
    assert model.describe_mode(1) == "CAN"


def test_a_model_without_a_serial_port_has_no_mode_for_it() -> None:
    with pytest.raises(ValueError, match="tracer has no serial port"):
        TRACER.command_mode(over_serial=True)


def test_the_tables_of_scout_are_not_those_of_the_sdk() -> None:
    """0x0100 is "motor driver" in the SDK, and an empty battery on this base."""
    assert SCOUT.describe_system_faults(0x0501) == (
        "system fault: unknown bit 0x0001",
        "system fault: battery below 22 V",
        "system fault: remote control lost",
    )
    assert BUNKER.describe_system_faults(0x0100) == ("system fault: unknown bit 0x0100",)
    assert SCOUT.describe_driver_state(2, 0x70) == ("driver 2: CAN lost", "driver 2: unknown bit 0x0020")
    assert BUNKER.describe_driver_state(0, 0x30) == (
        "driver 0: sensor fault or CAN lost",
        "driver 0: driver fault",
    )


def test_the_width_is_the_model_s_unless_the_file_says_otherwise() -> None:
    link = CanLinkConfig(interface="virtual", channel="x")
    bare = {"kind": "agilex", "link": link, "model": "scout"}
    config = agilex_config(link)
    assert track_width_of(config.model_validate(bare)) == 0.576
    assert track_width_of(config.model_validate(bare | {"track_width_m": 0.6})) == 0.6
    assert track_width_of(config.model_validate(bare | {"track_width_m": None})) is None
    assert track_width_of(config.model_validate(bare | {"model": "bunker"})) is None


class Bench:
    """A driver for this model, and a hand that says what the base says."""

    def __init__(self, model: str, **changes: object) -> None:
        self.link = ScriptedCanLink()
        values: dict[str, object] = {"track_width_m": None, "slip_factor": 1.0, "model": model}
        self.chassis = AgilexChassis(self.link, agilex_config(can_link_config(), **(values | changes)))
        self.now_ns = 0

    def exchange(self, *said: AgilexMessage, v_mps: float = 0.0) -> ChassisState:
        self.link.deliver(*(encode(message) for message in said))
        self.link.sent.clear()
        self.now_ns += 20 * MS
        return self.chassis.exchange(Setpoint(self.now_ns, v_mps, 0.0, 0.0), self.now_ns)

    def arm(self) -> None:
        self.chassis.arm(self.now_ns)
        assert self.exchange(STATE, MOTION).mode is ChassisMode.ARMED


STATE = SystemState(0, 1, 25.0, 0, 0)
MOTION = MotionFeedback(0.0, 0.0)


@pytest.mark.parametrize("other", [ActuatorFast(2, 0, 0.0, 0), ActuatorSlow(3, 25.0, 20, 20, 0)])
def test_more_motors_than_the_model_has_are_a_wrong_model(other: ActuatorFast | ActuatorSlow) -> None:
    bench = Bench("bunker")
    bench.exchange(STATE, MOTION, other)
    bench.chassis.arm(bench.now_ns)
    state = bench.exchange(STATE, MOTION)
    assert state.mode is ChassisMode.ESTOP
    assert state.reason.startswith(
        f"motor {other.index + 1} reports, but model bunker has 2; check chassis.model"
    )
    assert "\n" not in state.reason


@pytest.mark.parametrize("bench", [Bench("scout"), Bench("bunker", actuators=4)], ids=["model", "file"])
def test_each_motor_of_a_model_may_report(bench: Bench) -> None:
    bench.exchange(ActuatorFast(3, 0, 0.0, 0), ActuatorSlow(3, 25.0, 20, 20, 0x40))
    bench.arm()


def test_limits_are_the_model_s() -> None:
    bench = Bench("scout")
    bench.arm()
    state = bench.exchange(STATE, MOTION, v_mps=2.0)
    assert state.sent is not None
    assert state.sent.v_mps == 1.5


def modes(bench: Bench) -> list[int]:
    decoded = [decode(frame) for frame in bench.link.sent]
    return [message.mode for message in decoded if isinstance(message, ControlModeCommand)]


def test_bunker_mini_is_told_its_mode_again_and_again_while_armed_and_never_after_a_latch() -> None:
    bench = Bench("bunker_mini")
    bench.arm()
    told = []
    for _ in range(50):
        bench.exchange(STATE, MOTION)
        told += modes(bench)
    assert told == [1] * 50
    assert bench.exchange(SystemState(0, 0, 25.0, 0, 0), MOTION).mode is ChassisMode.ESTOP
    for _ in range(50):
        bench.exchange(SystemState(0, 0, 25.0, 0, 0), MOTION)
        assert modes(bench) == [], "a base that restarted stays in standby"


def test_tracer_in_the_hands_of_its_remote_control() -> None:
    bench = Bench("tracer")
    bench.arm()
    state = bench.exchange(SystemState(0, 0, 25.0, 0x0200, 0), MOTION, v_mps=0.1)
    assert state.mode is ChassisMode.ESTOP
    assert state.reason == "the base no longer obeys: control mode is remote control or standby"
    assert state.faults == ("system fault: battery low",)
    assert modes(bench) == [], "it is left in charge"


def test_can_mode_over_serial_means_another_master() -> None:
    config = agilex_config(SerialLinkConfig(url="loop://"), model="bunker", track_width_m=None)
    link = ScriptedCanLink()
    chassis = AgilexChassis(link, config)
    link.deliver(encode(STATE), encode(MOTION))
    state = chassis.exchange(None, 20 * MS)
    assert (state.mode, state.reason) == (ChassisMode.ESTOP, "CAN has taken over")
