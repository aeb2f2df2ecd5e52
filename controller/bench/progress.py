"""A progress bar for the bench; hidden if standard error is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click


@contextmanager
def progress(label: str, steps: int) -> Iterator[Callable[[], None]]:
    """A progress bar on standard error. Yields a function to be called once a step."""
    hidden = not sys.stderr.isatty()
    with click.progressbar(length=steps, label=f"{label:40}", file=sys.stderr, hidden=hidden) as bar:
        yield lambda: bar.update(1)
