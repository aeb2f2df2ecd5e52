"""Refuses parts of the robot (`camera.own_parts`) that its camera does not see, or that hide too much."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.loader import ConfigError
from config.own_parts import OwnPart
from hal.box_view import box_view
from hal.types import CameraMount, Intrinsics

_MOST_HIDDEN = 0.5  # of the image: a camera that sees more of the robot than of its way is no use


def require_own_parts_in_view(
    file: Path, parts: Sequence[OwnPart], mount: CameraMount, camera: Intrinsics
) -> None:
    """Raises ConfigError if a part is nowhere in the image of camera, or if more than half of it is hidden.

    file: with the parts, for the message.
    """
    hidden = np.zeros((camera.height, camera.width), np.bool_)
    for part in parts:
        seen = box_view(part, mount, camera).seen
        if not seen.any():
            raise ConfigError(
                f"{file}: camera.own_parts ({part.name!r}): this box is nowhere in the camera's view; leave "
                "it out, or correct it or robot.camera_mount"
            )
        hidden |= seen
    share = np.count_nonzero(hidden) / hidden.size
    if share > _MOST_HIDDEN:
        raise ConfigError(
            f"{file}: camera.own_parts: the boxes hide {share:.0%} of the image, and at most "
            f"{_MOST_HIDDEN:.0%} may be hidden; correct them, or mount the camera where it sees less"
        )
