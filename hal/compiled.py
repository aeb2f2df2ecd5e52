"""Loops that are compiled for this processor: the one place that knows the compiler (Numba).

NumPy goes over an array once for each operation, and a frame has some hundred small ones: its calls took
longer than what they computed. A compiled step goes over the cells, the pixels or the ends once, in the words
of the algorithm. Every one is compiled when its module is imported, never in the middle of a drive, and kept
on the disk: beside its file, or, where that may not be written, in the user's cache, or in NUMBA_CACHE_DIR.
The first import takes a minute or two for all of them, and says so; later ones take a moment. What was kept
and cannot be read any more is made anew; where nothing can be kept, every start compiles, and says so.

Rules: a step takes numbers and arrays, does not change them, and returns new ones; parts that are inlined may
fill the arrays they are given. No index is checked: what a step reads by has to be in range. With
NUMBA_DISABLE_JIT=1 all of them run as plain Python, for a debugger; there 1.0 / 0.0 is an error.

What is kept of a step is made anew when its file changes, or that of a part which it calls, or the value of a
constant that it reads, wherever they stand (_rests_on): the compiler alone would look at the step's own file.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from pickle import PickleError
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numba import njit, types
from numba.core import caching, sigutils
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
_CONSTANTS = (bool, int, float, str, tuple, np.generic)
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
    """Part of compiled steps, for whatever types they give it."""
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
    step: Any = njit(error_model="numpy")(function)
    if isinstance(step, Dispatcher):  # else plain Python, with NUMBA_DISABLE_JIT=1
        if kept:
            # As Dispatcher.enable_caching does, with a cache that stamps less.
            setattr(step, "_cache", _Cache(function))  # noqa: B010
        if anew:
            step.recompile()  # nothing yet, but what is kept is forgotten with it
        step.compile(signature)
        step.disable_compile()
    result: Callable[P, R] = step
    return result


def _rests_on(function: FunctionType, known: set[FunctionType]) -> Iterator[object]:
    """What the compiled form of function holds besides the words of its own file: the files of the parts that
    it calls, by what is in them, and the constants and records that it and they read. known: parts had."""
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, Dispatcher):
            if value.py_func not in known:
                known.add(value.py_func)
                yield sha256(Path(inspect.getfile(value.py_func)).read_bytes()).hexdigest()
                yield from _rests_on(value.py_func, known)
        elif isinstance(value, np.ndarray):
            yield name, value.tobytes()
        elif isinstance(value, type) and issubclass(value, tuple):
            yield name, getattr(value, "_fields", ())
        elif isinstance(value, _CONSTANTS):
            yield name, repr(value)


def _stamped(place: Any) -> Any:
    """A place where compiled forms are kept, whose stamp is of everything that they rest on."""

    class Stamped(place):  # type: ignore[misc]
        def __init__(self, function: FunctionType, file: str) -> None:
            super().__init__(function, file)
            self._function = function

        def get_source_stamp(self) -> tuple[object, ...]:
            return super().get_source_stamp(), *_rests_on(self._function, set())

    return Stamped


class _Forms(caching.CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (
        _stamped(caching.UserProvidedCacheLocator),
        _stamped(caching.InTreeCacheLocator),
        _stamped(caching.UserWideCacheLocator),
    )


class _Cache(caching.FunctionCache):  # type: ignore[misc]
    _impl_class = _Forms


def _say(sentence: str, *values: str) -> None:
    """On standard error, once."""
    if sentence not in _told:
        _told.add(sentence)
        sys.stderr.write(sentence.format(*values))


def _read_only(argument: types.Type) -> types.Type:
    return argument.copy(readonly=True) if isinstance(argument, types.Array) else argument
