"""The depth of a frame as the detector uses it: without the robot itself, and as a grid over the floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from config.own_parts import OwnPart
from config.perception import PerceptionConfig
from hal.types import CameraMount, RgbdFrame
from vision.camera.floor import FloorFinder, on_floor
from vision.camera.mount_check import MountCheck
from vision.camera.own_parts import Mask, OwnParts
from vision.camera.own_parts_check import OwnPartsCheck
from vision.depth.depth_grid import DepthGrid, make_grid
from vision.scene import CameraHealth, SeenFloor


class SeenDepth:
    """Call take() once a frame, then judge(); on_own() and near_own are of the last frame."""

    def __init__(
        self, config: PerceptionConfig, mount: CameraMount | None, own_parts: Sequence[OwnPart]
    ) -> None:
        """own_parts: parts of the robot in view; they need a mounting."""
        self._config, self._mount = config, mount
        self._finder = FloorFinder()
        self._mount_check, self._own_check = MountCheck(), OwnPartsCheck()
        self._own: OwnParts | None = None
        if own_parts:
            assert mount is not None, "without a mounting it is not known where the own parts are"
            self._own = OwnParts(own_parts, mount, config)

    @property
    def floor(self) -> SeenFloor | None:
        """The newest look of the check of the mounting; None before the first, or without a mounting."""
        return self._mount_check.floor

    @property
    def near_own(self) -> Mask | None:
        """(H, W) 255 on own parts and close around them, else 0; None: there are none."""
        return None if self._own is None else self._own.near

    def take(self, frame: RgbdFrame) -> tuple[RgbdFrame, DepthGrid]:
        """frame without the depth of own parts, and its depth grid."""
        if self._own is not None:
            frame = self._own.without(frame)
        grid = make_grid(frame, self._config, self._mount)
        if self._own is not None:
            return frame, self._own.mark(grid)
        if self._mount is None:
            floor = self._finder.find(grid)
            if floor is not None:
                return frame, on_floor(grid, floor, self._config.depth_noise)
        return frame, grid

    def judge(self, grid: DepthGrid, captured_ns: int, health: CameraHealth) -> CameraHealth:
        """health, degraded if the mounting or the own parts are not where the configuration has them."""
        if self._mount is not None:
            health = self._mount_check.judge(grid, captured_ns, health)
        if self._own is not None:
            health = self._own_check.judge(grid, self._own.names, self._own.cores, captured_ns, health)
        return health

    def on_own(self, ends_px: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) fragments, by their ends_px (N, 2, 2), of which an end is on an own part."""
        return np.zeros(len(ends_px), np.bool_) if self._own is None else self._own.under(ends_px)
