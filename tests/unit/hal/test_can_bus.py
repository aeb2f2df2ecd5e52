from __future__ import annotations

import errno
import logging
import os
import socket
from collections.abc import Iterator

import can
import pytest

from config.chassis import CanLinkConfig
from hal.errors import DeviceNotFound, DeviceRefused, LinkLost
from hal.links import reopening
from hal.links.can_bus import CanBusLink
from hal.types import CanFrame
from tests.support.chassis_rig import can_link_config, udp_link_config
from tests.support.wires import open_can_link

FRAME = CanFrame(0x111, b"\x00\x96")
# The kernel carries bytes through a pseudo-terminal when a core is free, which may take a while.
PATIENCE_S = 10.0


class FaultyBus(can.BusABC):
    """A bus whose next calls raise, or give these messages."""

    def __init__(self) -> None:
        self.error: Exception | None = None
        self.messages: list[can.Message] = []
        self.sent: list[can.Message] = []
        self.timeouts_s: list[float | None] = []
        self.shut = 0
        super().__init__(channel="faulty")

    def _fail(self) -> None:
        if self.error is not None:
            raise self.error

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        assert timeout, "0 makes pyserial below slcan spin, None may wait for ever"
        self._fail()
        self.timeouts_s.append(timeout)
        self.sent.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        assert timeout == 0
        self._fail()
        return (self.messages.pop(0) if self.messages else None), False

    def shutdown(self) -> None:
        super().shutdown()
        self.shut += 1
        self._fail()


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[FaultyBus]:
    made = FaultyBus()
    monkeypatch.setattr(can, "Bus", lambda **options: made)
    yield made
    made.error = None
    made.shutdown()


def config(interface: str, channel: str) -> CanLinkConfig:
    return CanLinkConfig.model_validate({"interface": interface, "channel": channel})


@pytest.mark.parametrize(
    ("link", "reason"),
    [
        (config("socketcan", "nocan0"), "socketcan"),
        (config("slcan", "/dev/ttyNotThere"), "No such file"),
        (config("pcan", "PCAN_USBBUS1"), "pcan"),
    ],
)
def test_an_interface_that_is_not_there_is_one_clear_line(link: CanLinkConfig, reason: str) -> None:
    with pytest.raises(DeviceNotFound) as caught:
        open_can_link(link)
    message = str(caught.value)
    assert message.startswith(f"CAN {link.interface} {link.channel!r}: cannot be opened (")
    assert reason.lower() in message.lower()
    assert "\n" not in message
    assert caught.value.__cause__ is not None


@pytest.mark.parametrize(
    ("error", "kind", "words"),
    [
        (PermissionError(13, "Permission denied"), DeviceRefused, "permission denied"),
        (OSError(16, "Device or resource busy"), DeviceRefused, "in use by another program"),
        (OSError(19, "No such device"), DeviceNotFound, "No such device"),
        (can.CanInitializationError("no driver"), DeviceNotFound, "no driver"),
        (ValueError("Invalid bitrate"), DeviceNotFound, "Invalid bitrate"),
    ],
)
def test_vendor_errors_are_translated_with_their_cause(
    monkeypatch: pytest.MonkeyPatch, error: Exception, kind: type[Exception], words: str
) -> None:
    def refuse(**options: object) -> None:
        raise error

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(kind, match=words) as caught:
        open_can_link(config("socketcan", "can0"))
    assert caught.value.__cause__ is error


