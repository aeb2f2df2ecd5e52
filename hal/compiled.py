"""Loops that are compiled for this processor: the one place that knows the compiler (Numba).

NumPy goes over an array once for each operation, and a frame has some hundred small ones: its calls took
longer than what they computed. A compiled step goes over the cells, the pixels or the ends once, in the words
of the algorithm. Every one is compiled when its module is imported, never in the middle of a drive, and kept
on the disk: beside its file, or, where that may not be written, in the user's cache, or in NUMBA_CACHE_DIR.
The first import takes a minute or two for all of them, and says so; later ones take a moment.

Rules: a step takes numbers and arrays, does not change them, and returns new ones. What it calls, and the
constants that it uses, stand in its own file, above it: what is kept on the disk is made anew only when that
file changes. With NUMBA_DISABLE_JIT=1 all of them run as plain Python, for a debugger.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from numba import njit, types
from numba.core import sigutils

P = ParamSpec("P")
R = TypeVar("R")

_FIRST_TIME = "treadwatch: compiling for this processor, which is done once and takes a minute or two\n"
_told: list[str] = []


def compiled(arguments: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A step that takes arguments, in Numba's words: "float32[:, ::1], int64"; [::1] is contiguous, [:] need
    not be. Arrays that may not be written to are welcome. Division by zero is as in NumPy: inf or NaN."""
    parsed, _ = sigutils.normalize_signature(f"({arguments},)")
    signature = tuple(_read_only(argument) for argument in parsed)

    def build(function: Callable[P, R]) -> Callable[P, R]:
        try:
            return _build(function, signature, kept=True)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            # Nowhere to keep it: neither beside the file, nor in the user's cache, nor in NUMBA_CACHE_DIR.
            return _build(function, signature, kept=False)

    return build


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Part of compiled steps of the same file, for whatever types they give it."""
    result: Callable[P, R] = njit(error_model="numpy")(function)
    return result


def _build(function: Callable[P, R], signature: tuple[types.Type, ...], kept: bool) -> Callable[P, R]:
    result: Callable[P, R] = njit([signature], cache=kept, error_model="numpy")(function)
    if kept and not _told and _is_new(result):
        _told.append(_FIRST_TIME)
        sys.stderr.write(_FIRST_TIME)
    return result


def _is_new(step: Any) -> bool:
    """Whether it was compiled just now; False for plain Python, with NUMBA_DISABLE_JIT=1."""
    return hasattr(step, "stats") and bool(step.stats.cache_misses)


def _read_only(argument: types.Type) -> types.Type:
    return argument.copy(readonly=True) if isinstance(argument, types.Array) else argument
