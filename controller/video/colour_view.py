"""The camera's colour image with what was found in it: fragments, obstacles, the corridor on the floor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.video import draw, text
from controller.video.corridor import DrawnCorridor
from controller.video.labels import draw_labels
from controller.video.moment import VideoMoment
from controller.video.own_parts import draw_own_parts
from controller.video.placement import Placement, placement
from controller.video.seen_obstacles import SeenObstacle
from controller.video.style import (
    DARK_TEXT,
    HEALTH,
    MOVING,
    OWN,
    PANEL,
    STATIC,
    UNMEASURED,
    Image,
    Rect,
)
from hal.geometry import camera_in_body
from hal.types import CameraMount, FloatArray, Intrinsics
from vision.scene import CameraCondition, Fragments

# The image is drawn a little darker, so that lines and labels stand out against bright floors.
_BRIGHTNESS = 0.82
_MIN_FLOOR_DISTANCE_M = 0.25
_BANNER_PX = 24


class ColourView:
    """Draws the colour image into one panel."""

    def __init__(self, panel: Rect) -> None:
        self._panel = panel

    def draw_backdrop(self, canvas: Image) -> None:
        """Draw what never changes."""
        text.caption(canvas, self._panel, "COLOUR")

    def draw(
        self, canvas: Image, moment: VideoMoment, seen: list[SeenObstacle], corridor: DrawnCorridor | None
    ) -> None:
        """Draw the image, then what lies on the floor, the fragments, the obstacles and their labels."""
        view = self._panel.of(canvas)
        height, width = moment.frame.colour.shape[:2]
        placed = placement(width, height, self._panel)
        _draw_image(view, moment.frame.colour, placed)
        inside = placed.place.of(view)
        origin = np.array([placed.place.x, placed.place.y])
        if corridor is not None and moment.mount is not None:
            _draw_corridor(inside, corridor, moment.mount, moment.frame.intrinsics, placed, origin)
        if moment.mount is not None:
            draw_own_parts(inside, moment.own_parts, moment.mount, moment.frame.intrinsics, placed)
        _draw_fragments(inside, moment.fragments, placed, origin)
        boxes_px = [(obstacle, obstacle.box_px(moment.frame.intrinsics)) for obstacle in seen]
        boxes = [
            (obstacle, placed.to_panel(box_px) - origin)
            for obstacle, box_px in boxes_px
            if np.isfinite(box_px).all()
        ]
        for obstacle, corners in reversed(boxes):
            _draw_box(inside, obstacle, draw.box(corners))
        banner = _draw_health(inside, moment)
        labels = [obstacle.label(obstacle.describe(), corners) for obstacle, corners in boxes]
        draw_labels(inside, labels, banner)
        text.caption_note(canvas, self._panel, _count(moment))


def _count(moment: VideoMoment) -> str:
    obstacles, fragments = moment.scene.obstacles, moment.fragments
    moving_obstacles = sum(obstacle.moving for obstacle in obstacles)
    moving_fragments = np.count_nonzero(fragments.moving)
    return (
        f"fragments {len(fragments.ids)}, moving {moving_fragments}     "
        f"obstacles {len(obstacles)}, moving {moving_obstacles}"
    )


def _draw_image(view: Image, colour: Image, placed: Placement) -> None:
    place = placed.place
    if (place.width, place.height) != (view.shape[1], view.shape[0]):
        view[:] = PANEL
    inside = place.of(view)
    if placed.scale != 1.0:
        shrinks = placed.scale < 1.0
        colour = cv2.resize(
            colour,
            (place.width, place.height),
            interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR,
        ).astype(np.uint8, copy=False)
    cv2.convertScaleAbs(colour, dst=inside, alpha=_BRIGHTNESS)


def _draw_corridor(
    inside: Image,
    corridor: DrawnCorridor,
    mount: CameraMount,
    intrinsics: Intrinsics,
    placed: Placement,
    origin: NDArray[np.int64],
) -> None:
    left, right = (
        placed.to_panel(_floor_to_image(edge_m, mount, intrinsics)) - origin
        for edge_m in (corridor.left_m, corridor.right_m)
    )
    visible = np.isfinite(left).all(axis=1) & np.isfinite(right).all(axis=1)
    if np.count_nonzero(visible) < 2:
        return
    left, right = left[visible], right[visible]
    draw.tint(inside, np.concatenate([left, right[::-1]]), OWN, 0.12)
    draw.lines(inside, np.stack([left, right]), OWN)


def _floor_to_image(points_m: FloatArray, mount: CameraMount, intrinsics: Intrinsics) -> FloatArray:
    """Project floor points (N, 2) of the body frame to pixels; NaN if too close to the camera or behind
    it."""
    on_floor_m = np.column_stack([points_m, np.zeros(len(points_m))])
    x, y, z = camera_in_body(mount).inverse().apply(on_floor_m).T
    z = np.where(z > _MIN_FLOOR_DISTANCE_M, z, np.nan)
    return np.column_stack(
        [intrinsics.fx * x / z + intrinsics.cx, intrinsics.fy * y / z + intrinsics.cy],
    )


def _draw_fragments(
    inside: Image, fragments: Fragments, placed: Placement, origin: NDArray[np.int64]
) -> None:
    ends = placed.to_panel(fragments.ends_px) - origin
    measured = np.isfinite(fragments.velocity_mps).all(axis=1)
    draw.lines(inside, ends[~measured & ~fragments.moving], UNMEASURED)
    draw.lines(inside, ends[measured & ~fragments.moving], STATIC)
    draw.lines(inside, ends[fragments.moving], MOVING)


def _draw_box(inside: Image, obstacle: SeenObstacle, corners: FloatArray) -> None:
    if obstacle.is_deciding:
        draw.line(inside, corners, OWN, obstacle.thickness + 4, closed=True)
    if obstacle.predicted:
        draw.dashed(inside, np.concatenate([corners, corners[:1]]), obstacle.colour, obstacle.thickness)
    else:
        draw.line(inside, corners, DARK_TEXT, obstacle.thickness + 2, closed=True)
        draw.line(inside, corners, obstacle.colour, obstacle.thickness, closed=True)


def _draw_health(inside: Image, moment: VideoMoment) -> list[Rect]:
    """Draw a banner if the camera is not good; return the area that it covers."""
    health = moment.scene.health
    if health.condition is CameraCondition.GOOD:
        return []
    height, width = inside.shape[:2]
    banner = Rect(0, height - _BANNER_PX, width, _BANNER_PX)
    banner.of(inside)[:] = HEALTH[health.condition]
    sentence = f"camera {health.condition.value}: {health.reason}"
    text.put(
        inside, text.fit(sentence, width - 16, 14, text.MEDIUM), 8, height - 8, DARK_TEXT, 14, text.MEDIUM
    )
    return [banner]
