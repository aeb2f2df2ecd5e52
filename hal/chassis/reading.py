"""Reading a serial link empty: one read may give a few bytes, and what stays is older every time."""

from __future__ import annotations

from hal.api import SerialLink

# A line at 115200 baud carries 230 bytes in 20 ms. Much more in one exchange is a flood, and must not hold
# the control loop.
_MOST_BYTES = 16_384
_MOST_READS = 256


def read_all(link: SerialLink) -> bytes:
    """All that has arrived, in as many reads as that takes, within bounds; b"" is silence. Raises LinkLost:
    then what was read before is lost, too."""
    arrived = bytearray()
    for _ in range(_MOST_READS):
        data = link.read()
        arrived += data
        if not data or len(arrived) >= _MOST_BYTES:
            break
    return bytes(arrived)
