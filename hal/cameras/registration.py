"""Registers depth to colour: turns the depth camera's image into one from the viewpoint of the colour
camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import DepthImage, FloatArray, Intrinsics, Pose

_SATURATED = np.uint16(65535)  # the greatest value of 16 bits: this far or further
_NO_DEPTH = np.int32(65536)
_CLIP_PX = 1e6
# Half of the width of a depth pixel. A little more than 0.5, because noise moves neighbours apart, which must
# not leave pinholes in a surface.
_HALF_PIXEL = 0.65


class DepthRegistration:
    """Projects each depth pixel into the colour image; where several overlap, the nearest wins.

    A depth pixel covers the colour pixels whose centres lie between the projections of its corners, so there
    are no holes if the colour image has a longer focal length (as in librealsense's rs2::align).
    """

    def __init__(
        self, depth: Intrinsics, colour: Intrinsics, depth_in_colour: Pose, depth_scale_m: float
    ) -> None:
        """depth_in_colour: the pose of the depth camera in the frame of the colour camera."""
        self._colour = colour
        self._offset = (depth_in_colour.translation_m / depth_scale_m).astype(np.float32)
        self._first_corner = _corner_rays(depth, depth_in_colour.rotation, -_HALF_PIXEL)
        self._last_corner = _corner_rays(depth, depth_in_colour.rotation, _HALF_PIXEL)
        # How many colour pixels in a row a depth pixel may cover, plus one for stretching by tilt and
        # parallax.
        self._max_covered_px = (
            int(np.ceil(2 * _HALF_PIXEL * max(colour.fx / depth.fx, colour.fy / depth.fy))) + 1
        )

    def __call__(self, depth: DepthImage) -> DepthImage:
        """(H, W) uint16 of the depth camera -> (H, W) uint16 of the colour camera, same unit, 0 = no data."""
        width, height = self._colour.width, self._colour.height
        measured = np.flatnonzero(depth)
        units = depth.reshape(-1)[measured].astype(np.float32)
        u0, v0, distance = self._project(self._first_corner[:, measured] * units)
        u1, v1, _ = self._project(self._last_corner[:, measured] * units)
        # Depth that is saturated stays saturated: moved by the offset, it would be a wall just before the
        # limit.
        distance[units >= _SATURATED] = _SATURATED
        # If the depth camera is mounted rotated, the corners are swapped.
        first_u, first_v = np.minimum(u0, u1), np.minimum(v0, v1)
        end_u, end_v = np.maximum(u0, u1), np.maximum(v0, v1)
        image = np.full(width * height, _NO_DEPTH)
        for dv in range(self._max_covered_px):
            for du in range(self._max_covered_px):
                u, v = first_u + du, first_v + dv
                covered = (u < end_u) & (v < end_v) & (distance > 0)
                covered &= (u >= 0) & (u < width) & (v >= 0) & (v < height)
                np.minimum.at(image, (v * width + u)[covered], distance[covered])
        image[image == _NO_DEPTH] = 0
        return image.astype(np.uint16).reshape(height, width)

    def _project(
        self, points: NDArray[np.float32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """Project points (3, N) in depth units: first pixel centre right of and below each, distance (0:
        behind the camera)."""
        x, y, z = points + self._offset[:, None]
        in_front = z >= 1.0
        z = np.where(in_front, z, np.float32(1.0))
        u = np.ceil(np.float32(self._colour.fx) * x / z + np.float32(self._colour.cx))
        v = np.ceil(np.float32(self._colour.fy) * y / z + np.float32(self._colour.cy))
        return (
            np.clip(u, -_CLIP_PX, _CLIP_PX).astype(np.int32),
            np.clip(v, -_CLIP_PX, _CLIP_PX).astype(np.int32),
            np.where(in_front, np.rint(np.minimum(z, _SATURATED)), 0).astype(np.int32),
        )


def _corner_rays(camera: Intrinsics, rotation: FloatArray, shift_px: float) -> NDArray[np.float32]:
    """For each pixel the point at unit depth on the ray through its corner, rotated: (3, H * W)."""
    u, v = np.meshgrid(np.arange(camera.width) + shift_px, np.arange(camera.height) + shift_px)
    ahead = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)])
    return np.asarray(rotation @ ahead.reshape(3, -1), np.float32)