@pytest.mark.parametrize(
    ("channel", "number", "words"),
    [
        ("can0", errno.ENODEV, "`ip link set can0 up type can bitrate 500000`"),
        ("vcan0", errno.ENODEV, "`ip link add dev vcan0 type vcan`, then `ip link set vcan0 up`"),
        ("can0", errno.EAFNOSUPPORT, "this kernel has no SocketCAN; try `modprobe can_raw`"),
    ],
)
def test_missing_system_bus_error_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, channel: str, number: int, words: str
) -> None:
    def refuse(**options: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(DeviceNotFound) as caught:
        open_can_link(config("socketcan", channel))
    assert words in str(caught.value)


def test_settings_of_the_machine_are_not_mixed_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can would else add options from the environment and from files in the home folder."""
    given: list[dict[str, object]] = []

    def note(**options: object) -> FaultyBus:
        given.append(options)
        return FaultyBus()

    monkeypatch.setattr(can, "Bus", note)
    for link in (config("slcan", "/dev/ttyACM0"), config("socketcan", "can0"), udp_link_config()):
        with CanBusLink(link):
            pass
    assert [options["ignore_config"] for options in given] == [True, True, True]
    assert given[0]["bitrate"] == 500_000
    assert "bitrate" not in given[1]
    assert given[2]["hop_limit"] == 0


@pytest.mark.parametrize(
    "error", [can.CanOperationError("Transmit buffer full"), OSError(100, "Network is down")]
)
def test_an_error_in_use_is_a_lost_link_and_the_next_use_opens_anew(bus: FaultyBus, error: Exception) -> None:
    link = CanBusLink(config("socketcan", "can0"))
    link.send(FRAME)
    bus.error = error
    with pytest.raises(LinkLost, match=r"CAN socketcan 'can0': lost while sending \(") as caught:
        link.send(FRAME)
    assert caught.value.__cause__ is error
    assert bus.shut == 1
    with pytest.raises(LinkLost, match="lost while receiving"):
        link.receive()
    bus.error = None
    link.send(FRAME)
    assert len(bus.sent) == 2


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENETDOWN, "Network is down"), "`ip link set can0 up type can bitrate 500000`"),
        (
            OSError(errno.ENOBUFS, "No buffer space available"),
            "no node acknowledges: check the base",
        ),
        (can.CanOperationError("Transmit buffer full"), "no node acknowledges"),
        (OSError(errno.ENODEV, "No such device"), "check the adapter, the cable and the power of the base"),
    ],
)
def test_a_lost_bus_says_what_to_do(bus: FaultyBus, error: Exception, words: str) -> None:
    bus.error = error
    with pytest.raises(LinkLost) as caught:
        CanBusLink(config("socketcan", "can0")).send(FRAME)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_bus_that_cannot_be_opened_again_stays_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    link = CanBusLink(config("socketcan", "nocan0"))
    for _ in range(2):
        with pytest.raises(LinkLost, match="cannot be opened"):
            link.receive()


def test_bus_off_is_a_lost_link(bus: FaultyBus) -> None:
    link = CanBusLink(config("socketcan", "can0"))
    bus.messages = [can.Message(arbitration_id=0x40, is_error_frame=True)]
    with pytest.raises(LinkLost, match=r"\(bus-off\); .*, then `ip link set can0 type can restart`"):
        link.receive()


def test_frames_other_than_classic_data_frames_are_skipped(bus: FaultyBus) -> None:
    bus.messages = [
        can.Message(arbitration_id=0x4, is_error_frame=True),  # an error, but not bus-off
        can.Message(arbitration_id=0x221, is_extended_id=True, data=b"\x01"),
        can.Message(arbitration_id=0x221, is_extended_id=False, is_remote_frame=True, dlc=8),
        can.Message(arbitration_id=0x221, is_extended_id=False, data=b"\x02"),
    ]
    link = CanBusLink(config("socketcan", "can0"))
    assert link.receive() == CanFrame(0x221, b"\x02")
    assert link.receive() is None


def test_a_flood_of_foreign_messages_ends_a_receive(bus: FaultyBus) -> None:
    foreign = can.Message(arbitration_id=0x221, is_extended_id=True)
    bus.messages = [foreign] * 1000
    assert CanBusLink(config("socketcan", "can0")).receive() is None
    assert len(bus.messages) == 1000 - 256


def test_shutting_down_a_dead_adapter_raises_nothing(
    bus: FaultyBus, caplog: pytest.LogCaptureFixture
) -> None:
    """python-can's slcan raises from shutdown() after an unplug."""
    with caplog.at_level(logging.DEBUG, logger=reopening.__name__), CanBusLink(config("slcan", "x")):
        bus.error = can.CanOperationError("gone")
    assert "gone" in caplog.text


def test_opening_twice_opens_once() -> None:
    link = open_can_link(can_link_config())
    with link as again:
        assert again is link
        link.send(FRAME)


def test_a_datagram_that_is_no_frame_does_not_lose_the_bus() -> None:
    """Anybody may send to a multicast group."""
    udp = udp_link_config()
    with CanBusLink(udp) as link, CanBusLink(udp) as peer:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            stranger.sendto(b"hello?", (udp.channel, udp.port))
            stranger.sendto(b"", (udp.channel, udp.port))
        peer.send(FRAME)
        assert link.receive() == FRAME


@pytest.mark.parametrize(
    ("interface", "timeout_s"), [("slcan", 0.05), ("socketcan", 0.002), ("gs_usb", 0.002)]
)
def test_how_long_a_send_waits_for_room(bus: FaultyBus, interface: str, timeout_s: float) -> None:
    """pyserial counts the time until there is room for more: 2 ms are over when another process runs."""
    CanBusLink(config(interface, "x")).send(FRAME)
    assert bus.timeouts_s == [timeout_s]


@pytest.mark.parametrize(("interface", "heard"), [("gs_usb", None), ("socketcan", FRAME)])
def test_gs_usb_gives_back_its_own_frames_and_socketcan_those_of_other_programs(
    bus: FaultyBus, interface: str, heard: CanFrame | None
) -> None:
    """Marked alike; a frame of one's own would count as one of somebody who also drives."""
    bus.messages.append(
        can.Message(arbitration_id=FRAME.arbitration_id, data=FRAME.data, is_extended_id=False, is_rx=False)
    )
    with CanBusLink(config(interface, "can0")) as link:
        assert link.receive() == heard
