"""Kobuki's serial protocol: commands to bytes, bytes to feedback.

Source: kobuki_core (src/driver/kobuki.cpp, diff_drive.cpp; its protocol page has errors). A frame is AA 55,
length, sub-payloads, and the xor of length and payload; little-endian. A sub-payload is id, length, data.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import xor
from types import MappingProxyType

from config.chassis import KOBUKI_WHEEL_BASE_M

WHEEL_BASE_M = KOBUKI_WHEEL_BASE_M
WHEEL_RADIUS_M = 0.035
TICK_M = 0.002436916871363930187454 * WHEEL_RADIUS_M
ENCODER_BITS = 16
CLOCK_BITS = 16

_HEADER = b"\xaa\x55"
_BASE_CONTROL = 1
_CORE, _INERTIA, _CURRENTS = 1, 4, 6

# Length of each known sub-payload. Another length means that this is not a valid frame.
_LENGTHS: Mapping[int, int] = MappingProxyType({_CORE: 15, 3: 3, _INERTIA: 7, 5: 6, _CURRENTS: 2, 16: 16})

_STRAIGHT_RADPS = 1e-4
# With a radius up to this the base turns on the spot.
_MAX_SPIN_RADIUS_M = 1e-3
_INT16 = 32_767

# Values of Core.charger: while the charging cable is plugged in, and without it (in the dock or off it).
CHARGER_ON_CABLE = (18, 22)
CHARGER_OFF_CABLE = (0, 2, 6)


def base_control(v_mps: float, w_radps: float) -> bytes:
    """The frame for this twist, as the speed of the outer wheel (mm/s) and the radius of the centre (mm).

    Rounded to the nearest integer, a half towards zero, and clamped to int16. A bend with a larger radius
    than int16 can hold is sent as straight.
    """
    speed, radius = _speed_and_radius(v_mps, w_radps)
    return frame(bytes((_BASE_CONTROL, 4)) + struct.pack("<hh", speed, radius))


def frame(payload: bytes) -> bytes:
    """Header, length and checksum around 1..255 bytes of payload."""
    body = bytes((len(payload),)) + payload
    return _HEADER + body + bytes((reduce(xor, body),))


def _speed_and_radius(v_mps: float, w_radps: float) -> tuple[int, int]:
    if abs(w_radps) < _STRAIGHT_RADPS or abs(v_mps) > 1e-3 * _INT16 * abs(w_radps):
        return _int16(1000.0 * v_mps), 0
    half_mm = 1000.0 * WHEEL_BASE_M / 2.0
    if abs(v_mps) <= _MAX_SPIN_RADIUS_M * abs(w_radps) or abs(v_mps) < 1e-4:
        return _int16(half_mm * w_radps), 1
    radius_mm = 1000.0 * v_mps / w_radps
    outer_mm = radius_mm + math.copysign(half_mm, radius_mm)
    return _int16(outer_mm * w_radps), _int16(radius_mm)


def _int16(value: float) -> int:
    """value, rounded (a half towards zero) and clamped to int16."""
    clamped = min(max(value, -_INT16), _INT16)
    return int(math.copysign(math.ceil(abs(clamped) - 0.5), clamped))


@dataclass(frozen=True, slots=True)
class Core:
    """The basic sensors. Clock (ms) and ticks wrap at 16 bits."""

    clock_ms: int
    bumper: int
    wheel_drop: int
    cliff: int
    left_ticks: int
    right_ticks: int
    charger: int
    battery_v: float
    over_current: int


@dataclass(frozen=True, slots=True)
class Inertia:
    """The gyro: angle since power-up, in (-pi, pi], and yaw rate."""

    angle_rad: float
    rate_radps: float


@dataclass(frozen=True, slots=True)
class Feedback:
    """The contents of one frame; None for what it did not hold."""

    core: Core | None = None
    inertia: Inertia | None = None
    currents_a: tuple[float, float] | None = None


def parse(payload: bytes) -> Feedback | None:
    """The feedback in a payload whose checksum is right; None if its sub-payloads are not valid."""
    parts: dict[int, bytes] = {}
    position = 0
    while position + 2 <= len(payload):
        kind, length = payload[position], payload[position + 1]
        data = payload[position + 2 : position + 2 + length]
        if len(data) != length or _LENGTHS.get(kind, length) != length:
            return None
        parts[kind] = data
        position += 2 + length
    if position != len(payload):
        return None
    return Feedback(
        core=_core(parts[_CORE]) if _CORE in parts else None,
        inertia=_inertia(parts[_INERTIA]) if _INERTIA in parts else None,
        currents_a=(parts[_CURRENTS][0] / 100.0, parts[_CURRENTS][1] / 100.0) if _CURRENTS in parts else None,
    )


def _core(data: bytes) -> Core:
    clock, bumper, drop, cliff, left, right, _, _, _, charger, battery, over = struct.unpack(
        "<HBBBHHbbBBBB", data
    )
    return Core(
        clock_ms=clock,
        bumper=bumper,
        wheel_drop=drop,
        cliff=cliff,
        left_ticks=left,
        right_ticks=right,
        charger=charger,
        battery_v=battery / 10.0,
        over_current=over,
    )


def _inertia(data: bytes) -> Inertia:
    angle, rate = struct.unpack_from("<hh", data)
    return Inertia(math.radians(angle / 100.0), math.radians(rate / 100.0))


class FrameReader:
    """Finds frames in a stream of bytes. rejected: number of headers that no frame followed."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.rejected = 0

    def feed(self, data: bytes) -> list[bytes]:
        """The payloads that these bytes complete, each with a right checksum."""
        buffer = self._buffer
        buffer += data
        payloads: list[bytes] = []
        while (start := buffer.find(_HEADER)) >= 0:
            del buffer[:start]
            if len(buffer) < 3 or len(buffer) < buffer[2] + 4:
                return payloads
            end = buffer[2] + 3
            if buffer[2] > 0 and reduce(xor, buffer[2 : end + 1]) == 0:
                payloads.append(bytes(buffer[3:end]))
                del buffer[: end + 1]
            else:
                # This was not the header of a frame; the next byte may be.
                self.rejected += 1
                del buffer[:1]
        # Keep a last byte that may be the first half of a header.
        del buffer[: len(buffer) - (buffer[-1:] == _HEADER[:1])]
        return payloads
