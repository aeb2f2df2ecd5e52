"""The boundary to the outside, on one screen. Implementations: hal/cameras, hal/chassis, hal/links, sim."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from hal.types import CanFrame, ChassisState, Intrinsics, Pose, RgbdFrame, Sender, Setpoint


class Closing(Protocol):
    """A device is open between __enter__ and __exit__; leaving is safe in any state."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Clock(Protocol):
    """The only clock, monotonic. A simulated one advances when told."""

    def now_ns(self) -> int: ...

    def sleep_until_ns(self, deadline_ns: int) -> None: ...


class FrameSource(Closing, Protocol):
    """A camera, simulated, recorded or real. Entering raises DeviceNotFound, DeviceRefused."""

    @property
    def intrinsics(self) -> Intrinsics:
        """Of every frame. A device that tells them itself raises DeviceRefused before it is open."""
        ...

    def read(self, timeout_s: float) -> RgbdFrame:
        """The next frame, of a camera the newest, waited for at most timeout_s. Raises FrameTimeout,
        EndOfStream, LinkLost, DeviceRefused once closed, BadRecording where a recording holds none."""
        ...


class OdometrySource(Protocol):
    """Dead reckoning of the camera: a prior for ego-motion, never the truth."""

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """The camera (optical frame) in the odometry frame at stamp_ns; None where not known."""
        ...


class Chassis(Closing, Protocol):
    """A tracked base. Stepped by the control loop; waits for nothing but a link's short bound to write."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """Send what is due, read what has arrived. None asks for no motion: an explicit zero."""
        ...

    def arm(self, now_ns: int) -> None:
        """The operator's consent to move: from standby, or after a latched fault has gone."""
        ...

    def stop(self, now_ns: int) -> None:
        """Explicit zero, then standby. Safe in any state, also on a lost link; idempotent."""
        ...


class CanLink(Closing, Protocol):
    """Whole CAN frames. Knows nothing of chassis."""

    def send(self, frame: CanFrame) -> None:
        """Queue one frame within a short bound. Raises LinkLost."""
        ...

    def receive(self) -> CanFrame | None:
        """The oldest frame that has arrived; None is silence. Raises LinkLost."""
        ...


class SerialLink(Closing, Protocol):
    """Bytes over a port. Framing belongs to the protocol above."""

    def write(self, data: bytes) -> None:
        """Write all of data within a short bound. Raises LinkLost."""
        ...

    def read(self) -> bytes:
        """All bytes that have arrived, without waiting; b"" is silence. Raises LinkLost."""
        ...


class DatagramLink(Closing, Protocol):
    """Whole messages of other programs, in the order in which they arrive."""

    def receive(self) -> tuple[bytes, Sender | None] | None:
        """The oldest message that has arrived and who sent it (None: has no address); None is silence.
        Raises LinkLost."""
        ...

    def send(self, data: bytes, receiver: Sender) -> bool:
        """False if it cannot be delivered now: whoever does not listen must not make us wait."""
        ...
