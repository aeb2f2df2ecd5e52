"""Any CAN bus that python-can can open. The only module that imports python-can.

The control loop sends and receives by itself. It does not use python-can's Notifier, which spins after an
unplug, nor send_periodic, which would go on sending the last command while the program hangs.
"""

from __future__ import annotations

import errno
import termios
from collections import deque
from contextlib import suppress
from typing import Any

import can
from can.interfaces.slcan import slcanBus

from config.chassis import CanLinkConfig
from hal.errors import DeviceNotFound, DeviceRefused
from hal.links.reopening import ReopeningLink, reason
from hal.types import CanFrame

# How long a send waits for room in the queue. It must be positive: with 0, pyserial (below slcan) spins for
# ever on a full port.
_SEND_TIMEOUT_S = 0.002
# The same over slcan. pyserial waits for room once more even after it has written everything, so with 2 ms a
# process that others hold up would take its port for lost. Therefore the same as in hal.links.serial_port: a
# tenth of the time-out of a CAN base.
_SERIAL_SEND_TIMEOUT_S = 0.05

# One receive() gives up after this many messages in a row that are not for us: a flood must not hold up the
# control loop.
_MAX_FOREIGN = 256

# linux/can/error.h: the controller has left the bus.
_ERROR_BUS_OFF = 0x40
_BUS_OFF = "bus-off"

# python-can's error when nobody on the bus acknowledges.
_BUFFER_FULL = "Transmit buffer full"

_OPEN_ERRORS = (can.CanError, OSError, ValueError, ImportError, NotImplementedError)


class CanBusLink(ReopeningLink[can.BusABC]):
    """hal.api.CanLink over python-can."""

    def __init__(self, config: CanLinkConfig) -> None:
        # Opening and closing slcan sleeps for 0.1 s, and writes to the adapter without a time-out.
        slow = config.interface == "slcan"
        super().__init__(f"CAN {config.interface} {config.channel!r}", (can.CanError, OSError), slow)
        self._config = config
        # python-can's udp_multicast also receives what it sends itself, which cannot be switched off.
        self._echoes: deque[CanFrame] | None = (
            deque(maxlen=_MAX_FOREIGN) if config.interface == "udp_multicast" else None
        )
        # gs_usb gives back what it has sent. SocketCAN marks what other programs of this computer send in the
        # same way, and that must be heard.
        self._marks_own_frames = config.interface == "gs_usb"
        self._send_timeout_s = _SERIAL_SEND_TIMEOUT_S if config.interface == "slcan" else _SEND_TIMEOUT_S

    def send(self, frame: CanFrame) -> None:
        """Queue one frame; wait for room at most 2 ms, or 50 ms over slcan. Raises LinkLost."""
        message = can.Message(
            arbitration_id=frame.arbitration_id, data=frame.data, is_extended_id=False, check=True
        )
        try:
            self._require_open().send(message, timeout=self._send_timeout_s)
        except (can.CanError, OSError) as error:
            raise self._mark_lost("sending", error) from error
        if self._echoes is not None:
            self._echoes.append(frame)

    def receive(self) -> CanFrame | None:
        """The oldest classic frame with an 11-bit identifier, without waiting; None if there is none. Raises
        LinkLost."""
        bus = self._require_open()
        for _ in range(_MAX_FOREIGN):
            try:
                message = bus.recv(timeout=0)
                if message is None and _has_more(bus):
                    continue
            except (can.CanError, OSError) as error:
                if _is_undecodable(error):
                    self._drop_partial(bus)
                    continue
                raise self._mark_lost("receiving", error) from error
            except (ValueError, IndexError):  # slcan: noise on the line
                continue
            if message is None:
                return None
            if message.is_error_frame:
                if message.arbitration_id & _ERROR_BUS_OFF:
                    raise self._mark_lost("receiving", can.CanOperationError(_BUS_OFF))
                continue
            if self._marks_own_frames and not message.is_rx:
                continue
            if message.is_extended_id or message.is_remote_frame or message.is_fd:
                continue
            frame = CanFrame(message.arbitration_id, bytes(message.data))
            if self._echoes and frame in self._echoes:
                self._echoes.remove(frame)
                continue
            return frame
        return None

    def _drop_partial(self, bus: can.BusABC) -> None:
        """Drop a damaged line of slcan. python-can 4.6.1 decodes a line before it clears it, so noise that is
        not ASCII would stay and spoil every later line. Raises LinkLost."""
        if not isinstance(bus, slcanBus):
            return
        try:
            bus.flush()
        except (can.CanError, OSError) as error:
            raise self._mark_lost("receiving", error) from error

    def _open(self) -> can.BusABC:
        return _open(self._config, self._where)

    def _close(self, device: can.BusABC) -> None:
        device.shutdown()

    def _close_lost(self, device: can.BusABC) -> None:
        if isinstance(device, slcanBus):
            # An adapter that hung must not send old commands when it works again.
            with suppress(OSError, termios.error):
                device.serialPortOrig.reset_output_buffer()
        super()._close_lost(device)

    def _remedy(self, error: Exception) -> str:
        error_number = _errno(error)
        if self._config.interface == "socketcan" and error_number == errno.ENETDOWN:
            return f"the bus is down: `ip link set {self._config.channel} up type can bitrate 500000`"
        if error_number == errno.ENOBUFS or str(error) in (_BUS_OFF, _BUFFER_FULL):
            advice = (
                "no node acknowledges: check the base's power, CAN high and low, termination and 500 kbit/s"
            )
            if self._config.interface == "socketcan" and str(error) == _BUS_OFF:
                return f"{advice}, then `ip link set {self._config.channel} type can restart`"
            return advice
        return super()._remedy(error)


