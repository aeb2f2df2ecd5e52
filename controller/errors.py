"""Errors of the program itself that a user can mend; hal and config have their own."""

from __future__ import annotations

# What shells report for a program that SIGINT has ended.
INTERRUPTED = 130


class Interrupted(Exception):
    """Ctrl-C, where something can be said of what was done so far."""


class UserError(Exception):
    """A wish that cannot be fulfilled: one line with what, where, why and what to do."""
