"""Any serial port that pyserial can open, by path or URL. The only module that imports pyserial."""

from __future__ import annotations

import errno
import grp
import os
import termios
from pathlib import Path

import serial

from config.chassis import SerialLinkConfig
from hal.errors import DeviceNotFound, DeviceRefused, HalError
from hal.links.reopening import ReopeningLink, reason

# Short, because the control loop waits for it. Positive, because with 0 pyserial spins for ever when the peer
# stops reading. A process that others hold up for this long takes its port for lost, too.
_WRITE_TIMEOUT_S = 0.05

_MAX_READ = 4096

_DEVICES = Path("/dev")

# An unplugged port raises all three kinds; termios.error is not an OSError.
_ERRORS = (serial.SerialException, OSError, termios.error)


class SerialPortLink(ReopeningLink[serial.SerialBase]):
    """hal.api.SerialLink over pyserial: exclusive, raw, 8N1."""

    def __init__(self, config: SerialLinkConfig) -> None:
        super().__init__(f"serial port {config.url}", _ERRORS, slow=config.over_network)
        self._config = config

    def write(self, data: bytes) -> None:
        """Hand all of data to the system within 50 ms. Raises LinkLost; part of data may have been sent
        then."""
        try:
            written = self._require_open().write(data)
        except _ERRORS as error:
            raise self._mark_lost("writing", error) from error
        if written != len(data):
            raise self._mark_lost("writing", OSError(f"{written} of {len(data)} bytes accepted"))

    def read(self) -> bytes:
        """What has arrived, at most 4096 bytes, without waiting. Raises LinkLost."""
        try:
            return self._require_open().read(_MAX_READ)
        except _ERRORS as error:
            raise self._mark_lost("reading", error) from error

    def _open(self) -> serial.SerialBase:
        return _open(self._config)

    def _close(self, device: serial.SerialBase) -> None:
        device.close()


def _open(config: SerialLinkConfig) -> serial.SerialBase:
    try:
        port: serial.SerialBase = serial.serial_for_url(
            config.url, baudrate=config.baud, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True
        )
    except (*_ERRORS, ValueError) as error:
        raise _hal_error(error, config) from error
    return port


def _hal_error(error: Exception, config: SerialLinkConfig) -> HalError:
    where = f"serial port {config.url}"
    error_number = getattr(error, "errno", None)
    if error_number in (errno.EACCES, errno.EPERM):
        group = _owner_group(config.url)
        return DeviceRefused(
            f"{where}: permission denied; `sudo usermod -aG {group} $USER`, then log in again (a service: "
            f"SupplementaryGroups={group})"
        )
    if error_number in (errno.EBUSY, errno.EAGAIN):
        return DeviceRefused(
            f"{where}: in use by another program; stop that one first (ModemManager takes new ports for a "
            "while, unless a udev rule tells it not to)"
        )
    # pyserial drops the number when the file is there but does not take a port's settings.
    if isinstance(error.__context__, termios.error) or error_number not in (None, errno.ENOENT):
        cause = reason(error) if error_number is None else os.strerror(error_number)
        return DeviceRefused(
            f"{where}: is not a serial port that takes {config.baud} baud ({cause}); check url and baud "
            f"({_describe_ports(_DEVICES)})"
        )
    # pyserial's own text repeats the name of the port, and the meaning of the error number.
    cause = (
        reason(error).rpartition(f"{config.url}: ")[2] if error_number is None else os.strerror(error_number)
    )
    remedy = f"that the adapter is plugged in ({_describe_ports(_DEVICES)})"
    if not config.url.startswith(f"{_DEVICES}/"):
        remedy = "that the program which creates this port, for example an emulator, is running"
    return DeviceNotFound(f"{where}: cannot be opened ({cause}); check the url and {remedy}")


def _owner_group(path: str) -> str:
    """The group that may use the port; dialout if that is unknown, or if it is root, which no user joins."""
    try:
        group = grp.getgrgid(os.stat(path).st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
    return "dialout" if group == "root" else group


def _describe_ports(devices: Path) -> str:
    """A sentence with the serial ports of this machine: by names that do not depend on the order in which
    adapters were plugged in, if there are such names."""
    stable_paths = sorted(str(path) for path in devices.glob("serial/by-id/*"))
    ports = stable_paths or sorted(
        str(path) for pattern in ("ttyUSB*", "ttyACM*") for path in devices.glob(pattern)
    )
    return f"here are: {', '.join(ports)}" if ports else "no USB serial port is here"
