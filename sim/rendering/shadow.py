"""Soft shadows on the floor under everything that stands on it; without them, bodies seem to float."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from config.scenario import Light
from hal.types import FloatArray, Intrinsics, Pose
from sim.rendering.raster import Drawn, LabelImage, pixel_to_ray, texture_frames
from sim.rendering.spans import convert
from sim.world import BUILDING_ID, BodyState, Geometry

_MARGIN_M = 0.6  # half width of the penumbra of a large lamp: to either side of the footprint's edge
_MAX_DARKENING = 0.6  # share of the light that is lost right below a body
_MAX_UNDERSIDE_M = 0.5  # bodies that hang higher than this cast no distinct shadow
_MAX_DISTANCE_M = 12.0  # shadows further away than this are left out
_SIDE_PX = 64  # of the shadow's image, which has no sharp edges
_RIM = 0.3  # share of the shadow's image that lies outside the footprint, on each side


class ShadowCaster:
    """Darkens the floor in an image (H, W, 4), before its edges are smoothed."""

    def __init__(self, intrinsics: Intrinsics, light: Light) -> None:
        self._intrinsics = intrinsics
        azimuth = math.radians(light.azimuth_deg)
        # Away from the light.
        self._drift = -0.06 * np.array([math.cos(azimuth), math.sin(azimuth)])
        self._patch_image = _soft_patch()
        self._still: dict[int, FloatArray] = {}

    def cast(
        self,
        colour: NDArray[np.uint8],
        labels: LabelImage,
        drawn: Drawn,
        geometry: Geometry,
        bodies: tuple[BodyState, ...],
        camera: Pose,
    ) -> None:
        """Multiply colour by the shadows of bodies, where labels show the floor."""
        near = self._near(bodies, camera)
        if not near:
            return
        corners = np.array([self._cached_patch(state) for state in near])
        corners = (corners - camera.translation_m) @ camera.rotation
        bounds = convert(corners, self._intrinsics).bounds
        to_patch = (
            np.diag([_SIDE_PX, _SIDE_PX, 1.0])
            @ np.linalg.inv(texture_frames(corners))
            @ pixel_to_ray(self._intrinsics)
        )
        on_floor = _floor_faces(drawn, geometry)
        for (u0, v0, u1, v1), matrix in zip(bounds.tolist(), to_patch, strict=True):
            if u1 <= u0:
                continue
            floor = on_floor[labels[v0:v1, u0:u1]]
            matrix[:, 2] += matrix[:, 0] * u0 + matrix[:, 1] * v0
            shade = cv2.warpPerspective(
                self._patch_image, matrix, (u1 - u0, v1 - v0), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT, borderValue=(255, 255, 255, 255),
            )  # fmt: skip
            lit = colour[v0:v1, u0:u1]
            cv2.copyTo(cv2.multiply(lit, shade, scale=1.0 / 255.0), floor, lit)

    def _near(self, bodies: tuple[BodyState, ...], camera: Pose) -> list[BodyState]:
        """The bodies whose shadow may be visible."""
        low = [state for state in bodies if state.z_m[0] < _MAX_UNDERSIDE_M]
        places = np.array([(state.pose.x_m, state.pose.y_m) for state in low]).reshape(-1, 2)
        reaches = np.array([state.reach_m for state in low]) + _MARGIN_M
        ahead = (places - camera.translation_m[:2]) @ camera.rotation[:2, 2]
        return [
            low[k] for k in np.flatnonzero((ahead > -reaches) & (ahead < _MAX_DISTANCE_M + reaches)).tolist()
        ]

    def _cached_patch(self, state: BodyState) -> FloatArray:
        """As _patch, but cached for bodies that never move."""
        if state.moves:
            return self._patch(state)
        patch = self._still.get(state.id)
        if patch is None:
            patch = self._still[state.id] = self._patch(state)
        return patch

    def _patch(self, state: BodyState) -> FloatArray:
        """The shadow's rectangle (4, 3) on the floor: rear left, front left, front right, rear right corner
        of the body."""
        c, s = math.cos(state.pose.heading_rad), math.sin(state.pose.heading_rad)
        turn = np.array([[c, -s], [s, c]])
        outline = (state.footprint_m - np.array([state.pose.x_m, state.pose.y_m])) @ turn
        low, high = outline.min(axis=0), outline.max(axis=0)
        # The blurred rim is at most _MARGIN_M wide on each side, whatever the size of the body.
        grow = np.minimum(_MARGIN_M, _RIM / (1.0 - 2.0 * _RIM) * (high - low))
        low, high = low - grow, high + grow
        corners = np.array([[low[0], high[1]], [high[0], high[1]], [high[0], low[1]], [low[0], low[1]]])
        placed = corners @ turn.T + np.array([state.pose.x_m, state.pose.y_m]) + self._drift
        return np.column_stack([placed, np.zeros(4)])


def _floor_faces(drawn: Drawn, geometry: Geometry) -> NDArray[np.uint8]:
    """For each label: 255 if it is the floor or a marking on it, else 0."""
    face = drawn.face
    floor = (geometry.body[face] == BUILDING_ID) & (geometry.normals[face, 2] > 0.99)
    return np.concatenate([[False], floor]).astype(np.uint8) * np.uint8(255)


def _soft_patch() -> NDArray[np.uint8]:
    """The share of light that remains (H, W, 4), 255 for all: dark in the middle, all of it at the border."""
    dark = np.zeros((_SIDE_PX, _SIDE_PX), np.float32)
    rim = round(_RIM * _SIDE_PX)
    dark[rim:-rim, rim:-rim] = 1.0
    soft = np.asarray(cv2.GaussianBlur(dark, (0, 0), 0.5 * rim, borderType=cv2.BORDER_CONSTANT))
    soft = np.maximum(soft - soft[0].max(), 0.0)
    left = 255.0 * (1.0 - _MAX_DARKENING * soft / soft.max())
    return np.repeat(np.rint(left).astype(np.uint8)[:, :, None], 4, axis=2)
