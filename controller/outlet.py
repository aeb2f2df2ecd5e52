"""Words to the standard streams that hold nobody up and stop nobody."""

from __future__ import annotations

import os
import queue
import sys
import threading
from types import TracebackType
from typing import NamedTuple, Self, TextIO

import click

# So many are kept while nobody reads: minutes of a drive.
_MOST = 500
_GOODBYE_S = 2.0


class Words(NamedTuple):
    """For standard output, or for standard error; a whole line, or a part of one that is renewed."""

    text: str
    to_stderr: bool = False
    whole: bool = True


def write(words: Words) -> None:
    """Write at once. A reader that goes, or a disk that is full, is no reason to stop a robot: the words are
    lost, and said to be. What the terminal cannot show is spelled out."""
    try:
        click.echo(words.text, nl=words.whole, err=words.to_stderr)
    except UnicodeError:
        plain = words.text.encode("ascii", "backslashreplace").decode("ascii")
        click.echo(plain, nl=words.whole, err=words.to_stderr)
    except OSError as error:
        _write_to_nobody(sys.stderr if words.to_stderr else sys.stdout)
        if not words.to_stderr:
            lost = f"nothing more can be written to standard output ({error.strerror})"
            write(Words(f"treadwatch: warning: {lost}", to_stderr=True))


def say(line: str, *, to_stderr: bool = False) -> None:
    """A whole line at once, for commands that measure: see write."""
    write(Words(line, to_stderr))


class Outlet:
    """Writes in a thread of its own while it is open: who stops reading (Ctrl-S, a pipe, a connection that
    hangs) does not hold up the control loop. What becomes too much is left out, and said to be."""

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
        """Waits for what was said, but not for somebody who does not read it."""
        try:
            self._waiting.put(None, timeout=_GOODBYE_S)
        except queue.Full:
            return
        self._thread.join(_GOODBYE_S)

    def write(self, words: Words) -> None:
        """Returns at once."""
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
    """Whatever is written to it from now on, what it still holds included, vanishes."""
    nobody = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nobody, stream.fileno())
    os.close(nobody)