def _open(config: CanLinkConfig, where: str) -> can.BusABC:
    options: dict[str, Any] = {}
    if config.interface == "udp_multicast":
        options = {"port": config.port, "hop_limit": config.hop_limit, "fd": False}
    elif config.interface == "slcan":
        options = {"bitrate": config.bitrate, "sleep_after_open": 0.1, "timeout": 0}
    elif config.interface not in ("virtual", "socketcan"):
        options = {"bitrate": config.bitrate}
    try:
        # ignore_config: otherwise configuration files and environment variables would add options unnoticed.
        bus = can.Bus(
            channel=config.channel,
            interface=config.interface,
            ignore_config=True,
            receive_own_messages=False,
            **options,
        )
        if isinstance(bus, slcanBus):
            # It would wait after every frame until the adapter has taken it: for ever if the adapter hangs.
            bus.serialPortOrig.flush = _skip_flush  # type: ignore[method-assign]  # of this one port
        return bus
    except _OPEN_ERRORS as error:
        error_number = _errno(error)
        if error_number in (errno.EACCES, errno.EPERM):
            raise DeviceRefused(
                f"{where}: permission denied; add the user to the group of the adapter's port (often "
                "dialout), then log in again"
            ) from error
        if error_number in (errno.EBUSY, errno.EADDRINUSE, errno.EAGAIN):
            raise DeviceRefused(
                f"{where}: in use by another program ({reason(error)}); stop that one first"
            ) from error
        raise DeviceNotFound(
            f"{where}: cannot be opened ({reason(error)}); {_advice(config, error_number)}"
        ) from error


def _advice(config: CanLinkConfig, error_number: int | None) -> str:
    if config.interface == "socketcan" and error_number == errno.EAFNOSUPPORT:
        return "this kernel has no SocketCAN; try `modprobe can_raw`, or use another interface"
    if config.interface == "socketcan" and config.channel.startswith("vcan"):
        return f"`ip link add dev {config.channel} type vcan`, then `ip link set {config.channel} up`"
    if config.interface == "socketcan":
        return (
            f"check `ip link show {config.channel}`, then "
            f"`ip link set {config.channel} up type can bitrate 500000`"
        )
    if config.interface == "udp_multicast":
        return "check that the channel is a multicast address and that the machine has a multicast route"
    return "check interface and channel in the configuration, and that the adapter is plugged in"


def _skip_flush() -> None:
    """Replacement for pyserial's flush(), which has no time-out."""


def _has_more(bus: can.BusABC) -> bool:
    """Whether more lines of slcan are waiting: the acknowledgement of a sent frame reads as None, but frames
    may follow it."""
    return isinstance(bus, slcanBus) and bus.serialPortOrig.in_waiting > 0


def _errno(error: BaseException | None) -> int | None:
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None:
            return error.errno
        error = error.__cause__
    return None


def _is_undecodable(error: Exception) -> bool:
    """Whether the error only means that what arrived could not be decoded. Anybody may send to a group of
    udp_multicast, and the line of slcan has noise; neither is a fault of the bus."""
    cause = error.__cause__
    return cause is not None and not isinstance(cause, OSError)
