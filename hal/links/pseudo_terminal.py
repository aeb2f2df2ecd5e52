"""The device's end of a pseudo-terminal: an emulator uses it here, an ordinary serial driver opens ``path``.

A pseudo-terminal ignores the baud rate: bytes arrive at once.
"""

from __future__ import annotations

import os
import tty
from types import TracebackType
from typing import Self

from hal.errors import LinkLost

_MAX_READ = 4096


class PseudoTerminal:
    """hal.api.SerialLink whose other end is a port that any program can open by its path."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        # Raw, or the terminal would echo and translate bytes until somebody opens the port.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._path = os.ttyname(self._slave)
        self._open = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()

    @property
    def path(self) -> str:
        """The port for the other program."""
        return self._path

    def unplug(self) -> None:
        """Make the device vanish for good: every program that has the port open gets an error."""
        if self._open:
            self._open = False
            os.close(self._slave)
            os.close(self._master)

    def write(self, data: bytes) -> None:
        """See hal.api.SerialLink. Raises LinkLost when unplugged, or when nobody has read the last 4 kB."""
        self._check()
        try:
            written = os.write(self._master, data)
        except OSError as error:
            raise LinkLost(f"pseudo-terminal {self._path}: cannot write ({error.strerror})") from error
        if written != len(data):
            raise LinkLost(f"pseudo-terminal {self._path}: no program reads at the other end")

    def read(self) -> bytes:
        """See hal.api.SerialLink. Raises LinkLost when unplugged."""
        self._check()
        try:
            return os.read(self._master, _MAX_READ)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkLost(f"pseudo-terminal {self._path}: cannot read ({error.strerror})") from error

    def _check(self) -> None:
        if not self._open:
            raise LinkLost(f"pseudo-terminal {self._path}: unplugged")
