"""What the camera of fake_realsense.py sends: pairs of frames, and samples of the gyro."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, FPS = 848, 480, 30
PERIOD_MS = 1000.0 / FPS


class FakeFrame:
    """A video frame; falsy if it is not there, as in the original."""

    def __init__(self, data: NDArray[np.generic] | None, number: int = 0, device_ms: float = 0.0) -> None:
        self._data = data
        self._number = number
        self._device_ms = device_ms

    def __bool__(self) -> bool:
        return self._data is not None

    def get_data(self) -> NDArray[np.generic]:
        assert self._data is not None
        return self._data

    def get_frame_number(self) -> int:
        return self._number

    def get_timestamp(self) -> float:
        return self._device_ms


@dataclass
class FakeFrameset:
    colour: FakeFrame
    depth: FakeFrame
    arrival_ms: float

    def get_color_frame(self) -> FakeFrame:
        return self.colour

    def get_depth_frame(self) -> FakeFrame:
        return self.depth


@dataclass
class FakeGyro:
    device_ms: float
    rate_radps: tuple[float, float, float]

    def as_motion_frame(self) -> FakeGyro:
        return self

    def get_motion_data(self) -> SimpleNamespace:
        x, y, z = self.rate_radps
        return SimpleNamespace(x=x, y=y, z=z)

    def get_timestamp(self) -> float:
        return self.device_ms


def frameset(
    number: int,
    *,
    arrival_ms: float | None = None,
    device_ms: float | None = None,
    colour: bool = True,
    depth: bool = True,
    depth_number: int | None = None,
    depth_device_ms: float | None = None,
) -> FakeFrameset:
    """The pair of frames number ``number``; by default it arrives 20 ms after the device stamped it."""
    stamp_ms = number * PERIOD_MS if device_ms is None else device_ms
    depth_stamp_ms = stamp_ms if depth_device_ms is None else depth_device_ms
    colour_data = np.full((HEIGHT, WIDTH, 3), number % 256, np.uint8) if colour else None
    depth_data = np.full((HEIGHT, WIDTH), 1000 + number, np.uint16) if depth else None
    return FakeFrameset(
        FakeFrame(colour_data, number, stamp_ms),
        FakeFrame(depth_data, number if depth_number is None else depth_number, depth_stamp_ms),
        stamp_ms + 20.0 if arrival_ms is None else arrival_ms,
    )


def framesets(first: int, count: int) -> Iterator[FakeFrameset]:
    return (frameset(number) for number in range(first, first + count))
