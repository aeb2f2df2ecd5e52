"""What is compared: the truth of a frame, and what a method says about it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Pose, RgbdFrame

Box = tuple[float, float, float, float]
NO_BOX: Box = (math.nan, math.nan, math.nan, math.nan)
CALLED_MOVING = 0.5  # a detection of this confidence and above is called moving


@dataclass(frozen=True, slots=True, eq=False)
class TrueObject:
    """One body that has a plan of motion, at the time of one frame.

    box: of its visible pixels, the edges inclusive (u0, v0, u1, v1); NaN where nothing of it is seen.
    visible_px: seen pixels; visible_ratio: their share of its whole silhouette, occlusion and image border
    cut away. position_m (3,): mean of its visible surface in the optical frame, or the body's middle where
    nothing is seen. velocity_mps (3,): over ground, along the camera's axes. turning: on the spot or not.
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
        """Magnitude of the velocity."""
        return float(np.linalg.norm(self.velocity_mps))

    @property
    def distance_m(self) -> float:
        """From the camera."""
        return float(np.linalg.norm(self.position_m))


@dataclass(frozen=True, slots=True, eq=False)
class FrameTruth:
    """stamp_s: since the sequence began."""

    stamp_s: float
    objects: tuple[TrueObject, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DetectedObject:
    """What a method says about one thing.

    confidence: 0..1 that it is moving; from CALLED_MOVING on it is called moving. box: NaN where the
    method has none. position_m, velocity_mps (3,): optical frame; a NaN component was not measured.
    extent_m (3,): size of the visible surface, NaN where not known.
    """

    id: int
    box: Box
    position_m: FloatArray
    velocity_mps: FloatArray
    extent_m: FloatArray
    confidence: float


@dataclass(frozen=True, slots=True, eq=False)
class FrameDetections:
    """Everything one method said about one frame, and how long that took."""

    stamp_s: float
    detections: tuple[DetectedObject, ...]
    duration_ms: float


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """detections of a frame; mask (H, W) uint8: 0..255, how surely each pixel moves, None for methods
    without a silhouette of their own."""

    detections: tuple[DetectedObject, ...]
    mask: NDArray[np.uint8] | None = None


class Method(Protocol):
    """One way to find moving objects. Sees what a robot would see, nothing of the truth."""

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> Answer:
        """odometry: the camera in the odometry frame by dead reckoning; None: there is none."""
        ...


def unknown_vector() -> FloatArray:
    """(3,) NaN."""
    return np.full(3, np.nan)
