"""The depth image as a picture: near is bright, far is dark, no data is black."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.video import draw, text
from controller.video.moment import VideoMoment
from controller.video.placement import placement
from controller.video.seen_obstacles import SeenObstacle
from controller.video.style import FAINT_TEXT, NO_DEPTH, OWN, Image, Rect

_BAR_PX = 10


def colour_table() -> NDArray[np.uint8]:
    """(256, 3) BGR: 0 is no data; 1 (at the camera) to 255 (at the range) is viridis, bright to dark."""
    levels = np.arange(255, -1, -1, dtype=np.uint8)[:, np.newaxis]
    table = np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS), np.uint8)[:, 0]
    table[0] = NO_DEPTH
    return table


class DepthView:
    """Draws into one panel, with its scale beneath."""

    def __init__(self, panel: Rect, scale: Rect, range_m: float) -> None:
        self._panel = panel
        self._scale = scale
        self._range_m = range_m
        self._table = colour_table()

    def draw_backdrop(self, canvas: Image) -> None:
        """Draw what never changes: title and scale."""
        text.caption(canvas, self._panel, "DEPTH")
        view = self._scale.of(canvas)
        levels = np.linspace(1, 255, self._scale.width).astype(np.intp)
        view[:_BAR_PX] = self._table[levels]
        for fraction in (0.0, 0.25, 0.5, 0.75, 1.0):
            label = f"{fraction * self._range_m:g}" + (" m" if fraction == 1.0 else "")
            centred = round(fraction * self._scale.width) - text.width(label, 12) // 2
            x = max(0, min(centred, self._scale.width - text.width(label, 12)))
            text.put(view, label, x, _BAR_PX + 13, FAINT_TEXT, 12)

    def draw(self, canvas: Image, moment: VideoMoment, seen: list[SeenObstacle]) -> None:
        """Draw the depth image with the outlines of the obstacles."""
        view = self._panel.of(canvas)
        height, width = moment.frame.depth.shape
        placed = placement(width, height, self._panel)
        place = placed.place
        # Nearest neighbour, because a mean over an edge would be a distance in empty space.
        small = cv2.resize(moment.frame.depth, (place.width, place.height), interpolation=cv2.INTER_NEAREST)
        levels: NDArray[np.uint8] = np.asarray(
            cv2.convertScaleAbs(small, alpha=255.0 * moment.frame.depth_scale_m / self._range_m), np.uint8
        )
        if place.width < self._panel.width or place.height < self._panel.height:
            view[:] = NO_DEPTH
        np.take(self._table, levels, axis=0, out=(inside := place.of(view)))
        for obstacle in reversed(seen):
            corners = placed.to_panel(obstacle.box_px(moment.frame.intrinsics)) - (place.x, place.y)
            # An obstacle that is not seen in this frame has no depth here.
            if np.isfinite(corners).all() and not obstacle.predicted:
                draw.line(inside, draw.box(corners), OWN, obstacle.thickness - 1, closed=True)
        valid = moment.scene.health.valid_depth_ratio
        if np.isfinite(valid):
            text.caption_note(canvas, self._panel, f"{100.0 * valid:.0f} % valid")
