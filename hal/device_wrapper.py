"""Base class of wrappers: opens and closes the device that is wrapped."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from hal.api import Device


class DeviceWrapper:
    """A device that is open while the wrapped device is open."""

    def __init__(self, wrapped: Device) -> None:
        self._wrapped = wrapped

    def __enter__(self) -> Self:
        """Open the wrapped device. Raises DeviceNotFound, DeviceRefused."""
        self._wrapped.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._wrapped.__exit__(kind, error, trace)
