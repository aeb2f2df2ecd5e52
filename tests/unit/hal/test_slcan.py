"""The text protocol of cheap USB adapters for CAN, on a pseudo-terminal."""

from __future__ import annotations

import termios
import time

import pytest

from config.chassis import CanLinkConfig
from hal.errors import LinkLost
from hal.links.can_bus import CanBusLink
from hal.links.pseudo_terminal import PseudoTerminal
from hal.types import CanFrame
from tests.support.wires import SettledTerminal

FRAME = CanFrame(0x111, b"\x00\x96")
# The kernel carries bytes through a pseudo-terminal when a core is free, which may take a while.
PATIENCE_S = 10.0


def slcan(adapter: PseudoTerminal) -> CanLinkConfig:
    return CanLinkConfig(interface="slcan", channel=adapter.path)


def test_slcan_adapter_on_a_serial_port() -> None:
    """The text protocol of cheap USB adapters, at the bit rate of AgileX; noise is passed over."""
    with PseudoTerminal() as adapter, CanBusLink(slcan(adapter)) as link:
        link.send(FRAME)
        assert hear(adapter, until=b"t11120096\r").count(b"S6\r") == 1, "500 kbit/s"
        adapter.write(b"t22x\rt2\rt2218FE0C00FA00000000\r")
        assert wait_for(link) == CanFrame(0x221, bytes.fromhex("FE0C00FA00000000"))
        adapter.unplug()
        with pytest.raises(LinkLost, match="lost while receiving"):
            wait_for(link)


@pytest.mark.parametrize("noise", [b"\xff", b"\x80\r", b"t22\xc3"])
def test_a_slcan_adapter_is_heard_again_after_noise_that_is_no_ascii(noise: bytes) -> None:
    with PseudoTerminal() as adapter, CanBusLink(slcan(adapter)) as link:
        adapter.write(noise)
        adapter.write(b"t2218FE0C00FA00000000\r")
        give_up_s = time.monotonic() + PATIENCE_S
        heard = None
        while heard is None and time.monotonic() < give_up_s:
            heard = link.receive()
            if heard is None:
                adapter.write(b"t2218FE0C00FA00000000\r")
        assert heard == CanFrame(0x221, bytes.fromhex("FE0C00FA00000000"))


def test_blocked_slcan_adapter_does_not_block_the_control_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can drains the port behind every frame, without a time-out."""
    with PseudoTerminal() as adapter, CanBusLink(slcan(adapter)) as link:
        monkeypatch.setattr(termios, "tcdrain", lambda port: pytest.fail("waits for the adapter"))
        link.send(FRAME)
        hear(adapter, until=b"t11120096\r")


def test_slcan_acknowledgements_hide_no_frames() -> None:
    """Two acknowledgements for each exchange, and one read of them: frames would wait longer and longer."""
    with SettledTerminal() as adapter, CanBusLink(slcan(adapter)) as link:
        adapter.write(b"z\rz\r\a\rt2211AA\rz\rt2211BB\rt22")
        assert [link.receive() for _ in range(3)] == [
            CanFrame(0x221, b"\xaa"),
            CanFrame(0x221, b"\xbb"),
            None,
        ]
        adapter.write(b"11CC\r")
        assert link.receive() == CanFrame(0x221, b"\xcc")


def test_unwritten_output_is_dropped_only_if_the_adapter_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that hung would send old motion frames when it wakes; the last zero of a drive has to arrive."""
    dropped: list[int] = []
    flush = termios.tcflush

    def watched(port: int, queue: int) -> None:
        if queue == termios.TCOFLUSH:
            dropped.append(queue)
            raise termios.error(5, "Input/output error")
        flush(port, queue)

    monkeypatch.setattr(termios, "tcflush", watched)
    with PseudoTerminal() as adapter:
        with CanBusLink(slcan(adapter)) as link:
            link.send(FRAME)
        assert dropped == []
        with CanBusLink(slcan(adapter)) as link:
            adapter.unplug()
            with pytest.raises(LinkLost, match="lost while receiving"):
                wait_for(link)
            give_up_s = time.monotonic() + PATIENCE_S
            while not dropped and time.monotonic() < give_up_s:
                time.sleep(0.001)
    assert dropped == [termios.TCOFLUSH]


def hear(adapter: PseudoTerminal, until: bytes) -> bytes:
    """All that the adapter is told, up to these bytes."""
    heard = b""
    give_up_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up_s:
        heard += adapter.read()
        if heard.endswith(until):
            return heard
    raise AssertionError(f"heard {heard!r}")


def wait_for(link: CanBusLink) -> CanFrame | None:
    """The next frame; the kernel takes its time to carry bytes through a pseudo-terminal."""
    give_up_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up_s:
        frame = link.receive()
        if frame is not None:
            return frame
    return None
