"""Where a camera on the robot sees a box that is fixed to the robot, pixel by pixel.

For parts of the robot in its own view (`camera.own_parts`): vision/camera/own_parts.py cuts them out,
sim/rendering/own_parts.py draws them, controller/own_parts.py refuses those that hide too much, and
controller/video/own_parts.py shows their outline.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.own_parts import OwnPart
from hal.geometry import camera_in_body
from hal.types import CameraMount, Intrinsics

NEAR_M = 0.01  # what is nearer to the camera, or behind it, is not seen
_PARALLEL = 1e-9  # a ray less inclined than this never crosses the two faces


@dataclass(frozen=True, slots=True, eq=False)
class BoxView:
    """Depths along the optical axis at which the ray of each pixel enters a box and leaves it.

    enter_m, exit_m: (H, W); 0 where the ray passes by the box. axis: (H, W), number of the body axis across
        whose face it enters (0 x, 1 y, 2 z); of no meaning where the ray passes by.
    """

    enter_m: NDArray[np.float32]
    exit_m: NDArray[np.float32]
    axis: NDArray[np.intp]

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(H, W) the silhouette: pixels whose ray meets the box."""
        return self.exit_m > 0.0


def box_view(part: OwnPart, mount: CameraMount, camera: Intrinsics) -> BoxView:
    """The view of a box in the image of a camera.

    The ray of each pixel is cut with the three pairs of faces. That is the same as the convex hull of the
    projected corners, but is also right for a box that reaches behind the camera, and gives the depths.
    """
    x = (np.arange(camera.width) - camera.cx) / camera.fx
    y = (np.arange(camera.height) - camera.cy) / camera.fy
    rotation, origin_m = camera_in_body(mount).rotation, camera_in_body(mount).translation_m
    shape = (camera.height, camera.width)
    enter_m, exit_m, axis = np.full(shape, NEAR_M), np.full(shape, np.inf), np.zeros(shape, np.intp)
    for k in range(3):
        # Metres along this body axis, per metre of depth.
        along = rotation[k, 0] * x[None, :] + (rotation[k, 1] * y + rotation[k, 2])[:, None]
        along = np.where(np.abs(along) < _PARALLEL, _PARALLEL, along)
        first_m, second_m = (part.from_m[k] - origin_m[k]) / along, (part.to_m[k] - origin_m[k]) / along
        face_m = np.minimum(first_m, second_m)
        axis = np.where(face_m > enter_m, k, axis)
        enter_m = np.maximum(enter_m, face_m)
        exit_m = np.minimum(exit_m, np.maximum(first_m, second_m))
    seen = exit_m > enter_m
    return BoxView(
        np.where(seen, enter_m, 0.0).astype(np.float32),
        np.where(seen, exit_m, 0.0).astype(np.float32),
        axis,
    )
