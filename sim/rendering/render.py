"""The simulated camera's noiseless picture of a world: colour, exact inverse depth, and the face at each
pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from hal.types import ColourImage, FloatArray, Intrinsics, Pose
from sim.models.textures import TextureStore
from sim.rendering.antialias import smooth_edges
from sim.rendering.raster import Drawn, Float32Image, LabelImage, Rasteriser
from sim.rendering.shade import Painter
from sim.rendering.shadow import ShadowCaster
from sim.world import Geometry, World


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What one exposure sees. The arrays belong to the renderer: the next render overwrites them.

    t_s: time of the world.
    camera: pose of the optical frame in the floor's frame.
    colour: (H, W, 3) uint8 BGR, without noise.
    inverse_depth: (H, W) float32 in 1/m, exact; 0 where there is nothing.
    labels: (H, W) uint16, 0 for nothing, k + 1 for the k-th face of drawn.
    drawn: the faces that reach the image.
    geometry: all faces at t_s.
    """

    t_s: float
    camera: Pose
    colour: ColourImage
    inverse_depth: Float32Image
    labels: LabelImage
    drawn: Drawn
    geometry: Geometry

    def depth_m(self) -> FloatArray:
        """(H, W) exact depth along the optical axis in metres; inf where there is nothing."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.inverse_depth.astype(np.float64)

    def instance_mask(self) -> LabelImage:
        """(H, W) uint16: the id of the body at each pixel (sim.world.BUILDING_ID for the building)."""
        owner = np.concatenate([[0], self.geometry.body[self.drawn.face]]).astype(np.uint16)
        return owner[self.labels]


class Renderer:
    """Draws one world through one pinhole camera; keeps textures and buffers between pictures."""

    def __init__(self, world: World, intrinsics: Intrinsics) -> None:
        self.world = world
        self.intrinsics = intrinsics
        shape = (intrinsics.height, intrinsics.width)
        self._raster = Rasteriser(intrinsics)
        self._painter = Painter(shape, TextureStore(world.seed), world.textures)
        self._shadows = ShadowCaster(intrinsics, world.scenario.light)
        self._colour: ColourImage = np.zeros((*shape, 3), np.uint8)

    def render(self, t_s: float, camera: Pose) -> Picture:
        """Draw the world at t_s as seen from camera (pose of the optical frame in the floor's frame)."""
        geometry = self.world.geometry(t_s)
        drawn = self._raster.draw(geometry, camera)
        labels, inverse_depth = self._raster.labels, self._raster.inverse_depth
        self._painter.paint(labels, drawn, geometry, self.world.scenario.light)
        bodies = self.world.bodies(t_s)
        self._shadows.cast(self._painter.colour, labels, drawn, geometry, bodies, camera)
        smooth_edges(self._painter.colour, labels, inverse_depth, drawn)
        cv2.cvtColor(self._painter.colour, cv2.COLOR_BGRA2BGR, dst=self._colour)
        return Picture(t_s, camera, self._colour, inverse_depth, labels, drawn, geometry)
