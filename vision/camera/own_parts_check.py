"""Check of the configured own parts: does the robot really have them where `camera.own_parts` says?

A box that is too large or in the wrong place takes nothing away that is farther than its far side, so it
does no harm beyond the outline, but it does not help either. So whoever measured it is told. seen_depth.py
calls it in each frame of a camera with own parts, next to the check of the mounting.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vision.camera.health import worsened
from vision.depth.depth_grid import DepthGrid
from vision.scene import CameraCondition, CameraHealth

# Share of the cells of a part that may show something farther. Parts do not fill their boxes.
_MOST_FARTHER = 0.3
# For so long without a break: what moves by, and vibrates, does not.
_FOR_NS = 5_000_000_000


class OwnPartsCheck:
    """Call judge() once a frame."""

    def __init__(self) -> None:
        self._since_ns: dict[int, int] = {}

    def judge(
        self,
        grid: DepthGrid,
        names: Sequence[str],
        cores: Sequence[NDArray[np.intp]],
        captured_ns: int,
        health: CameraHealth,
    ) -> CameraHealth:
        """health, degraded if a part is not where its box is.

        cores: of each part, flat cells of the grid that should show it. In them only what is farther than the
        part has depth.
        """
        farther = (grid.valid | grid.beyond).ravel()
        for number, (name, core) in enumerate(zip(names, cores, strict=True)):
            share = np.count_nonzero(farther[core]) / max(len(core), 1)
            if share <= _MOST_FARTHER:
                self._since_ns.pop(number, None)
                continue
            since_ns = self._since_ns.setdefault(number, captured_ns)
            if captured_ns < since_ns:  # time has stepped back
                self._since_ns[number] = captured_ns
            elif captured_ns - since_ns >= _FOR_NS:
                health = worsened(health, CameraCondition.DEGRADED, _sentence(name, share))
        return health


def _sentence(name: str, share: float) -> str:
    return (
        f"{share:.0%} of where camera.own_parts has {name!r} shows something farther: are its box and the "
        "camera's mounting right?"
    )
