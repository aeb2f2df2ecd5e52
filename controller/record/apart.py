"""Outputs of a drive in real time fail apart from each other, and from the drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TypeVar

from controller.errors import UserError
from hal.errors import HalError

Output = TypeVar("Output")


class Apart:
    """What becomes of a failure to write.

    cut_off: told once of each output that ends, with the reason; what else it is given is not written, and
    everything else goes on. None: the failure ends the run, as where nothing moves by itself.
    """

    def __init__(self, cut_off: Callable[[str], None] | None = None) -> None:
        self._cut_off = cut_off
        self._ended: set[int] = set()

    def goes_on(self, output: object) -> bool:
        """It is wanted and has not failed."""
        return output is not None and id(output) not in self._ended

    @contextmanager
    def attempt(self, output: object) -> Iterator[None]:
        """To write to this output, or to close it."""
        try:
            yield
        except (UserError, HalError) as failure:
            if self._cut_off is None:
                raise
            if self.goes_on(output):
                self._ended.add(id(output))
                self._cut_off(str(failure))

    @contextmanager
    def closing(self, files: AbstractContextManager[Output]) -> Iterator[Output]:
        """The output is open in the block. Raises UserError, HalError where it cannot be opened."""
        if self._cut_off is None:
            with files as output:
                yield output
            return
        output = files.__enter__()
        try:
            yield output
        finally:
            # Without the error that ends the block: it would have a failure printed, and not told.
            with self.attempt(output):
                files.__exit__(None, None, None)
