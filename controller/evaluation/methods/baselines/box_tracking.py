"""Object tracking (Table 1, third row): OpenCV's MIL tracker, given the first true box of each moving object.

The table says "Needs initial good selection of the object". Here it gets the true box, so its figures tell
how well a box is tracked, not how it would be found. An object counts as moving as long as it is tracked.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from controller.evaluation.methods.baselines.masks import SCALE, half_depth_m, half_intrinsics
from controller.evaluation.types import Box, DetectedObject, MethodOutput, unknown_vector
from hal.types import ColourImage, FloatArray, Intrinsics, Pose, RgbdFrame

_SEED = 20200127


@dataclass(slots=True, eq=False)
class _TrackedBox:
    id: int
    tracker: cv2.Tracker


class BoxTracking:
    """One tracker per object, on the image at half size."""

    def __init__(self) -> None:
        cv2.setRNGSeed(_SEED)
        self._tracked: list[_TrackedBox] = []
        self._new_objects: list[tuple[int, Box]] = []

    def add_object(self, object_id: int, box: Box) -> None:
        """Give the true box of an object in the next frame; once for each object."""
        self._new_objects.append((object_id, box))

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        """Odometry is not used."""
        image = np.asarray(
            cv2.resize(frame.colour, None, fx=1.0 / SCALE, fy=1.0 / SCALE, interpolation=cv2.INTER_AREA),
            np.uint8,
        )
        boxes: list[tuple[int, Box]] = []
        for tracked in list(self._tracked):
            ok, rectangle = tracked.tracker.update(image)
            if ok:
                left, top, width, height = (float(edge) * SCALE for edge in rectangle)
                boxes.append((tracked.id, (left, top, left + width, top + height)))
            else:
                self._tracked.remove(tracked)
        for object_id, box in self._new_objects:
            self._start_tracker(image, object_id, box)
            boxes.append((object_id, box))
        self._new_objects.clear()
        depth_m, k = half_depth_m(frame), half_intrinsics(frame.intrinsics)
        return MethodOutput(
            tuple(
                DetectedObject(
                    object_id, box, _position(box, depth_m, k), unknown_vector(), unknown_vector(), 1.0
                )
                for object_id, box in boxes
            )
        )

    def _start_tracker(self, image: ColourImage, object_id: int, box: Box) -> None:
        height, width = image.shape[:2]
        u0, v0, u1, v1 = (round(edge / SCALE) for edge in box)
        u0, v0 = int(np.clip(u0, 0, width - 2)), int(np.clip(v0, 0, height - 2))
        u1, v1 = int(np.clip(u1, u0 + 1, width)), int(np.clip(v1, v0 + 1, height))
        tracker = cv2.TrackerMIL.create()
        tracker.init(image, (u0, v0, u1 - u0, v1 - v0))
        self._tracked.append(_TrackedBox(object_id, tracker))


def _position(box: Box, depth_m: np.typing.NDArray[np.float32], k: Intrinsics) -> FloatArray:
    """Position by the median depth in the middle half of the box; NaN if there is no depth."""
    u0, v0, u1, v1 = (edge / SCALE for edge in box)
    height, width = depth_m.shape
    left, right = (int(np.clip(u0 + fraction * (u1 - u0), 0, width)) for fraction in (0.25, 0.75))
    top, bottom = (int(np.clip(v0 + fraction * (v1 - v0), 0, height)) for fraction in (0.25, 0.75))
    z = depth_m[top:bottom, left:right]
    z = z[z > 0.0]
    if z.size == 0:
        return unknown_vector()
    z_m = float(np.median(z))
    u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
    return np.array([(u - k.cx) / k.fx * z_m, (v - k.cy) / k.fy * z_m, z_m])
