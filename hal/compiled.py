"""Loops that are compiled for this processor: the one place that knows the compiler (Numba).

NumPy goes over an array once for each operation, and a frame has some hundred small ones: its calls took
longer than what they computed. A compiled step goes over the cells, the pixels or the ends once, in the words
of the algorithm. Every one is compiled when its module is imported, never in the middle of a drive, and kept
on the disk: beside its file, or, where that may not be written, in the user's cache, or in NUMBA_CACHE_DIR.
The first import takes a minute or two for all of them, and says so; later ones take a moment. What was kept
and cannot be read any more is made anew; where nothing can be kept, every start compiles, and says so.

Rules: a step takes numbers and arrays, does not change them, and returns new ones; parts that are inlined may
fill the arrays they are given. What a step calls, and the constants that it uses, stand in its own file,
above it: what is kept on the disk is made anew only when that file changes. No index is checked: what a step
reads by has to be in range. With NUMBA_DISABLE_JIT=1 all of them run as plain Python, for a debugger; there
1.0 / 0.0 is an error.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pickle import PickleError
from typing import Any, ParamSpec, TypeVar

from numba import njit, types
from numba.core import sigutils
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

P = ParamSpec("P")
R = TypeVar("R")

_FIRST_TIME = "treadwatch: compiling for this processor, which is done once and takes a minute or two\n"
_EVERY_TIME = (
    "treadwatch: what is compiled for this processor cannot be kept, so every start takes a minute or two; "
    "NUMBA_CACHE_DIR may name a folder for it ({})\n"
)
_told: set[str] = set()
# What reading or writing its files raises: a full disk, no place for them, half a file and what comes of it.
_NOT_KEPT = (
    OSError,
    RuntimeError,
    EOFError,
    PickleError,
    ValueError,
    LookupError,
    AttributeError,
    ImportError,
    TypeError,
)


def compiled(arguments: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A step that takes arguments, in Numba's words: "float32[:, ::1], int64"; [::1] is contiguous, [:] need
    not be. Arrays that may not be written to are welcome. Division by zero is as in NumPy: inf or NaN."""
    parsed, _ = sigutils.normalize_signature(f"({arguments},)")
    signature = tuple(_read_only(argument) for argument in parsed)

    def build(function: Callable[P, R]) -> Callable[P, R]:
        try:
            return _kept(function, signature)
        except NumbaError:
            raise  # an error in the step itself
        except _NOT_KEPT as error:
            _say(_EVERY_TIME, str(error).partition("\n")[0])
        return _build(function, signature, kept=False)

    return build


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Part of compiled steps of the same file, for whatever types they give it."""
    result: Callable[P, R] = njit(error_model="numpy")(function)
    return result


def _kept(function: Callable[P, R], signature: tuple[types.Type, ...]) -> Callable[P, R]:
    """From the disk, or compiled and kept there. Raises what reading and writing its files may raise, and
    NumbaError."""
    try:
        step = _build(function, signature, kept=True)
    except NumbaError:
        raise
    except _NOT_KEPT:
        # Damaged: whoever cut the power while it was written left half a file.
        step = _build(function, signature, kept=True, anew=True)
    if isinstance(step, Dispatcher) and step.stats.cache_misses:
        _say(_FIRST_TIME)
    return step


def _build(
    function: Callable[P, R], signature: tuple[types.Type, ...], *, kept: bool, anew: bool = False
) -> Callable[P, R]:
    """anew: whatever is kept of it counts for nothing."""
    step: Any = njit(cache=kept, error_model="numpy")(function)
    if isinstance(step, Dispatcher):  # else plain Python, with NUMBA_DISABLE_JIT=1
        if anew:
            step.recompile()  # nothing yet, but what is kept is forgotten with it
        step.compile(signature)
        step.disable_compile()
    result: Callable[P, R] = step
    return result


def _say(sentence: str, *values: str) -> None:
    """On standard error, once."""
    if sentence not in _told:
        _told.add(sentence)
        sys.stderr.write(sentence.format(*values))


def _read_only(argument: types.Type) -> types.Type:
    return argument.copy(readonly=True) if isinstance(argument, types.Array) else argument
