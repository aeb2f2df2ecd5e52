"""How far the bench is, on a terminal; silent elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click


@contextmanager
def progress(label: str, steps: int) -> Iterator[Callable[[], None]]:
    """A bar on standard error; call what this yields once a step."""
    hidden = not sys.stderr.isatty()
    with click.progressbar(length=steps, label=f"{label:40}", file=sys.stderr, hidden=hidden) as bar:
        yield lambda: bar.update(1)
