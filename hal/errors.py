"""The errors of the hardware boundary. The vendor's error is kept as ``__cause__``.

    HalError
    +-- DeviceNotFound     the port, bus, camera or recording named in the YAML is not there
    +-- DeviceRefused      the device is there, but it is the wrong one or access is denied
    +-- LinkLost           the device was there and has gone: unplugged, bus-off, port closed
    +-- FrameTimeout       the camera is there, but no frame came in time
    +-- EndOfStream        a recording has no further frame; not a fault
    +-- BadRecording       a recording cannot be read at all: what, where, why

Every message is one line: what was tried, what came back, what to do.
"""

from __future__ import annotations


class HalError(Exception):
    """Base of everything that hal raises on purpose."""


class DeviceNotFound(HalError):
    """Raised when opening: no such port, CAN interface, camera serial number or driver package."""


class DeviceRefused(HalError):
    """Raised when opening: permission missing, port in use, another protocol answers, a setting that the
    device did not accept when read back. Also by a use that it refuses: a device that is not open, a frame
    that cannot be written."""


class LinkLost(HalError):
    """Raised by a link in use: USB unplugged, CAN bus-off, the peer closed, a write timed out."""


class FrameTimeout(HalError):
    """Raised by FrameSource.read when no frame came within timeout_s. The next read may succeed."""


class EndOfStream(HalError):
    """Raised by FrameSource.read after the last frame of a recording."""


class BadRecording(HalError):
    """Raised when opening a recording: missing folder, no index, no calibration, no usable pair. Also by its
    read() where not one frame turns out to be usable."""
