"""An emulated Kobuki on a serial line: it streams its sensors, follows commands, and stops without them.

As on the real base, the bumper, cliff and wheel-drop switches only report; the host has to stop.
"""

from __future__ import annotations

import math
import struct
from functools import reduce
from operator import xor

from hal.api import SerialLink
from hal.clocks import NS_PER_MS
from sim.emulators.base import SerialEmulator
from sim.plant import TrackedPlant

# Written here once more: taken from hal/chassis/kobuki_packets.py they would agree with any mistake there.
_STREAM_NS = 20 * NS_PER_MS
_HEADER = b"\xaa\x55"
_HALF_BASE_MM = 115.0
_TICKS_PER_M = 1.0 / (0.002436916871363930187454 * 0.035)  # radians per tick, radius of a wheel in m
_CENTRE = 0x2  # bit of the bumper's middle


class KobukiEmulator(SerialEmulator):
    """The Kobuki for the driver hal.chassis.kobuki.

    command_timeout_ms: the wheels stop after this time without a base control command. The time of the real
    firmware is not documented; the vendor's own node waits for 0.6 s.
    """

    def __init__(
        self,
        link: SerialLink,
        plant: TrackedPlant,
        *,
        command_timeout_ms: int = 600,
        boot_ms: int = 1000,
    ) -> None:
        super().__init__(link, plant, boot_ms)
        self._command_timeout_ns = command_timeout_ms * NS_PER_MS
        self._stream_ns = plant.now_ns
        self._received = bytearray()
        self._extra = b""
        self._command_ns: int | None = None
        self._start_ns = plant.now_ns
        self._heading_zero_rad = plant.pose.heading_rad
        self.bumper = 0
        self.wheel_drop = 0
        self.cliff = 0
        self.charger = 0
        self.over_current = 0
        self.battery_v = 16.2
        self.gyro = True
        self.gyro_gain = 1.0  # 0: stuck
        self.rejected = 0

    def advance_to(self, now_ns: int) -> None:
        """Follow what has arrived, move, and stream what is due up to and including now_ns."""
        self._handle_received()
        while (event_ns := self._next_event_ns()) <= now_ns:
            self._move_to(event_ns)
            if self._stream_ns <= event_ns:
                self._stream_ns += _STREAM_NS
                self._stream()
        self._move_to(now_ns)

    # Faults, for tests and scenarios.

    def press_estop(self) -> None:
        """Press the middle of its bumper, because a Kobuki has no emergency stop button."""
        self.bumper = _CENTRE

    def release_estop(self) -> None:
        """Release the bumper."""
        self.bumper = 0

    # The base's own work.

    def _power_up(self) -> None:
        """Set clock, ticks and gyro to zero."""
        self._received.clear()
        self._command_ns = None
        self._start_ns = self._now_ns
        self._heading_zero_rad = self._plant.pose.heading_rad
        self._plant.command_tracks(0.0, 0.0)

    def _handle_received(self) -> None:
        self._received += self._receive()
        while self._take_frame():
            pass

    def _take_frame(self) -> bool:
        """Handle the frame at the start of what was received; False if there is no complete one."""
        received = self._received
        start = received.find(_HEADER)
        if start < 0:
            del received[: max(len(received) - 1, 0)]
            return False
        del received[:start]
        if len(received) < 3 or len(received) < received[2] + 4:
            return False
        end = received[2] + 3
        body, checksum = bytes(received[2:end]), received[end]
        if reduce(xor, body) != checksum:
            self.rejected += 1
            del received[:2]
            return True
        del received[: end + 1]
        self._obey(body[1:])
        return True

    def _obey(self, payload: bytes) -> None:
        while len(payload) >= 2 and len(payload) >= 2 + payload[1]:
            kind, data, payload = payload[0], payload[2 : 2 + payload[1]], payload[2 + payload[1] :]
            if kind == 1 and len(data) == 4:
                self._drive(*struct.unpack("<hh", data))
            elif kind == 9 and len(data) == 2:
                self._extra += self._version_payload(int.from_bytes(data, "little"))

    def _drive(self, speed: int, radius: int) -> None:
        """Drive with this speed of the outer wheel (mm/s) and radius (mm; 0: straight on, 1: turn on the
        spot)."""
        self._command_ns = self._now_ns
        self.commands_obeyed += 1
        if radius == 0:
            left = right = float(speed)
        elif radius == 1:
            left, right = -float(speed), float(speed)
        elif radius > 0:
            w = speed / (radius + _HALF_BASE_MM)
            left, right = w * (radius - _HALF_BASE_MM), float(speed)
        else:
            w = speed / (radius - _HALF_BASE_MM)
            left, right = float(speed), w * (radius + _HALF_BASE_MM)
        self._plant.command_tracks(left / 1000.0, right / 1000.0)

    def _version_payload(self, flags: int) -> bytes:
        """Sub-payloads with hardware version, firmware version and unique id, as far as flags ask for
        them."""
        hardware = bytes((10, 4, 4, 0, 1, 0)) if flags & 1 else b""
        firmware = bytes((11, 4, 0, 2, 1, 0)) if flags & 2 else b""
        unique = bytes((19, 12)) + bytes(range(12)) if flags & 8 else b""
        return hardware + firmware + unique

    def _next_event_ns(self) -> int:
        if self._command_ns is None:
            return self._stream_ns
        return min(self._stream_ns, self._command_ns + self._command_timeout_ns)

    def _move_to(self, now_ns: int) -> None:
        self._plant.advance_to(now_ns)
        self._now_ns = max(self._now_ns, now_ns)
        if self._command_ns is not None and self._now_ns - self._command_ns >= self._command_timeout_ns:
            self._command_ns = None
            self._plant.command_tracks(0.0, 0.0)

    def _stream(self) -> None:
        if self._silent:
            return
        payload = self._core() + (self._inertia() if self.gyro else b"") + bytes((6, 2, 8, 8)) + self._extra
        self._extra = b""
        body = bytes((len(payload),)) + payload
        self._transmit(_HEADER + body + bytes((reduce(xor, body),)))

    def _core(self) -> bytes:
        left, right = (round(travel_m * _TICKS_PER_M) % (1 << 16) for travel_m in self._travel_m)
        clock_ms = (self._now_ns - self._start_ns) // NS_PER_MS % (1 << 16)
        return bytes((1, 15)) + struct.pack(
            "<HBBBHHbbBBBB",
            clock_ms, self.bumper, self.wheel_drop, self.cliff, left, right, 0, 0, 0,
            self.charger, round(self.battery_v * 10), self.over_current,
        )  # fmt: skip

    def _inertia(self) -> bytes:
        turned_rad = self._plant.pose.heading_rad - self._heading_zero_rad
        angle_rad = self.gyro_gain * math.remainder(turned_rad, math.tau)
        rate = round(100.0 * self.gyro_gain * math.degrees(self._plant.twist[1]))
        return bytes((4, 7)) + struct.pack(
            "<hh3x", round(100.0 * math.degrees(angle_rad)), min(max(rate, -32_768), 32_767)
        )
