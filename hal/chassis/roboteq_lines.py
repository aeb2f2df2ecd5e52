"""Roboteq's ASCII protocol: commands to bytes, bytes to lines, lines to values.

Source: Roboteq user manual V2.0 p. 172 (grammar), V1.8 pp. 253, 254, 286 (fault flags, motor flags, RWD).
Every line ends with a carriage return. "+" accepts a command, "-" refuses one, and a query is answered by
NAME=value:value. There is no checksum. A line counts only if all of it fits the grammar, so noise can still
change a digit; the driver therefore drops an encoder step that no track can make, and takes it for a restart
if the next one goes on from there.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

FULL_SCALE = 1000

ENCODERS = "C"
HALL_COUNTERS = "CB"
FAULT_FLAGS = "FF"
MOTOR_FLAGS = "FM"
VOLTAGES = "V"
CURRENTS = "A"
WATCHDOG = "RWD"

STOP = b"!M 0 0\r"
EMERGENCY_STOP = b"!EX\r"
RELEASE = b"!MG\r"
ECHO_OFF = b"^ECHOF 1\r"

# The longest answer in use has about 30 characters. A longer line is not of this protocol.
_MAX_LINE = 80

_VALUE_LINE = re.compile(rb"([A-Z]{1,6})=(-?[0-9]{1,10}(?::-?[0-9]{1,10}){0,7})")
_ECHO_MARKS = b"!?^~%#"
_INT32 = range(-(1 << 31), 1 << 31)


def motors(left: float, right: float) -> bytes:
    """The command for both channels, in thousandths of full speed; rounded and clamped to +-1000."""
    return f"!M {_thousandths(left)} {_thousandths(right)}\r".encode("ascii")


def set_watchdog(timeout_ms: int) -> bytes:
    """The setting after which time without a command the controller stops the motors (^RWD); never 0, which
    means off."""
    return f"^RWD {min(max(timeout_ms, 1), 65_000)}\r".encode("ascii")


@dataclass(frozen=True, slots=True)
class Query:
    """A query, and how many values its answer may have."""

    name: str
    values: range
    mark: str = "?"

    @property
    def line(self) -> bytes:
        """The bytes to write."""
        return f"{self.mark}{self.name}\r".encode("ascii")


QUERIES: Mapping[str, Query] = MappingProxyType(
    {
        query.name: query
        for query in (
            Query(ENCODERS, range(2, 3)),
            Query(HALL_COUNTERS, range(2, 3)),
            Query(FAULT_FLAGS, range(1, 2)),
            Query(MOTOR_FLAGS, range(2, 3)),
            Query(VOLTAGES, range(3, 4)),
            Query(CURRENTS, range(2, 3)),
            Query(WATCHDOG, range(1, 2), mark="~"),
        )
    }
)


class Reply(Enum):
    """Lines that carry no value."""

    ACCEPTED = "+"
    REFUSED = "-"
    ECHO = "echo of what was written"


@dataclass(frozen=True, slots=True)
class Value:
    """The answer to a query, every value an int32."""

    name: str
    values: tuple[int, ...]


Line = Reply | Value


def parse(line: bytes) -> Line | None:
    """Parse one line without its carriage return; None if it is not of this protocol."""
    if line == b"+":
        return Reply.ACCEPTED
    if line == b"-":
        return Reply.REFUSED
    if line[:1] and line[0] in _ECHO_MARKS:
        return Reply.ECHO
    match = _VALUE_LINE.fullmatch(line)
    if match is None:
        return None
    name = match[1].decode("ascii")
    values = tuple(int(value) for value in match[2].split(b":"))
    query = QUERIES.get(name)
    if query is None or len(values) not in query.values or not all(value in _INT32 for value in values):
        return None
    return Value(name, values)


class LineReader:
    """Assembles lines from bytes that arrive in pieces. foreign_lines: number of lines of another
    protocol."""

    def __init__(self) -> None:
        self._partial = bytearray()
        self._too_long = False
        self.foreign_lines = 0

    def feed(self, data: bytes) -> list[Line]:
        """The lines that these bytes complete."""
        lines: list[Line] = []
        *ends, rest = data.split(b"\r")
        for end in ends:
            self._append(end)
            whole, too_long = bytes(self._partial), self._too_long
            self.forget()
            line = None if too_long else parse(whole)
            if line is not None:
                lines.append(line)
            elif whole:
                self.foreign_lines += 1
        self._append(rest)
        return lines

    def forget(self) -> None:
        """Drop a line that has begun."""
        self._partial.clear()
        self._too_long = False

    def _append(self, data: bytes) -> None:
        room = _MAX_LINE - len(self._partial)
        self._too_long = self._too_long or len(data) > room
        self._partial += data[:room]


_FAULTS = (
    "controller too hot",
    "voltage high",
    "voltage low",
    "short circuit",
    "emergency stop",
    "sensor or setup fault",
    "power stage (MOSFET) failure",
    "running on its default configuration",
)
ESTOP_FLAG = 1 << _FAULTS.index("emergency stop")

_MOTOR_WARNINGS: Mapping[int, str] = MappingProxyType({0: "at its current limit"})
_MOTOR_FAULTS: Mapping[int, str] = MappingProxyType(
    {
        1: "stalled",
        2: "off its speed (loop error)",
        3: "stopped for safety",
        4: "at its forward limit",
        5: "at its reverse limit",
        6: "stopped by its current trigger",
    }
)


def describe_faults(flags: int) -> tuple[str, ...]:
    """The faults of ?FF, without the emergency stop. Each stops the motors, or may; unknown bits are
    faults."""
    bits = [bit for bit in range(32) if flags >> bit & 1 and 1 << bit != ESTOP_FLAG]
    return tuple(
        f"error: {_FAULTS[bit] if bit < len(_FAULTS) else f'unknown fault bit {bit}'}" for bit in bits
    )


@dataclass(frozen=True, slots=True)
class MotorFlags:
    """The contents of ?FM. faults stop a motor, warnings do not."""

    faults: tuple[str, ...]
    warnings: tuple[str, ...]


def describe_motors(flags: tuple[int, ...]) -> MotorFlags:
    """The flags of all channels; unknown bits are faults."""
    faults, warnings = [], []
    for channel, value in enumerate(flags, start=1):
        for bit in (bit for bit in range(32) if value >> bit & 1):
            if bit in _MOTOR_WARNINGS:
                warnings.append(f"warning: motor {channel} {_MOTOR_WARNINGS[bit]}")
            else:
                description = _MOTOR_FAULTS.get(bit, f"has unknown flag bit {bit}")
                faults.append(f"error: motor {channel} {description}")
    return MotorFlags(tuple(faults), tuple(warnings))


def _thousandths(value: float) -> int:
    return round(min(max(value, -FULL_SCALE), FULL_SCALE))
