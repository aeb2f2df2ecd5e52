"""Dataclasses that are quick to make: frozen for the type checker, but not at run time.

A frozen dataclass sets each field with a function call, which takes three times as long as an assignment.
For records that are made in every control step, that was 5 % of the time of a simulated mission; for those
that are made in every frame, 1 % of the time of perception.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

T = TypeVar("T")

if TYPE_CHECKING:
    from dataclasses import dataclass as record
else:

    def record(*, frozen: bool, slots: bool, eq: bool = True) -> Callable[[type[T]], type[T]]:
        """Like dataclasses.dataclass(), except that only mypy enforces frozen."""
        return dataclasses.dataclass(slots=slots, eq=eq, unsafe_hash=eq and frozen)


__all__ = ["record"]
