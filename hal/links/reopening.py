"""A device that may go and come back: opened by ``with`` or by the first use, and anew after it was lost."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Generic, Self, TypeVar

from hal.errors import HalError, LinkLost

DeviceT = TypeVar("DeviceT")

_log = logging.getLogger(__name__)


class ReopeningLink(ABC, Generic[DeviceT]):
    """After LinkLost the next use opens the device anew, so that a re-plugged adapter is found again; whoever
    uses the link decides how often. where: how messages name it. gone: what closing a lost device may raise.
    """

    def __init__(self, where: str, gone: tuple[type[Exception], ...]) -> None:
        self._where = where
        self._gone = gone
        self._device: DeviceT | None = None
        self._closed = False

    def __enter__(self) -> Self:
        """Open the device. Raises DeviceNotFound, DeviceRefused."""
        self._closed = False
        if self._device is None:
            self._device = self._open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closed = True
        self._shut()

    @abstractmethod
    def _open(self) -> DeviceT:
        """The open device. Raises DeviceNotFound, DeviceRefused."""

    @abstractmethod
    def _close(self, device: DeviceT) -> None:
        """Close it."""

    def _remedy(self, error: Exception) -> str:
        """What to do about a device that worked until this error."""
        return "check the adapter, the cable and the power of the base"

    def _opened(self) -> DeviceT:
        if self._closed:
            raise LinkLost(f"{self._where}: the link is closed")
        if self._device is None:
            try:
                self._device = self._open()
            except HalError as error:
                raise LinkLost(str(error)) from error
        return self._device

    def _lost(self, doing: str, error: Exception) -> LinkLost:
        self._shut()
        return LinkLost(f"{self._where}: lost while {doing} ({reason(error)}); {self._remedy(error)}")

    def _shut(self) -> None:
        device, self._device = self._device, None
        if device is None:
            return
        try:
            self._close(device)
        except self._gone as error:
            # It is gone anyway; python-can raises here after an unplug.
            _log.debug("closing %s: %s", self._where, error)


def reason(error: BaseException) -> str:
    """The innermost cause in one line: libraries wrap the telling error in general ones."""
    while error.__cause__ is not None:
        error = error.__cause__
    return " ".join(str(error).split()) or type(error).__name__
