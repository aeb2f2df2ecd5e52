"""One picture of the video from one moment."""

from __future__ import annotations

import numpy as np

from controller.video.colour_view import ColourView
from controller.video.corridor import corridor_ahead
from controller.video.depth_view import DepthView
from controller.video.header import Header
from controller.video.legend import draw_legend
from controller.video.moment import VideoMoment
from controller.video.seen_obstacles import SeenObstacle, seen_obstacles
from controller.video.speed_strip import SpeedStrip
from controller.video.style import (
    BACKGROUND,
    COLOUR_VIEW,
    DEPTH_SCALE,
    DEPTH_VIEW,
    HEADER,
    HEIGHT_PX,
    LEGEND,
    SPEED_STRIP,
    TOP_VIEW,
    WIDTH_PX,
    Image,
)
from controller.video.top_view import TopView

# Ranges to choose from, with round numbers on the scale of depth.
_RANGES_M = (2.0, 4.0, 6.0)
_STRIDE_PX = 8
_HISTORY_S = 10.0  # that the speed strip shows
_FAR_PERCENT = 95.0  # a few far pixels, such as of a window, do not count


class Composer:
    """Draws moments, in the order of time because the speed strip shows the last seconds.

    top_speed_mps: the scale of the speed strip. range_m: the largest range of the top view and of the colours
    of depth. If everything is nearer, the range is a smaller one; it grows with what is seen, and never
    shrinks, so that pictures can be compared.
    """

    def __init__(self, top_speed_mps: float = 1.5, range_m: float = 10.0) -> None:
        self._max_range_m = range_m
        self._header = Header(HEADER)
        self._colour = ColourView(COLOUR_VIEW)
        self._speed = SpeedStrip(SPEED_STRIP, top_speed_mps, _HISTORY_S)
        self._set_range(min(range_m, _RANGES_M[0]))

    def compose(self, moment: VideoMoment) -> Image:
        """The picture (720, 1280, 3) uint8, BGR; a new array each time."""
        seen = seen_obstacles(moment)
        range_m = range_for(moment, seen, self._max_range_m)
        if range_m > self._range_m:
            self._set_range(range_m)
        canvas = self._backdrop.copy()
        corridor = corridor_ahead(moment, self._range_m + 1.0)  # to where it leaves the top view
        self._header.draw(canvas, moment)
        self._colour.draw(canvas, moment, seen, corridor)
        self._depth.draw(canvas, moment, seen)
        self._top.draw(canvas, moment, seen, corridor)
        self._speed.draw(canvas, moment)
        return canvas

    def _set_range(self, range_m: float) -> None:
        self._range_m = range_m
        self._depth = DepthView(DEPTH_VIEW, DEPTH_SCALE, range_m)
        self._top = TopView(TOP_VIEW, range_m)
        self._backdrop = self._draw_backdrop()

    def _draw_backdrop(self) -> Image:
        canvas = np.empty((HEIGHT_PX, WIDTH_PX, 3), np.uint8)
        canvas[:] = BACKGROUND
        for panel in (self._header, self._colour, self._depth, self._top, self._speed):
            panel.draw_backdrop(canvas)
        draw_legend(canvas, LEGEND)
        return canvas


def range_for(moment: VideoMoment, seen: list[SeenObstacle], max_range_m: float) -> float:
    """The smallest range that shows nearly all of the depth image and the obstacles that matter; max_range_m
    if the image has no depth."""
    depth = moment.frame.depth[::_STRIDE_PX, ::_STRIDE_PX]
    known = depth[depth > 0]
    if not len(known):
        return max_range_m
    far_m = float(np.percentile(known, _FAR_PERCENT)) * moment.frame.depth_scale_m
    far_m = max([far_m] + [one.distance_m for one in seen if one.is_deciding or one.obstacle.moving])
    return min([range_m for range_m in _RANGES_M if range_m >= far_m] + [max_range_m])
