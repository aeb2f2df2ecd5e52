"""Reading all that has arrived on a serial link. One read may return only a few bytes, and what stays behind
grows older with every exchange."""

from __future__ import annotations

from hal.api import SerialLink

# Maximum for one exchange. A line at 115200 baud carries 230 bytes in 20 ms; much more is a flood, which must
# not hold up the control loop.
_MAX_BYTES = 16_384
_MAX_READS = 256


def read_all(link: SerialLink) -> bytes:
    """All bytes that have arrived, in as many reads as necessary, up to the maximum; b"" if there are none.

    Raises LinkLost; then the bytes that were read before are lost, too.
    """
    arrived = bytearray()
    for _ in range(_MAX_READS):
        data = link.read()
        arrived += data
        if not data or len(arrived) >= _MAX_BYTES:
            break
    return bytes(arrived)
