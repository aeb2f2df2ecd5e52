"""The records that are compared: the truth of a frame, and a method's output for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Pose, RgbdFrame

Box = tuple[float, float, float, float]
NO_BOX: Box = (math.nan, math.nan, math.nan, math.nan)
CALLED_MOVING = 0.5  # a detection of this confidence or above is called moving


@dataclass(frozen=True, slots=True, eq=False)
class TrueObject:
    """One body that has a motion plan, at the time of one frame.

    kind: as in the scenario, such as "person".
    box: of its visible pixels, edges inclusive (u0, v0, u1, v1); NaN if none is visible.
    visible_px: number of visible pixels.
    visible_ratio: visible share of its silhouette, after occlusion and the image border.
    position_m: (3,) mean of its visible surface in the optical frame; the body's middle if none is visible.
    velocity_mps: (3,) over ground, along the camera's axes.
    turning: it rotates, on the spot or while it moves.
    """

    id: int
    kind: str
    box: Box
    visible_px: int
    visible_ratio: float
    position_m: FloatArray
    velocity_mps: FloatArray
    turning: bool = False

    @property
    def speed_mps(self) -> float:
        """Magnitude of the velocity over ground."""
        return float(np.linalg.norm(self.velocity_mps))

    @property
    def distance_m(self) -> float:
        """Distance from the camera."""
        return float(np.linalg.norm(self.position_m))


@dataclass(frozen=True, slots=True, eq=False)
class FrameTruth:
    """The true objects of one frame. stamp_s: since the sequence began."""

    stamp_s: float
    objects: tuple[TrueObject, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DetectedObject:
    """One detection of a method.

    box: (u0, v0, u1, v1), NaN if the method has none.
    position_m, velocity_mps: (3,) in the optical frame; NaN for a component that is not measured.
    extent_m: (3,) size of the visible surface, NaN if not known.
    confidence: 0..1 that it is moving; called moving from CALLED_MOVING on.
    """

    id: int
    box: Box
    position_m: FloatArray
    velocity_mps: FloatArray
    extent_m: FloatArray
    confidence: float


@dataclass(frozen=True, slots=True, eq=False)
class FrameDetections:
    """All detections of one method in one frame, and the processing time."""

    stamp_s: float
    detections: tuple[DetectedObject, ...]
    duration_ms: float


@dataclass(frozen=True, slots=True, eq=False)
class MethodOutput:
    """A method's output for one frame.

    mask: (H / 2, W / 2) uint8, confidence 0..255 that a pixel moves; None for methods without a mask.
    """

    detections: tuple[DetectedObject, ...]
    mask: NDArray[np.uint8] | None = None


class Method(Protocol):
    """A method that finds moving objects. It gets the robot's data only, not the truth."""

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        """Process one frame. odometry: the camera's pose by dead reckoning in the odometry frame, if any."""
        ...


def unknown_vector() -> FloatArray:
    """(3,) NaN."""
    return np.full(3, np.nan)
