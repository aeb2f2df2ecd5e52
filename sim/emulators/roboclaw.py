"""An emulated RoboClaw with two tracks, on a serial line.

It knows the packets that the manual documents for speed control. Like the device, it answers errors on the
line with silence: it does not acknowledge a packet with a bad CRC, and drops a packet with a gap of 10 ms.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable, Mapping
from types import MappingProxyType

from hal.api import SerialLink
from hal.clocks import NS_PER_MS
from sim.emulators.base import MotorController
from sim.plant import TrackedPlant

_GAP_NS = 10 * NS_PER_MS  # after so much silence inside a packet, the controller drops it
_ACK = b"\xff"

# Bytes of data in each write. All other known commands are reads, which carry none.
_WRITES: Mapping[int, int] = MappingProxyType(
    {14: 1, 32: 2, 33: 2, 34: 4, 35: 4, 36: 4, 37: 8, 38: 8, 39: 8, 40: 12}
)
_READS = frozenset({15, 16, 17, 18, 19, 24, 25, 30, 31, 49, 78, 79, 82, 83, 90, 108})

_ESTOP_BIT = {2: 0x4, 4: 0x1}  # by the bytes of the status: old and new firmware


class RoboclawEmulator(MotorController):
    """Motor 1 drives the left track, motor 2 the right one. The serial time-out is off after power-up, which
    a host must expect.

    status_bytes: 4 as of firmware 4.1.29, 2 before.
    """

    def __init__(
        self,
        link: SerialLink,
        plant: TrackedPlant,
        *,
        counts_per_m: float = 20_000.0,
        address: int = 0x80,
        signs: tuple[int, int] = (1, 1),
        status_bytes: int = 4,
        boot_ms: int = 500,
    ) -> None:
        super().__init__(link, plant, boot_ms, signs)
        self._counts_per_m = counts_per_m
        self._address = address
        self._status_bytes = status_bytes
        self._buffer = bytearray()
        self._received_ns = self._now_ns
        self._valid_ns = self._now_ns
        self._ramp_mps2 = [float("inf"), float("inf")]
        self._estop = False
        self.status_bits = 0
        self.timeout_ms = 0
        self.settable_timeout = True
        self.battery_v = 25.2
        self.rejected = 0

    # Faults, for tests and scenarios.

    def press_estop(self) -> None:
        """Open the emergency stop input: motors off; commands are acknowledged but not followed."""
        self._estop = True
        self._stop_motors()

    def release_estop(self) -> None:
        """Close the input (automatic reset): the next command is followed."""
        self._estop = False

    # The controller's own work.

    def _power_up(self) -> None:
        self._buffer.clear()
        self.timeout_ms = 0
        self._stop_motors()

    def _handle_received(self) -> None:
        arrived = self._receive()
        if self._silent:
            return
        if self._now_ns - self._received_ns > _GAP_NS:
            self._buffer.clear()
        if arrived:
            self._received_ns = self._now_ns
            self._buffer += arrived
        while self._take_packet():
            pass

    def _take_packet(self) -> bool:
        """Handle the packet at the start of the buffer; False if there is no complete one."""
        buffer = self._buffer
        while buffer and buffer[0] != self._address:
            del buffer[0]
        if len(buffer) < 2:
            return False
        command = buffer[1]
        if command in _READS:
            del buffer[:2]
            self._valid_ns = self._now_ns
            data = self._read(command)
            self._transmit(data + self._crc(bytes((self._address, command)) + data))
            return True
        if command not in _WRITES:
            buffer.clear()
            self.rejected += 1
            return False
        length = 2 + _WRITES[command] + 2
        if len(buffer) < length:
            return False
        packet = bytes(buffer[:length])
        del buffer[:length]
        if self._crc(packet[:-2]) != packet[-2:]:
            # No acknowledgement, and the rest of the buffer is not trusted either.
            buffer.clear()
            self.rejected += 1
            return False
        self._valid_ns = self._now_ns
        self._write(command, packet[2:-2])
        self._transmit(_ACK)
        return True

    @staticmethod
    def _crc(data: bytes) -> bytes:
        return crc_hqx(data, 0).to_bytes(2, "big")

    def _read(self, command: int) -> bytes:
        left, right = self._counts()
        left_qpps, right_qpps = (round(speed * self._counts_per_m) for speed in self._motor_speeds_mps)
        replies: dict[int, Callable[[], bytes]] = {
            15: lambda: bytes((self.timeout_ms // 100,)),
            16: lambda: struct.pack(">IB", left, left_qpps < 0),
            17: lambda: struct.pack(">IB", right, right_qpps < 0),
            18: lambda: struct.pack(">iB", left_qpps, left_qpps < 0),
            19: lambda: struct.pack(">iB", right_qpps, right_qpps < 0),
            24: lambda: struct.pack(">H", round(self.battery_v * 10)),
            25: lambda: struct.pack(">H", 50),
            30: lambda: struct.pack(">iB", left_qpps, left_qpps < 0),
            31: lambda: struct.pack(">iB", right_qpps, right_qpps < 0),
            49: lambda: struct.pack(">hh", *(round(50 + 300 * abs(v)) for v in self._target_mps)),
            78: lambda: struct.pack(">II", left, right),
            79: lambda: struct.pack(">ii", left_qpps, right_qpps),
            82: lambda: struct.pack(">H", 315),
            83: lambda: struct.pack(">H", 320),
            90: self._status,
            108: lambda: struct.pack(">ii", left_qpps, right_qpps),
        }
        return replies[command]()

    def _status(self) -> bytes:
        bits = self.status_bits | (_ESTOP_BIT[self._status_bytes] if self._estop else 0)
        return bits.to_bytes(self._status_bytes, "big")

    def _counts(self) -> tuple[int, int]:
        left_m, right_m = self._motor_travel_m
        return round(left_m * self._counts_per_m) % (1 << 32), round(right_m * self._counts_per_m) % (1 << 32)

    def _write(self, command: int, data: bytes) -> None:
        if command == 14:
            if self.settable_timeout:
                self.timeout_ms = data[0] * 100
            return
        self.commands_obeyed += not self._estop
        if command in (32, 33, 34):
            # Duty cycle, emulated as a share of a track speed of 1.5 m/s.
            speeds = [duty / 32767 * 1.5 for duty in struct.unpack(f">{len(data) // 2}h", data)]
            ramp_mps2 = float("inf")
        elif command in (35, 36, 37):
            speeds = [qpps / self._counts_per_m for qpps in struct.unpack(f">{len(data) // 4}i", data)]
            ramp_mps2 = float("inf")
        else:
            accel, *qpps_all = struct.unpack(f">I{len(data) // 4 - 1}i", data)
            speeds = [qpps / self._counts_per_m for qpps in qpps_all]
            ramp_mps2 = accel / self._counts_per_m
        if self._estop:
            return
        first = 1 if command in (33, 36, 39) else 0
        for track, speed_mps in enumerate(speeds, start=first):
            self._goal_mps[track] = speed_mps
            self._ramp_mps2[track] = ramp_mps2

    def _ramp(self, step_s: float) -> None:
        """Move the targets along their ramps; stop the motors when the serial time-out has passed."""
        if self.timeout_ms and self._now_ns - self._valid_ns >= self.timeout_ms * NS_PER_MS:
            self._stop_motors()
        for track in (0, 1):
            self._ramp_towards(track, self._goal_mps[track], self._ramp_mps2[track], step_s)
