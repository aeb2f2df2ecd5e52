"""Output to the standard streams that neither blocks the control loop nor stops the program."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import NamedTuple, Self, TextIO

import click

from controller.errors import UserError

# Lines that are queued while nobody reads: minutes of a drive.
_MOST = 500
_GOODBYE_S = 2.0  # how long the end waits for the queue to be written


class Words(NamedTuple):
    """A text for standard output or standard error. whole: a whole line, not a part to be redrawn."""

    text: str
    to_stderr: bool = False
    whole: bool = True


def write(words: Words) -> None:
    """Write at once, without failing.

    A reader that has closed, or a full disk, must not stop a robot: the text is lost, and a warning says so.
    """
    try:
        _echo(words)
    except OSError as error:
        _write_to_nobody(sys.stderr if words.to_stderr else sys.stdout)
        if not words.to_stderr:
            lost = f"nothing more can be written to standard output ({error.strerror})"
            write(Words(f"treadwatch: warning: {lost}", to_stderr=True))


def say(line: str, *, to_stderr: bool = False) -> None:
    """Write a whole line at once, for commands that measure: see write."""
    write(Words(line, to_stderr))


def say_result(line: str) -> None:
    """Write a line of what a command is run for and leaves nowhere else: see result_on_stdout."""
    with result_on_stdout():
        _echo(Words(line))


@contextmanager
def result_on_stdout() -> Iterator[None]:
    """A block that writes the whole result of a command to standard output.

    Raises UserError if it cannot be written. A reader that has read enough, such as `head`, ends the program
    without a message and with exit code 1, as click does.
    """
    try:
        yield
    except BrokenPipeError as error:
        _write_to_nobody(sys.stdout)
        raise SystemExit(1) from error
    except OSError as error:
        _write_to_nobody(sys.stdout)
        raise UserError(
            f"standard output: cannot be written ({error.strerror}); make room, or send it elsewhere"
        ) from error


def _echo(words: Words) -> None:
    """Characters that the terminal cannot show are escaped. Raises OSError."""
    try:
        click.echo(words.text, nl=words.whole, err=words.to_stderr)
    except UnicodeError:
        plain = words.text.encode("ascii", "backslashreplace").decode("ascii")
        click.echo(plain, nl=words.whole, err=words.to_stderr)


class Outlet:
    """Writes in a thread of its own while it is open.

    So a reader that stops (Ctrl-S, a pipe, a connection that hangs) does not block the control loop. Lines
    that do not fit into the queue are left out, and a warning says how many.
    """

    def __init__(self) -> None:
        self._waiting: queue.Queue[Words | None] = queue.Queue(_MOST)
        self._left_out = 0
        self._thread = threading.Thread(target=self._write_all, name="outlet", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Waits for the queue to be written, but for _GOODBYE_S at most."""
        try:
            self._waiting.put(None, timeout=_GOODBYE_S)
        except queue.Full:
            return
        self._thread.join(_GOODBYE_S)

    def write(self, words: Words) -> None:
        """Queue the text; returns at once."""
        try:
            self._waiting.put_nowait(words)
        except queue.Full:
            self._left_out += words.whole

    def _write_all(self) -> None:
        while (words := self._waiting.get()) is not None:
            write(words)
            left_out, self._left_out = self._left_out, 0
            if left_out:
                write(Words(f"treadwatch: warning: {left_out} lines were not read and left out", True))


def _write_to_nobody(stream: TextIO) -> None:
    """Redirect the stream to the null device: what it still holds and all that follows is discarded."""
    nobody = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nobody, stream.fileno())
    os.close(nobody)
