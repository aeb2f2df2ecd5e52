"""Isolates the outputs of a real-time drive: the failure of one affects neither the others nor the drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TypeVar

from controller.errors import UserError, describe
from hal.errors import HalError

Output = TypeVar("Output")


class OutputIsolation:
    """Handles a failure to write.

    cut_off: called once for each output that fails, with the reason. Nothing more is written to that output,
    and everything else goes on. None: the failure ends the run, as in simulations and replays.
    """

    def __init__(self, cut_off: Callable[[str], None] | None = None) -> None:
        self._cut_off = cut_off
        # The outputs themselves, so that none that is opened later can be taken for one of them.
        self._ended: list[object] = []

    def is_active(self, output: object) -> bool:
        """Whether the output exists and has not failed."""
        return output is not None and not any(output is ended for ended in self._ended)

    @contextmanager
    def guard(self, output: object) -> Iterator[None]:
        """Inside the block, a failure of this output is handled."""
        try:
            yield
        except Exception as failure:
            # Unforeseen ones, too: an error in a picture of the video must not stop a robot that drives.
            if self._cut_off is None:
                raise
            if self.is_active(output):
                self._ended.append(output)
                foreseen = isinstance(failure, UserError | HalError)
                self._cut_off(str(failure) if foreseen else f"{type(output).__name__}: {describe(failure)}")

    @contextmanager
    def open(self, files: AbstractContextManager[Output]) -> Iterator[Output]:
        """The output is open inside the block. Raises UserError, HalError if it cannot be opened."""
        if self._cut_off is None:
            with files as output:
                yield output
            return
        output = files.__enter__()
        try:
            yield output
        finally:
            # Without the error that ends the block: with it, a failure would be printed instead of reported.
            with self.guard(output):
                files.__exit__(None, None, None)
