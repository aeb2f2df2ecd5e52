"""Exact ground truth of a picture: bodies with their positions and velocities, and the optical flow."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from sim.rendering.raster import Rasteriser, texture_frames
from sim.rendering.render import Picture
from sim.rendering.spans import NEAR_M
from sim.world import BodyState, Geometry, World


@dataclass(frozen=True, slots=True, eq=False)
class BodyTruth:
    """A body in the image, in the optical frame (x right, y down, z forward).

    bbox_px: (u0, v0, u1, v1) around its visible pixels, u1 and v1 exclusive.
    visible_px: number of its visible pixels.
    visible_ratio: visible_px, divided by the number if nothing occluded the body.
    position_m: (3,), mean of its visible surface points.
    velocity_mps: (3,), relative to the floor.
    """

    state: BodyState
    bbox_px: tuple[int, int, int, int]
    visible_px: int
    visible_ratio: float
    position_m: FloatArray
    velocity_mps: FloatArray


class GroundTruth:
    """The ground truth of pictures of one world through one camera. For evaluation; not optimised for
    speed."""

    def __init__(self, world: World, intrinsics: Intrinsics) -> None:
        self._world = world
        self._intrinsics = intrinsics
        self._single_body = Rasteriser(intrinsics)

    def bodies(self, picture: Picture, only: Collection[int] | None = None) -> tuple[BodyTruth, ...]:
        """Every body with at least one visible pixel, in the order of their ids.

        only: restrict the result to the bodies with these ids, which takes a fraction of the time.
        """
        mask = picture.instance_mask()
        points = self._points(picture)
        found = []
        for state in self._world.bodies(picture.t_s):
            if only is not None and state.id not in only:
                continue
            v, u = np.nonzero(mask == state.id)
            if len(u) == 0:
                continue
            velocity = np.array([state.velocity_mps[0], state.velocity_mps[1], 0.0])
            surface = points[v, u]
            found.append(
                BodyTruth(
                    state=state,
                    bbox_px=(int(u.min()), int(v.min()), int(u.max()) + 1, int(v.max()) + 1),
                    visible_px=len(u),
                    visible_ratio=len(u) / self._unoccluded_pixels(picture, state.id),
                    position_m=surface.mean(axis=0),
                    velocity_mps=velocity @ picture.camera.rotation,
                )
            )
        return tuple(found)

    def flow(self, picture: Picture, t_s: float, camera: Pose) -> NDArray[np.float32]:
        """The optical flow to another exposure: (H, W, 2) float32, (du, dv).

        It follows the surface point of each pixel, with the motion of the robot, of bodies and of limbs, even
        if the point is occluded in the other exposure. NaN where there is no surface, or where the point is
        behind the other camera.
        """
        k = self._intrinsics
        project = np.array([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]])
        corners = self._world.geometry(t_s).corners_m[picture.drawn.face]
        corners = (corners - camera.translation_m) @ camera.rotation
        homographies = project @ texture_frames(corners) @ picture.drawn.to_plane
        flow = np.full((k.height, k.width, 2), np.nan, np.float32)
        for number, (u0, v0, u1, v1) in enumerate(picture.drawn.bounds.tolist()):
            v, u = np.nonzero(picture.labels[v0:v1, u0:u1] == number + 1)
            pixels = np.stack([u + u0, v + v0, np.ones(len(u))])
            projected = homographies[number] @ pixels
            # projected[2] is z in the other camera, divided by z in this one.
            ratio = np.where(
                projected[2] / (picture.drawn.to_plane[number, 2] @ pixels) > NEAR_M, projected[2], np.nan
            )
            flow[v + v0, u + u0] = (projected[:2] / ratio - pixels[:2]).T
        return flow

    def _points(self, picture: Picture) -> FloatArray:
        """Surface points (H, W, 3) in the optical frame."""
        k = self._intrinsics
        z = picture.depth_m()
        v, u = np.mgrid[0 : k.height, 0 : k.width]
        return np.stack([(u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z], axis=2)

    def _unoccluded_pixels(self, picture: Picture, body_id: int) -> int:
        full = picture.geometry
        selected = full.body == body_id
        only = Geometry(
            full.corners_m[selected],
            full.normals[selected],
            full.windows[selected],
            full.texture[selected],
            full.body[selected],
        )
        self._single_body.draw(only, picture.camera)
        return int(np.count_nonzero(self._single_body.labels))
