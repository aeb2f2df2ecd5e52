"""A simulated camera with the faults of its scenario: no frames, frozen frames, glass without depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.faults import Faults
from hal.clocks import NS_PER_S
from hal.device_wrapper import DeviceWrapper
from hal.errors import FrameTimeout
from hal.types import Intrinsics, RgbdFrame
from sim.rendering.camera import SimulatedCamera


class FaultyCamera(DeviceWrapper):
    """A FrameSource. Faults happen before perception gets the frame, as they would in reality.

    glass_ids: values of the glass bodies in instance masks.
    """

    def __init__(self, camera: SimulatedCamera, faults: Faults, glass_ids: tuple[int, ...]) -> None:
        super().__init__(camera)
        self._camera, self._faults, self._glass_ids = camera, faults, glass_ids
        self._last: RgbdFrame | None = None

    @property
    def intrinsics(self) -> Intrinsics:
        """The pinhole camera of both images."""
        return self._camera.intrinsics

    @property
    def next_capture_ns(self) -> int:
        """The time of the next frame that is not lost."""
        while self._faults.is_silent(self._world_s(self._camera.next_capture_ns)):
            self._camera.lose_frame()
        return self._camera.next_capture_ns

    def read(self, timeout_s: float) -> RgbdFrame:
        """The next frame that is not lost, with faults. Raises FrameTimeout, DeviceRefused once closed."""
        _ = self.next_capture_ns
        frame = self._camera.read(timeout_s)
        t_s = self._world_s(frame.captured_ns)
        if self._faults.is_silent(t_s):  # frames were skipped, up to this one
            raise FrameTimeout("simulated camera: sends no frames for now")
        if self._last is not None and self._faults.is_frozen(t_s):
            frame = replace(frame, colour=self._last.colour, depth=self._last.depth)
        elif self._glass_ids:
            frame = self._without_glass_depth(frame)
        self._last = frame
        return frame

    def _world_s(self, stamp_ns: int) -> float:
        return (stamp_ns - self._camera.start_ns) / NS_PER_S

    def _without_glass_depth(self, frame: RgbdFrame) -> RgbdFrame:
        """The frame without depth on glass."""
        picture = self._camera.last_picture
        assert picture is not None, "a frame that was read has a picture behind it"
        glass = np.isin(picture.instance_mask(), self._glass_ids)
        return replace(frame, depth=np.where(glass, np.uint16(0), frame.depth))
