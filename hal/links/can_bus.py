"""Any CAN bus that python-can can open. The only module that imports it.

No python-can Notifier (it spins after an unplug) and no send_periodic (it would go on sending the last
command while the program hangs): the control loop sends and receives by itself.
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

# How long a send waits for room. Positive, because with 0 pyserial (below slcan) spins for ever on a full
# port. There it asks for room for more even after it has written all, so with 2 ms a process that is held up
# by others takes its port for lost. Hence as long as hal.links.serial_port: a tenth of a CAN base's time.
_SEND_TIMEOUT_S = 0.002
_SERIAL_SEND_TIMEOUT_S = 0.05

# So many messages in a row that are none of ours end one receive(): a flood must not hold the control loop.
_MAX_FOREIGN = 256

# linux/can/error.h: the controller has left the bus.
_ERROR_BUS_OFF = 0x40
_BUS_OFF = "bus-off"

# What python-can says when nobody on the bus acknowledges.
_FULL = "Transmit buffer full"

_OPEN_ERRORS = (can.CanError, OSError, ValueError, ImportError, NotImplementedError)


class CanBusLink(ReopeningLink[can.BusABC]):
    """hal.api.CanLink over python-can."""

    def __init__(self, config: CanLinkConfig) -> None:
        # slcan sleeps for 0.1 s in between, and writes to the adapter without a time-out.
        slow = config.interface == "slcan"
        super().__init__(f"CAN {config.interface} {config.channel!r}", (can.CanError, OSError), slow)
        self._config = config
        # python-can's udp_multicast hears what it sends itself, and cannot be told not to.
        self._echoes: deque[CanFrame] | None = (
            deque(maxlen=_MAX_FOREIGN) if config.interface == "udp_multicast" else None
        )
        self._send_timeout_s = _SERIAL_SEND_TIMEOUT_S if config.interface == "slcan" else _SEND_TIMEOUT_S

    def send(self, frame: CanFrame) -> None:
        """Queue one frame; waits for room at most 2 ms, 50 ms over slcan. Raises LinkLost."""
        message = can.Message(
            arbitration_id=frame.arbitration_id, data=frame.data, is_extended_id=False, check=True
        )
        try:
            self._opened().send(message, timeout=self._send_timeout_s)
        except (can.CanError, OSError) as error:
            raise self._lost("sending", error) from error
        if self._echoes is not None:
            self._echoes.append(frame)

    def receive(self) -> CanFrame | None:
        """The oldest classic frame with an 11-bit identifier, without waiting. Raises LinkLost."""
        bus = self._opened()
        for _ in range(_MAX_FOREIGN):
            try:
                message = bus.recv(timeout=0)
                if message is None and _has_more(bus):
                    continue
            except (can.CanError, OSError) as error:
                if _is_foreign_datagram(error):
                    self._drop_partial(bus)
                    continue
                raise self._lost("receiving", error) from error
            except (ValueError, IndexError):  # slcan: noise on the line that is no frame
                continue
            if message is None:
                return None
            if message.is_error_frame:
                if message.arbitration_id & _ERROR_BUS_OFF:
                    raise self._lost("receiving", can.CanOperationError(_BUS_OFF))
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
        """python-can 4.6.1's slcan decodes a line before it clears it: noise that is no ASCII would stay and
        spoil every line to come. Raises LinkLost."""
        if not isinstance(bus, slcanBus):
            return
        try:
            bus.flush()
        except (can.CanError, OSError) as error:
            raise self._lost("receiving", error) from error

    def _open(self) -> can.BusABC:
        return _open(self._config, self._where)

    def _close(self, device: can.BusABC) -> None:
        device.shutdown()

    def _close_lost(self, device: can.BusABC) -> None:
        if isinstance(device, slcanBus):
            # An adapter that hung must not send old commands when it wakes.
            with suppress(OSError, termios.error):
                device.serialPortOrig.reset_output_buffer()
        super()._close_lost(device)

    def _remedy(self, error: Exception) -> str:
        number = _errno(error)
        if self._config.interface == "socketcan" and number == errno.ENETDOWN:
            return f"the bus is down: `ip link set {self._config.channel} up type can bitrate 500000`"
        if number == errno.ENOBUFS or str(error) in (_BUS_OFF, _FULL):
            advice = (
                "nobody acknowledges: check the base's power, CAN high and low, termination and 500 kbit/s"
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
        # ignore_config: else files and environment variables of the machine would add options unseen.
        bus = can.Bus(
            channel=config.channel,
            interface=config.interface,
            ignore_config=True,
            receive_own_messages=False,
            **options,
        )
        if isinstance(bus, slcanBus):
            # It would wait behind every frame until the adapter has taken it: for ever, from one that hangs.
            bus.serialPortOrig.flush = _wait_for_nothing  # type: ignore[method-assign]
        return bus
    except _OPEN_ERRORS as error:
        number = _errno(error)
        if number in (errno.EACCES, errno.EPERM):
            raise DeviceRefused(
                f"{where}: permission denied; add the user to the group of the adapter's port (often "
                "dialout), then log in again"
            ) from error
        if number in (errno.EBUSY, errno.EADDRINUSE, errno.EAGAIN):
            raise DeviceRefused(
                f"{where}: in use by another program ({reason(error)}); stop that one first"
            ) from error
        raise DeviceNotFound(
            f"{where}: cannot be opened ({reason(error)}); {_advice(config, number)}"
        ) from error


def _advice(config: CanLinkConfig, number: int | None) -> str:
    if config.interface == "socketcan" and number == errno.EAFNOSUPPORT:
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


def _wait_for_nothing() -> None:
    """In place of pyserial's flush(), which has no time-out."""


def _has_more(bus: can.BusABC) -> bool:
    """slcan: what acknowledges a sent frame reads as silence, and behind it others may wait."""
    return isinstance(bus, slcanBus) and bus.serialPortOrig.in_waiting > 0


def _errno(error: BaseException | None) -> int | None:
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None:
            return error.errno
        error = error.__cause__
    return None


def _is_foreign_datagram(error: Exception) -> bool:
    """What arrived does not unpack: anybody may send to a group of udp_multicast, and slcan's line has noise.
    It is no fault of the bus."""
    cause = error.__cause__
    return cause is not None and not isinstance(cause, OSError)
