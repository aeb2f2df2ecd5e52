"""Data that crosses the boundary to the outside. SI units; time is monotonic nanoseconds.

Frames follow REP 103: body x forward, y left, z up; camera optical x right, y down, z forward.
A value that is not known is NaN or None, never 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from hal.records import record

FloatArray = NDArray[np.float64]
# Arrays of known dimensions. The note is their type for compiled steps that read them from a record
# (hal/compiled.py); for the type checker they are arrays like all others.
Vector = Annotated[FloatArray, "float64[:]"]
Matrix = Annotated[FloatArray, "float64[:, :]"]
Matrices = Annotated[FloatArray, "float64[:, :, :]"]
FlagMatrix = Annotated[NDArray[np.bool_], "boolean[:, :]"]
Flags = Annotated[NDArray[np.bool_], "boolean[:]"]
Integers = Annotated[NDArray[np.intp], "int64[:]"]
ColourImage = NDArray[np.uint8]
DepthImage = NDArray[np.uint16]
# Sender of a datagram as the socket module gives it: (host, port, ...), or the path of a Unix socket.
Sender = tuple[Any, ...] | str | bytes


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pinhole camera (eq. 4 of Daeef 2020, with cx, cy instead of w/2, h/2).

    Integer coordinates are pixel centres. The images of a frame are already undistorted.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, slots=True)
class GyroSamples:
    """The gyro readings that arrived since the frame before.

    stamps_ns: (N,). rates_radps: (N, 3), in optical axes. A frame arrives after its exposure, so some
    readings may be later than the frame they come with.
    """

    stamps_ns: NDArray[np.int64]
    rates_radps: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RgbdFrame:
    """One colour image and the depth aligned to it, taken at the same time.

    colour: (H, W, 3) uint8, BGR.
    depth: (H, W) uint16, metres = depth * depth_scale_m, 0 = no data.
    captured_ns: monotonic time of exposure.
    device_s: the same by the camera's own clock.
    sequence: counts the frames of the device, so a gap shows a lost frame.
    """

    colour: ColourImage
    depth: DepthImage
    depth_scale_m: float
    captured_ns: int
    device_s: float
    sequence: int
    intrinsics: Intrinsics
    gyro: GyroSamples | None = None


@record(frozen=True, slots=True, eq=False)
class Pose:
    """Pose of an inner frame in an outer one: p_outer = rotation @ p_inner + translation_m.

    rotation: (3, 3); translation_m: (3,).
    """

    rotation: Matrix
    translation_m: Vector

    def inverse(self) -> Pose:
        """The pose of the outer frame in the inner one."""
        transposed = self.rotation.T
        return Pose(transposed, -transposed @ self.translation_m)

    def __matmul__(self, other: Pose) -> Pose:
        """Chain: (a in b) @ (c in a) = c in b."""
        return Pose(
            self.rotation @ other.rotation,
            self.rotation @ other.translation_m + self.translation_m,
        )

    @property
    def finite(self) -> bool:
        """Whether no number is NaN or infinite."""
        return bool(np.isfinite(self.rotation).all() and np.isfinite(self.translation_m).all())

    def apply(self, points_m: FloatArray) -> FloatArray:
        """Transform points (N, 3) from the inner frame to the outer one."""
        return points_m @ self.rotation.T + self.translation_m


@record(frozen=True, slots=True)
class PlanarPose:
    """Pose of the body on the floor of a fixed frame (odometry or world)."""

    x_m: float
    y_m: float
    heading_rad: float

    @property
    def finite(self) -> bool:
        """Every number is known."""
        return math.isfinite(self.x_m + self.y_m + self.heading_rad)


@dataclass(frozen=True, slots=True)
class CameraMount:
    """Where the camera sits on the body.

    forward_m, left_m: from the turning centre. height_m: above the floor.
    pitch_rad: positive looks down (as camera_pitch_deg of the recordings).
    """

    forward_m: float
    left_m: float
    height_m: float
    pitch_rad: float


@record(frozen=True, slots=True)
class Setpoint:
    """The motion asked of the chassis from stamp_ns on: one point of the jerk-limited profile."""

    stamp_ns: int
    v_mps: float
    a_mps2: float
    w_radps: float


class ChassisMode(Enum):
    """The arming state machine that every driver owns (see hal/chassis/arming.py)."""

    STANDBY = "standby"
    ARMING = "arming"
    ARMED = "armed"
    STOPPING = "stopping"
    ESTOP = "e-stop"
    LOST = "lost"


# Only arm(), a person's consent, leads out of these modes.
LATCHED_MODES = (ChassisMode.ESTOP, ChassisMode.LOST)


@dataclass(frozen=True, slots=True)
class ChassisState:
    """What is known of the chassis after one exchange.

    reason: why the mode is what it is.
    feedback_ns: when the newest motion feedback arrived (None: never).
    v_mps, w_radps: as measured (NaN: unknown).
    pose: dead reckoning from the chassis' own feedback since the driver was opened.
    faults: sentences for the operator.
    sent: the setpoint that was sent, after limiting; None if none was.
    """

    stamp_ns: int
    mode: ChassisMode
    reason: str
    feedback_ns: int | None
    v_mps: float
    w_radps: float
    pose: PlanarPose
    battery_v: float
    faults: tuple[str, ...]
    sent: Setpoint | None


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One classic CAN frame with an 11-bit identifier and 0..8 data bytes."""

    arbitration_id: int
    data: bytes
