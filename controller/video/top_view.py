"""The floor from above, true to scale: the robot at the bottom, what is ahead of it above."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.robot import Body
from controller.video import draw, text
from controller.video.corridor import DrawnCorridor
from controller.video.labels import draw_labels
from controller.video.moment import VideoMoment
from controller.video.seen_obstacles import LEVEL_CAMERA, SeenObstacle
from controller.video.style import (
    BACKGROUND,
    FAINT_TEXT,
    FREE_SPACE,
    GRID,
    OWN,
    PANEL,
    SURFACE,
    Image,
    Rect,
)
from hal.types import CameraMount, FloatArray
from vision.scene import FreeSpace

_BEHIND_M = 0.85
_BEYOND_M = 0.35
_RING_M, _SHORT_RANGE_M = 2.0, 5.0  # up to the second, the rings are half as far apart
# Labels of the rings are on the right: clear of the corridor, and inside the panel also on the far rings.
_RING_LABEL_SIN, _RING_LABEL_RIGHT_RATIO = 0.5, 0.27
_PATH_PX = 1.0  # half of the width of the path
_ARROW_S = 1.0
_MAX_SIGMA_M = 2.5
_TRACK_WIDTH_RATIO = 0.24


class TopView:
    """Draws into one panel. The origin of the body frame is at the middle of the lower edge."""

    def __init__(self, panel: Rect, range_m: float) -> None:
        self._panel = panel
        self._range_m = range_m
        self._px_per_m = panel.height / (_BEHIND_M + range_m + _BEYOND_M)
        self._origin_px = (0.5 * (panel.width - 1), panel.height - 1 - _BEHIND_M * self._px_per_m)

    def to_pixels(self, points_m: FloatArray) -> FloatArray:
        """Transform points (..., 2) of the body frame (forward, left) to pixels of the panel (right,
        down)."""
        return np.stack(
            [
                self._origin_px[0] - points_m[..., 1] * self._px_per_m,
                self._origin_px[1] - points_m[..., 0] * self._px_per_m,
            ],
            axis=-1,
        )

    def draw_backdrop(self, canvas: Image) -> None:
        """Draw what never changes."""
        self._panel.of(canvas)[:] = PANEL
        text.caption(canvas, self._panel, "TOP VIEW")
        text.caption_note(canvas, self._panel, "distance from the camera")

    def draw(
        self, canvas: Image, moment: VideoMoment, seen: list[SeenObstacle], corridor: DrawnCorridor | None
    ) -> None:
        """From the floor upwards."""
        view = self._panel.of(canvas)
        mount = moment.mount or LEVEL_CAMERA
        scan = _Scan(moment.scene.free_space, mount, self._range_m)
        if len(scan.free_m):
            draw.area(view, self.to_pixels(scan.free_m), FREE_SPACE)
        if corridor is not None:
            draw.tint(view, self.to_pixels(corridor.outline_m), OWN, 0.13)
        self._draw_rings(view, mount)
        draw.lines(view, self.to_pixels(scan.surfaces_m), SURFACE, 2)
        if corridor is not None:
            edges_m = np.stack([corridor.left_m, corridor.right_m])
            draw.lines(view, self.to_pixels(edges_m), FAINT_TEXT)
            draw.area(view, self.to_pixels(corridor.ribbon_m(_PATH_PX / self._px_per_m)), OWN)
            self._draw_decisive_place(view, moment, corridor)
        if moment.body is not None:
            self._draw_robot(view, moment.body)
        self._draw_camera(view, mount)
        for obstacle in reversed(seen):
            self._draw_obstacle(view, obstacle)
        labels = [obstacle.label(f"#{obstacle.obstacle.id}", self._label_box(obstacle)) for obstacle in seen]
        boxes = [_rect_around(self._label_box(obstacle)) for obstacle in seen]
        draw_labels(view, labels, self._draw_ring_labels(view, mount, boxes), size=12)

    def _draw_decisive_place(self, view: Image, moment: VideoMoment, corridor: DrawnCorridor) -> None:
        """Draw a bar across the corridor where the speed is limited by no obstacle, such as at a blind
        corner."""
        reason = None if moment.decision is None else moment.decision.reason
        if reason is None or reason.obstacle_id is not None or not math.isfinite(reason.distance_m):
            return
        ahead_m = reason.distance_m + (0.0 if moment.body is None else moment.body.front_m)
        along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corridor.centre_m, axis=0).T))])
        if not 0.0 <= ahead_m <= along_m[-1]:
            return
        index = int(np.abs(along_m - ahead_m).argmin())
        ends_m = np.stack([corridor.left_m[index], corridor.right_m[index]])
        draw.line(view, self.to_pixels(ends_m), BACKGROUND, 7)
        draw.line(view, self.to_pixels(ends_m), OWN, 4)

    def _draw_rings(self, view: Image, mount: CameraMount) -> None:
        """Draw the rings around the point of the floor below the camera."""
        camera_m = np.array([mount.forward_m, mount.left_m])
        radii_m = self._radii_m()
        angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 61)
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        draw.lines(view, self.to_pixels(camera_m + radii_m[:, np.newaxis, np.newaxis] * circle), GRID)

    def _draw_ring_labels(self, view: Image, mount: CameraMount, boxes: list[Rect]) -> list[Rect]:
        """Draw the labels of the rings on the right, or on the left where a box is in the way; return their
        places."""
        camera_m = np.array([mount.forward_m, mount.left_m])
        places = []
        for radius_m in self._radii_m().tolist():
            label = f"{radius_m:g} m"
            right_m = min(_RING_LABEL_SIN * radius_m, _RING_LABEL_RIGHT_RATIO * self._range_m)
            forward_m = math.sqrt(radius_m**2 - right_m**2)
            x, y = self.to_pixels(camera_m + np.array([[forward_m, -right_m], [forward_m, right_m]])).T
            width = text.width(label, 12)
            lefts = (round(x[0]), round(x[1]) - width)
            candidates = [Rect(left, round(y[0]) - 17, width, 16) for left in lefts]
            free = [place for place in candidates if not any(map(place.overlaps, boxes))]
            place = (free or candidates)[0]
            if not free:
                place.of(view)[:] = PANEL
            text.put(view, label, place.x, place.y + 12, FAINT_TEXT, 12)
            places.append(place)
        return places

    def _radii_m(self) -> FloatArray:
        spacing_m = _RING_M if self._range_m > _SHORT_RANGE_M else 0.5 * _RING_M
        return np.arange(spacing_m, self._range_m + 1e-6, spacing_m)

    def _draw_robot(self, view: Image, body: Body) -> None:
        half_m = 0.5 * body.width_m
        track_m = _TRACK_WIDTH_RATIO * body.width_m
        hull_m = draw.box((-body.rear_m, -half_m, body.front_m, half_m))
        draw.area(view, self.to_pixels(hull_m), BACKGROUND)
        for inner_m, outer_m in ((half_m - track_m, half_m), (track_m - half_m, -half_m)):
            draw.area(view, self.to_pixels(draw.box((-body.rear_m, inner_m, body.front_m, outer_m))), GRID)
        draw.line(view, self.to_pixels(hull_m), OWN, 2, closed=True)
        nose_m, size_m = 0.5 * (body.front_m - body.rear_m), 0.17 * body.width_m
        arrowhead_m = np.array(
            [[nose_m - size_m, size_m], [nose_m + size_m, 0.0], [nose_m - size_m, -size_m]]
        )
        draw.area(view, self.to_pixels(arrowhead_m), OWN)

    def _draw_camera(self, view: Image, mount: CameraMount) -> None:
        camera = self.to_pixels(np.array([mount.forward_m, mount.left_m]))
        draw.disc(view, camera, 3.5, OWN)

    def _draw_obstacle(self, view: Image, seen_obstacle: SeenObstacle) -> None:
        centre, corners = self.to_pixels(seen_obstacle.centre_m), self.to_pixels(seen_obstacle.corners_m)
        draw.tint(view, corners, seen_obstacle.colour, 0.45 if seen_obstacle.obstacle.moving else 0.25)
        if seen_obstacle.is_deciding:
            draw.line(view, corners, OWN, 6, closed=True)
        if seen_obstacle.predicted:
            draw.dashed(view, np.concatenate([corners, corners[:1]]), seen_obstacle.colour, 2, dash_px=4.0)
        else:
            draw.line(view, corners, seen_obstacle.colour, 2, closed=True)
        if seen_obstacle.obstacle.moving and np.isfinite(seen_obstacle.velocity_mps).all():
            self._draw_velocity(view, seen_obstacle, centre)

    def _draw_velocity(self, view: Image, seen_obstacle: SeenObstacle, centre: NDArray[np.float64]) -> None:
        tip = self.to_pixels(seen_obstacle.centre_m + _ARROW_S * seen_obstacle.velocity_mps)
        draw.arrow(view, centre, tip, seen_obstacle.colour)
        spread_m2 = _ARROW_S**2 * seen_obstacle.velocity_cov
        if np.isfinite(spread_m2).all() and np.trace(spread_m2) < _MAX_SIGMA_M**2:
            # From (forward, left) to (right, down): both axes are swapped and negated, so only their order
            # changes.
            draw.ellipse(view, tip, spread_m2[::-1, ::-1] * self._px_per_m**2, seen_obstacle.colour)

    def _label_box(self, seen_obstacle: SeenObstacle) -> FloatArray:
        corners = self.to_pixels(seen_obstacle.corners_m)
        return np.stack([corners.min(axis=0) - 2.0, corners.max(axis=0) + 2.0])


def _rect_around(box: FloatArray) -> Rect:
    (left, top), (right, bottom) = np.rint(box).astype(int).tolist()
    return Rect(left, top, right - left, bottom - top)


class _Scan:
    """The free-space scan as shapes on the floor of the body frame.

    free_m: (K, 2), polygon of the floor that was seen to be free; (0, 2) if there is none.
    surfaces_m: (S, 2, 2), one stroke for each band that ends at a surface within range.
    """

    def __init__(self, free: FreeSpace, mount: CameraMount, range_m: float) -> None:
        edges_tan = free.bearing_tan[:, np.newaxis] + free.half_width_tan * np.array([-1.0, 1.0])
        camera_m = np.array([mount.forward_m, mount.left_m])
        seen_m = np.minimum(np.nan_to_num(np.minimum(free.nearest_m, free.known_m), nan=0.0), range_m)
        far_m = camera_m + _forward_left(seen_m, edges_tan)
        self.free_m = (
            np.concatenate([camera_m[np.newaxis], far_m.reshape(-1, 2)]) if len(seen_m) else far_m[:, 0]
        )
        has_surface = np.isfinite(free.nearest_m) & (free.nearest_m <= range_m)
        self.surfaces_m = camera_m + _forward_left(free.nearest_m[has_surface], edges_tan[has_surface])


def _forward_left(forward_m: FloatArray, bearings_tan: FloatArray) -> FloatArray:
    """Points (N, 2, 2), forward and left, for forward distances (N,) and bearings (N, 2), positive to the
    right."""
    forward = np.broadcast_to(forward_m[:, np.newaxis], bearings_tan.shape)
    return np.stack([forward, -forward * bearings_tan], axis=-1)
