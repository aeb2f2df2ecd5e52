"""The boundary to the outside: a protocol for each kind of device, and for the clock.

Implementations: hal/cameras, hal/chassis, hal/links, sim.
"""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from hal.types import CanFrame, ChassisState, Intrinsics, Pose, RgbdFrame, Sender, Setpoint


class Device(Protocol):
    """A device that is open between __enter__ and __exit__. __exit__ is safe in any state."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Clock(Protocol):
    """The one clock of the program, monotonic. A simulated clock advances only in sleep_until_ns()."""

    def now_ns(self) -> int: ...

    def sleep_until_ns(self, deadline_ns: int) -> None: ...


class FrameSource(Device, Protocol):
    """A camera, simulated, recorded or real. Entering raises DeviceNotFound, DeviceRefused."""

    @property
    def intrinsics(self) -> Intrinsics:
        """The intrinsics of every frame. Raises DeviceRefused if only the device knows them and it is not yet
        open."""
        ...

    def read(self, timeout_s: float) -> RgbdFrame:
        """Wait at most timeout_s for the next frame of a recording, or the newest one of a camera.

        Raises FrameTimeout, EndOfStream, LinkLost, DeviceRefused once closed, and BadRecording if a recording
        holds no frame.
        """
        ...


class OdometrySource(Protocol):
    """Dead reckoning of the camera. It serves as a prior for the ego-motion, not as ground truth."""

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """The pose of the camera (optical frame) in the odometry frame at stamp_ns; None if unknown."""
        ...


class Chassis(Device, Protocol):
    """A tracked base, stepped by the control loop. It never waits, except briefly for a link to write."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """Send what is due and read what has arrived. None asks for standstill: an explicit zero is sent."""
        ...

    def arm(self, now_ns: int) -> None:
        """Give the operator's consent to move, in standby or after the cause of a latched stop has gone."""
        ...

    def stop(self, now_ns: int) -> None:
        """Send an explicit zero, then go to standby. Safe in any state, also on a lost link; idempotent."""
        ...


class ChassisListener(Device, Protocol):
    """A base that is only listened to: it can be neither armed nor commanded."""

    def listen(self, now_ns: int) -> ChassisState:
        """Read what has arrived, and ask a base that reports nothing by itself. No command is sent, zero
        included, also when the device is closed. What the base does is up to whoever drives it."""
        ...


class CanLink(Device, Protocol):
    """A link that carries whole CAN frames. It knows nothing about the chassis."""

    def send(self, frame: CanFrame) -> None:
        """Queue one frame; blocks only for a short, bounded time. Raises LinkLost."""
        ...

    def receive(self) -> CanFrame | None:
        """The oldest frame that has arrived; None if there is none. Raises LinkLost."""
        ...


class SerialLink(Device, Protocol):
    """A link that carries bytes. The protocol above does the framing."""

    def write(self, data: bytes) -> None:
        """Write all of data; blocks only for a short, bounded time. Raises LinkLost."""
        ...

    def read(self) -> bytes:
        """All bytes that have arrived, without waiting; b"" if there are none. Raises LinkLost."""
        ...


class DatagramLink(Device, Protocol):
    """A link that carries whole messages of other programs, in the order of their arrival."""

    def receive(self) -> tuple[bytes, Sender | None] | None:
        """The oldest message that has arrived, and its sender (None: it has no address); None if there is no
        message. Raises LinkLost."""
        ...

    def send(self, data: bytes, receiver: Sender) -> bool:
        """Send without waiting. False if it cannot be delivered now: a receiver that does not listen must not
        hold up the sender."""
        ...
