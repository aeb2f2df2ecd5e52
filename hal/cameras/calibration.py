"""The calibration of a recording (camera.yaml), applied to its images."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np

from config.loader import ConfigError, load
from config.recording import RecordingCamera
from hal.cameras.registration import DepthRegistration
from hal.cameras.undistort import Undistorter
from hal.errors import BadRecording
from hal.types import CameraMount, ColourImage, DepthImage, Intrinsics, Pose

_DEPTH_LIMIT = 65535
# So that 0.3 m with a factor of 1000, computed as 299.99999999999994, gives the value 300.
_ROUNDING = 1e-6
_UNREGISTERED_NOTE = (
    "depth is not registered to colour and camera.yaml does not give the depth camera: used as it is, so "
    "depth lies beside what it belongs to; add depth_fx, depth_fy, depth_cx, depth_cy and "
    "depth_to_colour_translation_m (a RealSense D435 has about 0.6 * width, 0.6 * width, width / 2, "
    "height / 2 and [0.015, 0, 0])"
)


class RecordingCalibration:
    """Intrinsics, scale and mount of a recording; turns its raw images into those of an RgbdFrame.

    mount: None if camera.yaml does not give the height of the camera. notes: sentences about what had to be
    assumed.
    """

    def __init__(self, camera: RecordingCamera) -> None:
        self.camera = camera
        self.intrinsics = Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
        self.depth_scale_m = 1.0 / camera.depth_factor
        self.depth_width = camera.depth_width or camera.width
        self.depth_height = camera.depth_height or camera.height
        self.mount = _mount(camera)
        self.notes = _notes(camera)
        self._registration = self._depth_registration()
        coefficients = camera.distortion or ()
        self._undistorter = Undistorter(self.intrinsics, coefficients) if any(coefficients) else None
        self._depth_range = _depth_range(camera)

    @classmethod
    def from_file(cls, path: Path) -> RecordingCalibration:
        """Read camera.yaml. Raises BadRecording with the file, the key and the reason."""
        try:
            return cls(load(path, RecordingCamera))
        except ConfigError as error:
            raise BadRecording(str(error)) from error

    def rectify(self, colour: ColourImage, depth: DepthImage) -> tuple[ColourImage, DepthImage]:
        """Undistorted colour and the depth registered to it, without values out of range.

        May work in place: do not use the images passed in afterwards.
        """
        if self._registration is not None:
            depth = self._registration(depth)
        if self._undistorter is not None:
            colour = self._undistorter.colour(colour)
            # Depth that was recorded as registered has the lens distortion of its colour image. Depth that
            # was registered above is undistorted already.
            if self._registration is None:
                depth = self._undistorter.depth(depth)
        if self._depth_range is not None:
            nearest, farthest = self._depth_range
            cv2.threshold(depth, farthest, 0, cv2.THRESH_TOZERO_INV, dst=depth)
            cv2.threshold(depth, nearest - 1, 0, cv2.THRESH_TOZERO, dst=depth)
        return colour, depth

    def _depth_registration(self) -> DepthRegistration | None:
        camera = self.camera
        if camera.depth_registered or camera.depth_intrinsics is None:
            return None
        return DepthRegistration(
            Intrinsics(self.depth_width, self.depth_height, *camera.depth_intrinsics),
            self.intrinsics,
            Pose(
                np.array(camera.depth_to_colour_rotation).reshape(3, 3),
                np.array(camera.depth_to_colour_translation_m),
            ),
            self.depth_scale_m,
        )


def _mount(camera: RecordingCamera) -> CameraMount | None:
    if camera.camera_height_m is None:
        return None
    return CameraMount(
        camera.camera_forward_m,
        camera.camera_left_m,
        camera.camera_height_m,
        math.radians(camera.camera_pitch_deg),
    )


def _depth_range(camera: RecordingCamera) -> tuple[int, int] | None:
    """The nearest and the farthest valid depth value; None if camera.yaml sets no limit."""
    if camera.depth_min_m is None and camera.depth_max_m is None:
        return None
    nearest = math.ceil((camera.depth_min_m or 0.0) * camera.depth_factor - _ROUNDING)
    farthest = (camera.depth_max_m or math.inf) * camera.depth_factor + _ROUNDING
    return min(max(nearest, 1), _DEPTH_LIMIT + 1), math.floor(min(farthest, _DEPTH_LIMIT))


def _notes(camera: RecordingCamera) -> tuple[str, ...]:
    notes = []
    if not camera.depth_registered and camera.depth_intrinsics is None:
        notes.append(_UNREGISTERED_NOTE)
    if camera.camera_height_m is None:
        notes.append("camera.yaml does not give camera_height_m")
    if camera.ignored_keys:
        notes.append(f"camera.yaml: keys without a meaning here: {', '.join(camera.ignored_keys)}")
    return tuple(notes)
