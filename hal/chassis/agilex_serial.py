"""AgileX protocol V2 over RS-232: the contents of the CAN frames in an envelope with a checksum.

Source: SCOUT user manual v1.3.0 3.4.2 (firmware 1.5.0 or newer); 115200 baud 8N1. A frame is 5A A5, length,
type, id, data, count, sum. The length counts all bytes except the two start bytes and the sum. The sum is
that of all bytes before it, modulo 256. The data are those of the CAN frame, without the last two bytes of
0x111.

TRACER (manual v1.2) uses the same envelope around other data (percentages), so it cannot be driven this way.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hal.api import SerialLink
from hal.chassis.reading import read_all
from hal.device_wrapper import DeviceWrapper
from hal.types import CanFrame

_START = b"\x5a\xa5"
_COMMAND, _FEEDBACK = 0x55, 0xAA

# Bytes that the length counts besides the data: the length itself, type, id and count. The data have at most
# the 8 bytes of a CAN frame.
_OVERHEAD_BYTES = 4
_LENGTHS = range(_OVERHEAD_BYTES, _OVERHEAD_BYTES + 9)


@dataclass(frozen=True, slots=True)
class _Kind:
    """Type and id of one CAN identifier on the serial line, and how many of its bytes are sent there."""

    arbitration_id: int
    frame_type: int
    frame_id: int
    data_bytes: int


_KINDS = (
    _Kind(0x111, _COMMAND, 0x01, 6),
    _Kind(0x421, _COMMAND, 0x02, 1),
    _Kind(0x441, _COMMAND, 0x03, 1),
    _Kind(0x211, _FEEDBACK, 0x01, 8),
    _Kind(0x221, _FEEDBACK, 0x02, 8),
    *(_Kind(0x251 + index, _FEEDBACK, 0x03 + index, 8) for index in range(4)),
    *(_Kind(0x261 + index, _FEEDBACK, 0x07 + index, 8) for index in range(4)),
    _Kind(0x311, _FEEDBACK, 0xA2, 8),
)
_BY_CAN: Mapping[int, _Kind] = MappingProxyType({kind.arbitration_id: kind for kind in _KINDS})
_BY_SERIAL: Mapping[tuple[int, int], _Kind] = MappingProxyType(
    {(kind.frame_type, kind.frame_id): kind for kind in _KINDS}
)


def wrap(frame: CanFrame, count: int) -> bytes | None:
    """The serial frame for a CAN frame; None if the serial line has no equivalent."""
    kind = _BY_CAN.get(frame.arbitration_id)
    if kind is None:
        return None
    data = frame.data[: kind.data_bytes].ljust(kind.data_bytes, b"\0")
    body = bytes((len(data) + _OVERHEAD_BYTES, kind.frame_type, kind.frame_id)) + data + bytes((count % 256,))
    frame_bytes = _START + body
    return frame_bytes + bytes((sum(frame_bytes) % 256,))


class FrameReader:
    """Finds frames in a stream of bytes.

    rejected: number of start bytes that no frame followed.
    foreign_frames: number of frames with a right checksum, but with a type, id and length of another
    protocol.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.rejected = 0
        self.foreign_frames = 0

    def feed(self, data: bytes) -> list[CanFrame]:
        """The CAN frames that these bytes complete."""
        buffer = self._buffer
        buffer += data
        frames: list[CanFrame] = []
        while (start := buffer.find(_START)) >= 0:
            del buffer[:start]
            if len(buffer) < 3:
                return frames
            end = buffer[2] + 2
            if buffer[2] in _LENGTHS:
                if len(buffer) <= end:
                    return frames
                if sum(buffer[:end]) % 256 == buffer[end]:
                    self._take(bytes(buffer[3 : end - 1]), frames)
                    del buffer[: end + 1]
                    continue
            # This was not the start of a frame; the next byte may be.
            self.rejected += 1
            del buffer[:1]
        # Keep a last byte that may be the first byte of a start.
        del buffer[: len(buffer) - (buffer[-1:] == _START[:1])]
        return frames

    def _take(self, body: bytes, frames: list[CanFrame]) -> None:
        """Type, id and data of a frame whose checksum is right."""
        kind = _BY_SERIAL.get((body[0], body[1])) if len(body) >= 2 else None
        data = body[2:]
        if kind is None or len(data) != kind.data_bytes:
            self.foreign_frames += 1
            return
        frames.append(CanFrame(kind.arbitration_id, data.ljust(8, b"\0") if len(data) > 1 else data))


class AgilexSerialBus(DeviceWrapper):
    """hal.api.CanLink over a serial line, for either end of the line."""

    def __init__(self, link: SerialLink) -> None:
        super().__init__(link)
        self._link = link
        self._reader = FrameReader()
        self._arrived: deque[CanFrame] = deque()
        self._count = 0
        self._bytes_received = 0

    def send(self, frame: CanFrame) -> None:
        """See hal.api.CanLink. A frame without a serial equivalent is not sent; the base does the same."""
        data = wrap(frame, self._count)
        if data is not None:
            self._count += 1
            self._link.write(data)

    def receive(self) -> CanFrame | None:
        """See hal.api.CanLink."""
        if not self._arrived:
            data = read_all(self._link)
            self._bytes_received += len(data)
            self._arrived.extend(self._reader.feed(data))
        return self._arrived.popleft() if self._arrived else None

    def silence_hint(self) -> str:
        """What came instead of any frame that was understood, and what to check."""
        if self._bytes_received == 0:
            return "not one byte came; check port, power and that RX and TX are crossed"
        if self._reader.foreign_frames:
            return (
                f"{self._reader.foreign_frames} frames came whose checksum is right, but of another "
                "protocol; check chassis.model, and that the firmware is 1.5.0 or newer"
            )
        return (
            f"{self._bytes_received} bytes came, not one frame with a right checksum; check baud (115200) "
            "and that it is an AgileX base"
        )
