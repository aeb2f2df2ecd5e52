"""Two computers, or two programs, on one CAN bus: the base would follow both, one frame after the other."""

from __future__ import annotations

import pytest

from config.chassis import SerialLinkConfig
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import (
    AgilexMessage,
    ClearError,
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    encode,
)
from hal.chassis.agilex_serial import AgilexSerialBus, wrap
from hal.links.scripted import serial_pair
from hal.types import CanFrame, ChassisMode
from tests.support.agilex_bench import CAN, STANDBY, Bench, state
from tests.support.chassis_rig import MS, agilex_config, udp_link_config
from tests.support.wires import open_can_link

RIVALS: dict[str, AgilexMessage] = {
    "another sender has sent motion commands (0x111) on this bus; stop the other program": MotionCommand(
        0.4, 0.0
    ),
    "another sender has sent the control mode (0x421) on this bus": ControlModeCommand(CAN),
    "another sender has sent clearing of errors (0x441) on this bus": ClearError(0),
}


@pytest.mark.parametrize("sentence", RIVALS)
def test_driver_that_hears_another_master_refuses_to_arm_and_sends_nothing(sentence: str) -> None:
    """A zero or a standby would stop a drive that is somebody else's."""
    bench = Bench()
    bench.deliver(state(CAN), MotionFeedback(0.4, 0.0), RIVALS[sentence])
    bench.chassis.arm(bench.now_ns)
    for _ in range(3):
        bench.deliver(state(CAN), MotionFeedback(0.4, 0.0), RIVALS[sentence])
        seen = bench.exchange(0.0)
        assert seen.mode is ChassisMode.ESTOP
        assert seen.sent is None
        assert sentence in seen.reason
        assert bench.link.sent == []
    bench.chassis.stop(bench.now_ns)
    assert bench.link.sent == []


@pytest.mark.parametrize("sentence", RIVALS)
def test_another_master_latches_a_drive_which_ends_with_zero_and_standby(sentence: str) -> None:
    bench = Bench()
    bench.arm()
    assert bench.exchange(0.3).mode is ChassisMode.ARMED
    bench.deliver(state(CAN), MotionFeedback(0.3, 0.0), RIVALS[sentence])
    seen = bench.exchange(0.3)
    assert seen.mode is ChassisMode.ESTOP
    assert sentence in seen.reason
    assert bench.sent() == [MotionCommand(0.0, 0.0), ControlModeCommand(STANDBY)]


def test_a_frame_of_any_length_counts() -> None:
    """Some senders pad 0x421 to eight bytes, and a motion command that is cut short is one all the same."""
    for frame in (CanFrame(0x421, b"\x01" + bytes(7)), CanFrame(0x111, b"\x00")):
        bench = Bench()
        bench.arm()
        bench.link.deliver(frame)
        assert bench.exchange(0.3).mode is ChassisMode.ESTOP


def test_once_the_bus_is_free_for_a_second_a_person_may_arm() -> None:
    bench = Bench()
    bench.arm()
    bench.deliver(MotionCommand(0.0, 0.0))
    bench.exchange(0.0)
    for k in range(60):
        bench.deliver(state(CAN), MotionFeedback(0.0, 0.0))
        seen = bench.exchange(0.0)
        assert seen.mode is ChassisMode.ESTOP
        assert ("arm again" in seen.reason) == (k >= 50), f"heard {20 * (k + 1)} ms ago"
    bench.arm()


def test_lights_and_other_bus_partners_are_no_masters() -> None:
    bench = Bench()
    bench.arm()
    bench.link.deliver(CanFrame(0x121, bytes(8)), CanFrame(0x411, b"\x01"), CanFrame(0x7E8, bytes(8)))
    assert bench.exchange(0.3).mode is ChassisMode.ARMED


def test_an_echo_on_a_serial_line_is_no_master() -> None:
    """One computer is at its end; what it sends may come back where the wires touch."""
    near, far = serial_pair()
    chassis = AgilexChassis(AgilexSerialBus(near), agilex_config(SerialLinkConfig(url="loop://")))
    chassis.arm(0)
    echo = wrap(encode(MotionCommand(0.0, 0.0)), 0)
    assert echo is not None
    far.write(echo)
    assert chassis.exchange(None, 20 * MS).mode is ChassisMode.ARMING


def test_two_drivers_on_one_multicast_bus_hear_each_other_and_not_themselves() -> None:
    """Also where both send the very same bytes."""
    link = udp_link_config()
    with open_can_link(link) as first_end, open_can_link(link) as second_end:
        first, second = (AgilexChassis(end, agilex_config(link)) for end in (first_end, second_end))
        for k in range(1, 4):
            assert first.exchange(None, 20 * k * MS).mode is ChassisMode.STANDBY
        second.arm(0)
        assert second.exchange(None, 20 * MS).reason.startswith(
            "another sender has sent motion commands (0x111)"
        )
        assert first.exchange(None, 80 * MS).mode is ChassisMode.STANDBY, "the second has not said a word"
