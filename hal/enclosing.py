"""Base class of wrappers: opens and closes the device that is wrapped."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from hal.api import Closing


class Enclosing:
    """A device that is open while the enclosed device is open."""

    def __init__(self, enclosed: Closing) -> None:
        self._enclosed = enclosed

    def __enter__(self) -> Self:
        """Open the enclosed device. Raises DeviceNotFound, DeviceRefused."""
        self._enclosed.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._enclosed.__exit__(kind, error, trace)
