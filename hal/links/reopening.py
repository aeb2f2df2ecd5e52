"""A device that may go and come back: opened by ``with`` or by the first use, and anew after it was lost."""

from __future__ import annotations

import logging
import threading
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Generic, Self, TypeVar

from hal.errors import HalError, LinkLost

DeviceT = TypeVar("DeviceT")

_log = logging.getLogger(__name__)


class ReopeningLink(ABC, Generic[DeviceT]):
    """A link whose next use after LinkLost opens the device again, so that a re-plugged adapter is found.

    The user of the link decides how often that is tried.
    where: how messages name the device. close_errors: what closing a lost device may raise.
    slow: opening and closing may take long, above all over a network. Then a thread of its own closes the
    lost device and opens it again, in this order: a late message of the old one would else reach the new one.
    Meanwhile every use raises LinkLost; ``with`` waits.
    """

    def __init__(self, where: str, close_errors: tuple[type[Exception], ...], slow: bool = False) -> None:
        self._where = where
        self._close_errors = close_errors
        self._slow = slow
        self._device: DeviceT | None = None
        self._opening: _OpenAttempt[DeviceT] | None = None
        self._last_failure = f"{where}: is being opened"
        self._closed = False

    def __enter__(self) -> Self:
        """Open the device. Raises DeviceNotFound, DeviceRefused."""
        self._closed = False
        if self._opening is not None:
            self._opening.abandon()
            self._opening.wait()
            self._opening = None
        if self._device is None:
            self._device = self._open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closed = True
        if self._opening is not None:
            self._opening.abandon()
        device, self._device = self._device, None
        if device is not None:
            self._close_quietly(device)

    @abstractmethod
    def _open(self) -> DeviceT:
        """The open device. Raises DeviceNotFound, DeviceRefused."""

    @abstractmethod
    def _close(self, device: DeviceT) -> None:
        """Close it."""

    def _close_lost(self, device: DeviceT) -> None:
        """Close one that was lost."""
        self._close(device)

    def _remedy(self, error: Exception) -> str:
        """What to do about a device that worked until this error."""
        return "check the adapter, the cable and the power of the base"

    def _require_open(self) -> DeviceT:
        if self._closed:
            raise LinkLost(f"{self._where}: the link is closed")
        if self._device is None:
            try:
                self._device = self._open_in_background() if self._slow else self._open()
            except HalError as error:
                self._last_failure = str(error)
                raise LinkLost(self._last_failure) from error
        return self._device

    def _open_in_background(self) -> DeviceT:
        """Raises LinkLost while it is being opened, with what went wrong last."""
        if self._opening is None:
            self._opening = _OpenAttempt(self)
        if not self._opening.done:
            raise LinkLost(self._last_failure)
        opening, self._opening = self._opening, None
        return opening.device()

    def _mark_lost(self, action: str, error: Exception) -> LinkLost:
        device, self._device = self._device, None
        if device is not None and self._slow:
            self._opening = _OpenAttempt(self, device)
        elif device is not None:
            self._close_quietly(device, lost=True)
        self._last_failure = f"{self._where}: lost while {action} ({reason(error)}); {self._remedy(error)}"
        return LinkLost(self._last_failure)

    def _close_quietly(self, device: DeviceT, lost: bool = False) -> None:
        try:
            if lost:
                self._close_lost(device)
            else:
                self._close(device)
        except self._close_errors as error:
            # It is gone anyway; python-can raises here after an unplug.
            _log.debug("closing %s: %s", self._where, error)


class _OpenAttempt(Generic[DeviceT]):
    """One attempt to open a link's device, in a thread that nobody waits for. lost: is closed before."""

    def __init__(self, link: ReopeningLink[DeviceT], lost: DeviceT | None = None) -> None:
        self._link = link
        self._lost_device = lost
        self._lock = threading.Lock()
        self._wanted = True
        self._device: DeviceT | None = None
        self._error: HalError | None = None
        self.done = False
        self._thread = threading.Thread(target=self._run, name=f"reopen {link._where}", daemon=True)
        self._thread.start()

    def device(self) -> DeviceT:
        """What was opened, once done. Raises what opening raised."""
        if self._device is None:
            raise self._error or LinkLost(f"{self._link._where}: could not be opened")
        return self._device

    def abandon(self) -> None:
        """Nobody wants it any more: closed now, or as soon as it is open."""
        with self._lock:
            self._wanted = False
            device, self._device = self._device, None
        if device is not None:
            self._link._close_quietly(device)

    def wait(self) -> None:
        """Until nothing is opened or closed by it any more."""
        self._thread.join()

    def _run(self) -> None:
        device = None
        try:
            lost, self._lost_device = self._lost_device, None
            if lost is not None:
                self._link._close_quietly(lost, lost=True)
            if self._wanted:
                device = self._link._open()
        except HalError as error:
            self._error = error
        finally:
            # The lock settles who closes a device that is abandoned right now: this thread, or the caller.
            with self._lock:
                if self._wanted:
                    self._device, device = device, None
                self.done = True
        if device is not None:
            self._link._close_quietly(device)


def reason(error: BaseException) -> str:
    """The innermost cause in one line: libraries wrap the telling error in general ones."""
    while error.__cause__ is not None:
        error = error.__cause__
    return " ".join(str(error).split()) or type(error).__name__
