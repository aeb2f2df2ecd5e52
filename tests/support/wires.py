"""Links for tests: with a plug to pull out, and a pseudo-terminal that simulated time cannot outrun."""

from __future__ import annotations

import fcntl
import os
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager

from config.chassis import CanLinkConfig, SerialLinkConfig
from hal.api import CanLink, Device, SerialLink
from hal.device_wrapper import DeviceWrapper
from hal.errors import LinkLost
from hal.links.can_bus import CanBusLink
from hal.links.pseudo_terminal import PseudoTerminal
from hal.links.serial_port import SerialPortLink
from hal.types import CanFrame

# Bytes that can be waited for where nobody reads: a terminal's buffer, less what it keeps free.
_TERMINAL_CAPACITY = 3_900

# A busy machine may leave the kernel no core to carry bytes over for a while.
_TIMEOUT_S = 10.0


def open_serial_link(config: SerialLinkConfig) -> SerialPortLink:
    """The open port, for a test that closes it itself or wants it refused."""
    return SerialPortLink(config).__enter__()


def open_can_link(config: CanLinkConfig) -> CanBusLink:
    """The open bus, likewise."""
    return CanBusLink(config).__enter__()


class _Plug(DeviceWrapper):
    """A plug in front of any link: out, every use raises LinkLost and nothing reaches it."""

    def __init__(self, link: Device) -> None:
        super().__init__(link)
        self.out = False

    def _check(self) -> None:
        if self.out:
            raise LinkLost("unplugged")


class PluggedCan(_Plug):
    """A CAN link that can be pulled out."""

    def __init__(self, link: CanLink) -> None:
        super().__init__(link)
        self._link = link

    def send(self, frame: CanFrame) -> None:
        self._check()
        self._link.send(frame)

    def receive(self) -> CanFrame | None:
        self._check()
        return self._link.receive()

    def plug(self) -> None:
        while self._link.receive() is not None:
            """What was sent meanwhile never got here."""
        self.out = False


class PluggedSerial(_Plug):
    """A serial link that can be pulled out."""

    def __init__(self, link: SerialLink) -> None:
        super().__init__(link)
        self._link = link

    def write(self, data: bytes) -> None:
        self._check()
        self._link.write(data)

    def read(self) -> bytes:
        self._check()
        return self._link.read()

    def plug(self) -> None:
        self._link.read()
        self.out = False


class SettledTerminal(PseudoTerminal):
    """Waits until the kernel has carried the bytes over: simulated time must not outrun it."""

    def write(self, data: bytes) -> None:
        before = _bytes_available(self._slave)
        super().write(data)
        _wait_for_bytes(self._slave, min(before + len(data), _TERMINAL_CAPACITY))

    @contextmanager
    def settled(self, count: int) -> Iterator[None]:
        """Inside, the other end writes count bytes; wait until they can be read here."""
        if not self._open:
            yield
            return
        before = _bytes_available(self._master)
        yield
        _wait_for_bytes(self._master, min(before + count, _TERMINAL_CAPACITY))


class SettledPort(SerialPortLink):
    """The same for the other direction."""

    def __init__(self, config: SerialLinkConfig, terminal: SettledTerminal) -> None:
        super().__init__(config)
        self._terminal = terminal

    def write(self, data: bytes) -> None:
        with self._terminal.settled(len(data)):
            super().write(data)


def _bytes_available(descriptor: int) -> int:
    answer = bytearray(4)
    fcntl.ioctl(descriptor, termios.FIONREAD, answer)
    return int.from_bytes(answer, sys.byteorder)


def _wait_for_bytes(descriptor: int, count: int) -> None:
    deadline_s = time.monotonic() + _TIMEOUT_S
    while time.monotonic() < deadline_s:
        if _bytes_available(descriptor) >= count:
            return
        os.sched_yield()
    raise AssertionError(f"the kernel did not carry {count} bytes over")
