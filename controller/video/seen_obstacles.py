"""Obstacles in the body frame, as all views name them: the deciding one first, then movers, then the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controller.video.labels import Label
from controller.video.moment import VideoMoment
from controller.video.style import MOVING, STATIC, Colour
from hal.geometry import camera_in_body
from hal.types import CameraMount, FloatArray, Intrinsics
from vision.scene import Obstacle

# Without a mount the top view is the camera's own: level, standing at the origin.
LEVEL_CAMERA = CameraMount(0.0, 0.0, 0.0, 0.0)
# A surface seen edge-on, or one whose size is not known, is still drawn.
_MIN_EXTENT_M = 0.12
# Nearer than this, a projection would fill the image and be useless.
_MIN_PROJECTION_M = 0.1
_CORNERS: FloatArray = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, slots=True, eq=False)
class SeenObstacle:
    """An obstacle on the floor of the body frame.

    centre_m, velocity_mps: (2,), forward and left.
    velocity_cov: (2, 2).
    corners_m: (4, 2), its visible surface from above.
    distance_m: from the camera, along the floor.
    is_deciding: the decision is based on it.
    """

    obstacle: Obstacle
    centre_m: FloatArray
    corners_m: FloatArray
    velocity_mps: FloatArray
    velocity_cov: FloatArray
    distance_m: float
    is_deciding: bool

    @property
    def colour(self) -> Colour:
        """The colour for static or moving."""
        return MOVING if self.obstacle.moving else STATIC

    @property
    def thickness(self) -> int:
        """Thickness of its box, so that moving is not shown by the hue alone."""
        return 3 if self.obstacle.moving else 2

    @property
    def predicted(self) -> bool:
        """Whether it is not seen in this frame."""
        return self.obstacle.unseen_s > 0.0

    def box_px(self, camera: Intrinsics) -> FloatArray:
        """Opposite corners (2, 2) of its box in the image, NaN if there is none.

        An obstacle that is not seen in this frame has moved on since its box was measured, so its predicted
        surface is projected.
        """
        if not self.predicted:
            return np.reshape(self.obstacle.bbox_px, (2, 2))
        centre_m, z = self.obstacle.position_m[:2], self.obstacle.position_m[2]
        if not z > _MIN_PROJECTION_M:
            return np.full((2, 2), np.nan)
        half_m = 0.5 * self.obstacle.extent_m[:2]
        corners_m = np.stack([centre_m - half_m, centre_m + half_m])
        return np.asarray(corners_m / z * (camera.fx, camera.fy) + (camera.cx, camera.cy), np.float64)

    def describe(self) -> str:
        """Its number and distance, and its speed if it moves."""
        words = f"#{self.obstacle.id}  {self.distance_m:.1f} m"
        if not self.obstacle.moving:
            return words
        speed_mps = math.hypot(*self.velocity_mps)
        return words + (f"  {speed_mps:.1f} m/s" if math.isfinite(speed_mps) else "  speed unknown")

    def label(self, words: str, box: FloatArray) -> Label:
        """A label with these words beside box, in the style of this obstacle."""
        return Label(words, self.colour, box, filled=self.obstacle.moving, outlined=self.is_deciding)


def seen_obstacles(moment: VideoMoment) -> list[SeenObstacle]:
    """The obstacles with a known position, in the order in which their labels get room."""
    camera = camera_in_body(moment.mount or LEVEL_CAMERA)
    deciding_id = None if moment.decision is None else moment.decision.reason.obstacle_id
    seen = []
    for obstacle in moment.scene.obstacles:
        if not np.isfinite(obstacle.position_m).all():
            continue
        centre_m = camera.apply(obstacle.position_m[np.newaxis])[0, :2]
        half_m = 0.5 * np.fmax(obstacle.extent_m[[2, 0]], _MIN_EXTENT_M)
        in_body = camera.rotation[:2]
        seen.append(
            SeenObstacle(
                obstacle=obstacle,
                centre_m=centre_m,
                corners_m=centre_m + _CORNERS * half_m,
                velocity_mps=in_body @ _known(obstacle.velocity_mps),
                velocity_cov=in_body @ _known(obstacle.velocity_cov) @ in_body.T,
                distance_m=math.hypot(*(centre_m - camera.translation_m[:2])),
                is_deciding=obstacle.id == deciding_id,
            )
        )
    return sorted(
        seen,
        key=lambda seen_obstacle: (
            not seen_obstacle.is_deciding,
            not seen_obstacle.obstacle.moving,
            seen_obstacle.distance_m,
        ),
    )


def _known(values: FloatArray) -> FloatArray:
    """The values with NaN for infinity, which is unknown, too. NaN can be multiplied without warnings."""
    return np.where(np.isfinite(values), values, np.nan)
