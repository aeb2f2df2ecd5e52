"""RoboClaw packet serial: requests to bytes, bytes to replies. Pure.

Source: RoboClaw user manual pp. 59-73. Big-endian. A write is address, command, data, CRC and is answered
by 0xFF; a read is address and command alone and is answered by data and a CRC over address, command
and data.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

SET_TIMEOUT, GET_TIMEOUT = 14, 15
MAIN_BATTERY = 24
SPEEDS = 37
RAMPED_SPEEDS = 40
CURRENTS = 49
ENCODERS = 78
STATUS = 90

_ACK = b"\xff"
_INT32_MIN, _INT32_MAX = -(1 << 31), (1 << 31) - 1
_UINT32_MAX = (1 << 32) - 1


def crc16(data: bytes) -> int:
    """CRC-16/XMODEM: polynomial 0x1021, start 0, not reflected; "123456789" gives 0x31C3."""
    return binascii.crc_hqx(data, 0)


@dataclass(frozen=True, slots=True)
class Request:
    """One packet to the controller. reply_lengths: data bytes of its answer without the CRC, longest
    first; empty means that 0xFF acknowledges it."""

    command: int
    payload: bytes = b""
    reply_lengths: tuple[int, ...] = ()

    def packet(self, address: int) -> bytes:
        """The bytes to write. Only writes carry a CRC."""
        packet = bytes((address, self.command)) + self.payload
        return packet if self.reply_lengths else packet + crc16(packet).to_bytes(2, "big")

    @property
    def longest_reply(self) -> int:
        """Bytes of the longest answer, CRC included."""
        return self.reply_lengths[0] + 2 if self.reply_lengths else 1

    def accept(self, address: int, received: bytes) -> bytes | None:
        """The data in exactly these received bytes, b"" for an acknowledgement; None: not an answer."""
        if not self.reply_lengths:
            return b"" if received == _ACK else None
        data, crc = received[:-2], received[-2:]
        if len(data) not in self.reply_lengths:
            return None
        expected = crc16(bytes((address, self.command)) + data)
        return data if int.from_bytes(crc, "big") == expected else None


def set_timeout(timeout_ms: int) -> Request:
    """The request that the controller stops the motors after this time without a packet; rounded to 100 ms,
    100..25500."""
    return Request(SET_TIMEOUT, bytes((min(max(round(timeout_ms / 100), 1), 255),)))


def speeds(left_qpps: float, right_qpps: float) -> Request:
    """Both motors to these speeds at once, without a ramp. Rounded and clamped to int32."""
    return Request(SPEEDS, struct.pack(">ii", _int32(left_qpps), _int32(right_qpps)))


def ramped_speeds(accel_qpps2: float, left_qpps: float, right_qpps: float) -> Request:
    """Both motors to these speeds along one ramp."""
    accel = round(min(max(accel_qpps2, 0), _UINT32_MAX))
    return Request(RAMPED_SPEEDS, struct.pack(">Iii", accel, _int32(left_qpps), _int32(right_qpps)))


GET_TIMEOUT_REQUEST = Request(GET_TIMEOUT, reply_lengths=(1,))
MAIN_BATTERY_REQUEST = Request(MAIN_BATTERY, reply_lengths=(2,))
CURRENTS_REQUEST = Request(CURRENTS, reply_lengths=(4,))
ENCODERS_REQUEST = Request(ENCODERS, reply_lengths=(8,))
# 4 bytes from firmware 4.1.29 or so on, 2 before, with other bits.
STATUS_REQUEST = Request(STATUS, reply_lengths=(4, 2))


def timeout_ms(data: bytes) -> int:
    """The time-out in a reply to command 15."""
    return data[0] * 100


def main_battery_v(data: bytes) -> float:
    """The voltage of the main battery in a reply to command 24."""
    return int.from_bytes(data, "big") / 10.0


def currents_a(data: bytes) -> tuple[float, float]:
    """The motor currents (left, right) in a reply to command 49."""
    left, right = struct.unpack(">hh", data)
    return left / 100.0, right / 100.0


def encoders(data: bytes) -> tuple[int, int]:
    """The encoder counts (left, right) in a reply to command 78; they wrap around at 32 bits."""
    left, right = struct.unpack(">II", data)
    return left, right


@dataclass(frozen=True, slots=True)
class Status:
    """The status in a reply to command 90. errors stop the motors, or will; warnings do not."""

    estop: bool
    errors: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _StatusLayout:
    estop: int
    errors: Mapping[int, str]
    warnings: Mapping[int, str]


_STATUS_LAYOUTS: Mapping[int, _StatusLayout] = MappingProxyType(
    {
        4: _StatusLayout(
            estop=0x1,
            errors={
                0x2: "board too hot",
                0x4: "second board sensor too hot",
                0x8: "main voltage high",
                0x10: "logic voltage high",
                0x20: "logic voltage low",
                0x40: "motor 1 driver fault",
                0x80: "motor 2 driver fault",
                0x100: "motor 1 speed error",
                0x200: "motor 2 speed error",
                0x400: "motor 1 position error",
                0x800: "motor 2 position error",
                0x1000: "motor 1 current error",
                0x2000: "motor 2 current error",
                0x4000: "main voltage low: motors roll free",
                0x8000: "main voltage high: motors brake",
            },
            warnings={
                0x10000: "motor 1 over-current",
                0x20000: "motor 2 over-current",
                0x40000: "main voltage high",
                0x80000: "main voltage low",
                0x100000: "board warm",
                0x200000: "second board sensor warm",
                0x400000: "signal S4 triggered",
                0x800000: "signal S5 triggered",
                0x1000000: "speed error limit",
                0x2000000: "position error limit",
            },
        ),
        2: _StatusLayout(
            estop=0x4,
            errors={
                0x8: "board too hot",
                0x10: "second board sensor too hot",
                0x20: "main voltage high",
                0x40: "logic voltage high",
                0x80: "logic voltage low",
                0x100: "motor 1 driver fault",
                0x200: "motor 2 driver fault",
            },
            warnings={
                0x1: "motor 1 over-current",
                0x2: "motor 2 over-current",
                0x400: "main voltage high",
                0x800: "main voltage low",
                0x1000: "board warm",
                0x2000: "second board sensor warm",
                0x4000: "motor 1 at home switch",
                0x8000: "motor 2 at home switch",
            },
        ),
    }
)


def status(data: bytes) -> Status:
    """Decode a reply to command 90; its length selects one of the two layouts. A bit without an entry counts
    as an error: its meaning in a newer firmware is unknown, and it may stop the motors."""
    layout = _STATUS_LAYOUTS[len(data)]
    bits = int.from_bytes(data, "big")
    errors, warnings = [], []
    for position in range(8 * len(data)):
        bit = 1 << position
        if not bits & bit or bit == layout.estop:
            continue
        if bit in layout.warnings:
            warnings.append(f"warning: {layout.warnings[bit]}")
        else:
            errors.append(f"error: {layout.errors.get(bit, f'unknown bit 0x{bit:X}')}")
    return Status(bool(bits & layout.estop), tuple(errors), tuple(warnings))


def _int32(value: float) -> int:
    return round(min(max(value, _INT32_MIN), _INT32_MAX))
