"""What every link must do. One factory for a new one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from config.chassis import CanLinkConfig, SerialLinkConfig
from hal.api import CanLink, SerialLink
from hal.errors import HalError, LinkLost
from hal.links.can_bus import CanBusLink
from hal.links.scripted import can_pair, serial_pair
from hal.types import CanFrame
from tests.support.chassis_rig import can_link_config, udp_link_config
from tests.support.contract_rigs import vcan_link_config
from tests.support.wires import SettledPort, SettledTerminal


@dataclass
class CanPair:
    """Two ends of one bus."""

    near: CanLink
    far: CanLink


BUSES: dict[str, Callable[[], CanLinkConfig]] = {
    "virtual": can_link_config,
    "udp_multicast": udp_link_config,
    "vcan": vcan_link_config,
}


@pytest.fixture(params=["scripted", "virtual", "udp_multicast", "vcan"])
def can_ends(request: pytest.FixtureRequest) -> Iterator[CanPair]:
    with ExitStack() as stack:
        ends: tuple[CanLink, CanLink] = can_pair()
        if request.param != "scripted":
            config = BUSES[request.param]()
            ends = CanBusLink(config), CanBusLink(config)
        try:
            near, far = stack.enter_context(ends[0]), stack.enter_context(ends[1])
        except HalError as error:
            pytest.skip(f"no {request.param} on this machine: {error}")
        yield CanPair(near, far)


def test_can_silence_is_none(can_ends: CanPair) -> None:
    assert can_ends.near.receive() is None
    assert can_ends.near.receive() is None


def test_can_frames_arrive_whole_in_order_and_once(can_ends: CanPair) -> None:
    frames = [CanFrame(0x111 + n, bytes(range(n % 9))) for n in range(20)]
    for frame in frames:
        can_ends.near.send(frame)
    assert [can_ends.far.receive() for _ in frames] == frames
    assert can_ends.far.receive() is None


def test_can_does_not_hear_itself(can_ends: CanPair) -> None:
    can_ends.near.send(CanFrame(0x111, b"\x01"))
    assert can_ends.near.receive() is None


def test_can_both_directions(can_ends: CanPair) -> None:
    can_ends.near.send(CanFrame(0x111, b"\x01"))
    can_ends.far.send(CanFrame(0x221, b"\x02"))
    assert can_ends.near.receive() == CanFrame(0x221, b"\x02")
    assert can_ends.far.receive() == CanFrame(0x111, b"\x01")


def test_a_closed_python_can_link_says_so() -> None:
    with CanBusLink(can_link_config()) as link:
        pass
    with pytest.raises(LinkLost, match="closed"):
        link.send(CanFrame(0x111, b""))
    with pytest.raises(LinkLost, match="closed"):
        link.receive()


@dataclass
class SerialPair:
    """Two ends of one line, and how to pull it out."""

    near: SerialLink
    far: SerialLink
    unplug: Callable[[], None]


@pytest.fixture(params=["scripted", "pseudo-terminal"])
def serial_ends(request: pytest.FixtureRequest) -> Iterator[SerialPair]:
    with ExitStack() as stack:
        if request.param == "scripted":
            near, far = serial_pair()
            yield SerialPair(stack.enter_context(near), stack.enter_context(far), near.unplug)
        else:
            terminal = stack.enter_context(SettledTerminal())
            port = SettledPort(SerialLinkConfig(url=terminal.path, baud=115_200), terminal)
            yield SerialPair(stack.enter_context(port), terminal, terminal.unplug)


def test_serial_silence_is_empty(serial_ends: SerialPair) -> None:
    assert serial_ends.near.read() == b""
    assert serial_ends.far.read() == b""


def read_all(link: SerialLink, count: int) -> bytes:
    """count bytes: the kernel may carry a write over in parts, and takes its time."""
    received = b""
    for _ in range(1_000_000):
        received += link.read()
        if len(received) >= count:
            break
    return received


def test_serial_carries_every_byte_both_ways(serial_ends: SerialPair) -> None:
    """All 256, among them those that a terminal in its usual mode would change, echo or eat."""
    everything = bytes(range(256))
    serial_ends.near.write(everything)
    assert read_all(serial_ends.far, 256) == everything
    serial_ends.far.write(everything)
    assert read_all(serial_ends.near, 256) == everything
    assert serial_ends.near.read() == b"", "no echo"


def test_serial_merges_writes(serial_ends: SerialPair) -> None:
    serial_ends.near.write(b"one")
    serial_ends.near.write(b"two")
    assert read_all(serial_ends.far, 6) == b"onetwo"


def test_serial_unplugged_is_lost_for_reading_and_writing(serial_ends: SerialPair) -> None:
    serial_ends.near.write(b"still there")
    serial_ends.unplug()
    for use in (serial_ends.near.read, lambda: serial_ends.near.write(b"x"), serial_ends.near.read):
        with pytest.raises(LinkLost):
            use()
