"""The outlines of the robot's own parts in the colour image, to show whether `camera.own_parts` fits."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np

from config.own_parts import OwnPart
from controller.video import draw
from controller.video.placement import Placement
from controller.video.style import OWN, Image
from hal.box_view import box_view
from hal.types import CameraMount, FloatArray, Intrinsics


def draw_own_parts(
    inside: Image, parts: Sequence[OwnPart], mount: CameraMount, camera: Intrinsics, placed: Placement
) -> None:
    """Draw a thin dashed line around the silhouette of each part. inside: where the image is drawn."""
    origin = np.array([placed.place.x, placed.place.y])
    for part in parts:
        for outline_px in _outlines(part, mount, camera):
            draw.dashed(inside, placed.to_panel(outline_px) - origin, OWN)


@lru_cache(maxsize=16)
def _outlines(part: OwnPart, mount: CameraMount, camera: Intrinsics) -> tuple[FloatArray, ...]:
    """Closed lines (N, 2) in pixels around what the camera sees of a part; cached, as they never change."""
    seen = box_view(part, mount, camera).seen.astype(np.uint8)
    found, _ = cv2.findContours(seen, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    outlines = (np.concatenate((line, line[:1])).reshape(-1, 2).astype(float) for line in found)
    return tuple(outlines)
