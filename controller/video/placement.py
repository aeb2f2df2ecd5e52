"""Places a camera image in a panel: complete, centred, and as large as possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.video.style import Rect


@dataclass(frozen=True, slots=True)
class Placement:
    """Position of an image in its panel: place, in pixels of the panel, and the scale."""

    place: Rect
    scale: float

    def to_panel(self, points_px: NDArray[np.floating]) -> NDArray[np.float64]:
        """Transform image points (..., 2) to the panel; integer coordinates are pixel centres."""
        return (np.asarray(points_px, np.float64) + 0.5) * self.scale - 0.5 + (self.place.x, self.place.y)


def placement(image_width: int, image_height: int, panel: Rect) -> Placement:
    """The largest placement that fits."""
    scale = min(panel.width / image_width, panel.height / image_height)
    width = min(panel.width, max(1, round(image_width * scale)))
    height = min(panel.height, max(1, round(image_height * scale)))
    return Placement(Rect((panel.width - width) // 2, (panel.height - height) // 2, width, height), scale)
