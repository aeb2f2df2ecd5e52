"""Errors of the program itself that a user can mend; hal and config have their own."""

from __future__ import annotations


class UserError(Exception):
    """A wish that cannot be fulfilled: one line with what, where, why and what to do."""
