"""True objects, detections and images for the evaluation's tests, of few numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.evaluation.types import (
    NO_BOX,
    Box,
    DetectedObject,
    FrameDetections,
    FrameTruth,
    TrueObject,
    unknown_vector,
)
from hal.types import Intrinsics, RgbdFrame

FPS = 30.0
CAMERA = Intrinsics(640, 480, 600.0, 600.0, 319.5, 239.5)
BOX: Box = (100.0, 100.0, 200.0, 300.0)
ELSEWHERE: Box = (500.0, 100.0, 560.0, 200.0)


def true_object(
    number: int = 1,
    speed_mps: float = 1.0,
    box: Box = BOX,
    position_m: tuple[float, float, float] = (0.0, 0.0, 4.0),
    visible_px: int = 5000,
    visible_ratio: float = 1.0,
    turning: bool = False,
) -> TrueObject:
    """A person that walks to the right."""
    velocity = np.array([speed_mps, 0.0, 0.0])
    return TrueObject(
        number, "person", box, visible_px, visible_ratio, np.array(position_m), velocity, turning
    )


def detection(
    number: int = 7,
    box: Box = BOX,
    position_m: tuple[float, float, float] = (0.0, 0.0, 4.0),
    velocity_mps: tuple[float, float, float] = (1.0, 0.0, 0.0),
    confidence: float = 0.9,
) -> DetectedObject:
    """Of the person above, without any error."""
    return DetectedObject(
        number, box, np.array(position_m), np.array(velocity_mps), np.array([0.5, 1.7, 0.3]), confidence
    )


def far_detection(number: int = 9, confidence: float = 0.9) -> DetectedObject:
    """Of nothing that is there."""
    return detection(number, ELSEWHERE, (3.0, 0.0, 8.0), confidence=confidence)


def bare_detection(position_m: tuple[float, float, float]) -> DetectedObject:
    """With a position and nothing else, as a lidar has it."""
    return DetectedObject(3, NO_BOX, np.array(position_m), unknown_vector(), unknown_vector(), 0.9)


def truths(frames: Sequence[Sequence[TrueObject]]) -> list[FrameTruth]:
    """One after the other at FPS."""
    return [FrameTruth(index / FPS, tuple(objects)) for index, objects in enumerate(frames)]


def answers(frames: Sequence[Sequence[DetectedObject]], duration_ms: float = 5.0) -> list[FrameDetections]:
    """One after the other at FPS."""
    return [
        FrameDetections(index / FPS, tuple(detections), duration_ms)
        for index, detections in enumerate(frames)
    ]


def texture(height: int, width: int, seed: int, smooth_px: float = 2.0) -> NDArray[np.uint8]:
    """Blobs that corners and flow can hold on to."""
    generator = np.random.default_rng(seed)
    white = generator.normal(size=(height, width)).astype(np.float32)
    blobs = cv2.GaussianBlur(white, (0, 0), smooth_px)
    return np.asarray(np.clip(128.0 + 45.0 * blobs / blobs.std(), 0, 255), np.uint8)


_WALL = texture(600, 900, 1)
_THING = texture(400, 240, 2)


def moving_square(
    index: int,
    thing_px_per_frame: float = 6.0,
    pan_px_per_frame: float = 0.0,
    size: tuple[int, int] = (120, 200),
) -> RgbdFrame:
    """A textured wall 5 m away that the camera pans over, and before it, at 3 m, a textured thing."""
    shift = round(index * pan_px_per_frame)
    grey = _WALL[60:540, 60 + shift : 700 + shift].copy()
    depth = np.full((480, 640), 5000, np.uint16)
    width, height = size
    if width > 0:
        left = 150 + round(index * (thing_px_per_frame - pan_px_per_frame))
        grey[140 : 140 + height, left : left + width] = _THING[:height, :width]
        depth[140 : 140 + height, left : left + width] = 3000
    stamp_ns = round(index * 1e9 / FPS)
    colour = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)
    return RgbdFrame(colour, depth, 0.001, stamp_ns, stamp_ns * 1e-9, index, CAMERA)


def square_left_px(index: int, thing_px_per_frame: float = 6.0, pan_px_per_frame: float = 0.0) -> float:
    """The thing's left edge."""
    return 150.0 + round(index * (thing_px_per_frame - pan_px_per_frame))


def known(value: float | None) -> float:
    """A JSON number that must be there."""
    assert value is not None
    assert math.isfinite(value)
    return value
