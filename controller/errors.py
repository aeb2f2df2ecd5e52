"""Errors of the program itself that a user can correct; hal and config have their own."""

from __future__ import annotations

# The exit code that shells report for a program that SIGINT has ended.
INTERRUPTED = 130


class Interrupted(Exception):
    """Raised on Ctrl-C where there are partial results to report."""


class UserError(Exception):
    """A request that cannot be fulfilled: one line with what, where, why and what to do."""


def describe(error: BaseException) -> str:
    """Type and text of an unforeseen error in one line; the text of OpenCV has several lines."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}".rstrip(": ")
