"""Parts of the simulated robot that its own camera sees (`simulation.own_parts`), drawn over the picture.

They move with the camera, so they are drawn once, and put in front of whatever is farther in each picture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from config.own_parts import OwnPart
from hal.box_view import BoxView, box_view
from hal.types import CameraMount, ColourImage, Intrinsics
from sim.rendering.raster import Float32Image
from sim.rendering.render import Picture

_STRIPE_M = 0.08  # width of the stripes: a bumper has marks, which a detector of edges finds
_LIGHT, _DARK = (40, 190, 240), (45, 45, 50)  # BGR: yellow and black, as bumpers are painted
_BRIGHTNESS = (0.75, 0.6, 1.0)  # of the faces across x, y and z: the top is the brightest


class OwnPartsPainter:
    """Draws the parts into the pictures of one camera."""

    def __init__(self, parts: Sequence[OwnPart], mount: CameraMount, camera: Intrinsics) -> None:
        shape = (camera.height, camera.width)
        self._inverse: Float32Image = np.zeros(shape, np.float32)
        self._colour: ColourImage = np.zeros((*shape, 3), np.uint8)
        for part in parts:
            view = box_view(part, mount, camera)
            inverse = np.divide(1.0, view.enter_m, out=np.zeros(shape, np.float32), where=view.seen)
            nearer = inverse > self._inverse
            self._inverse[nearer] = inverse[nearer]
            self._colour[nearer] = _paint(view, camera)[nearer]

    def draw(self, picture: Picture) -> None:
        """Put the parts before what is farther, in the arrays of picture."""
        shown = self._inverse > picture.inverse_depth
        picture.inverse_depth[shown] = self._inverse[shown]
        picture.colour[shown] = self._colour[shown]
        picture.labels[shown] = 0  # no body of the world


def _paint(view: BoxView, camera: Intrinsics) -> ColourImage:
    """(H, W, 3) striped faces: across the image where they are seen, whichever way they face."""
    across_m = (np.arange(camera.width) - camera.cx) / camera.fx * view.enter_m
    light = np.floor(across_m / _STRIPE_M).astype(np.intp) % 2 == 0
    paint = np.where(light[:, :, None], np.array(_LIGHT), np.array(_DARK))
    shaded: ColourImage = (paint * np.array(_BRIGHTNESS)[view.axis][:, :, None]).astype(np.uint8)
    return shaded
