"""Compiled functions ("steps"): the only module that uses the compiler (Numba).

NumPy passes over an array once per operation. A frame needs some hundred operations on small arrays, and the
calls took longer than the arithmetic. A compiled step passes over the cells, pixels or end points once, in a
plain loop that reads like the algorithm. Each step is compiled when its module is imported, never during a
drive, and cached on disk: in NUMBA_CACHE_DIR if that is set, else beside its file, or in the user's cache if
that folder is not writable. The first import compiles all steps, which takes a minute or two and prints a
message; later imports take a moment. A cache that cannot be read is rebuilt. If nothing can be cached, every
start compiles and prints a message.

Rules: a step takes numbers, arrays and records, does not change them, and returns new ones; inlined parts
may write to the arrays they are given. A part that is called in an innermost loop, and makes no array, is one
in place: it costs nothing to hand it arrays. Indices are not checked, so they must be in range. With
NUMBA_DISABLE_JIT=1 all steps run as plain Python, for a debugger; there 1.0 / 0.0 is an error.

A record is an object whose class declares its fields, such as a dataclass or a section of the settings. Array
fields are declared with the types of hal/types.py (Vector, Matrix, Flags), which tell the compiler their
dimensions. A step reads the fields of a record by name, or hands the record on to inlined parts. A call takes
0.08 us for each array that the step reads, as if it were an argument of its own (hal/step_records.py).

A cached step is rebuilt when its file changes, when the file of a part it calls changes, or when the value of
a constant it reads changes, in whichever module these are (_rests_on). Numba alone would check only the
step's own file.
"""

from __future__ import annotations

import inspect
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from pickle import PickleError
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numba import njit, types
from numba.core import caching, sigutils
from numba.core.errors import NumbaError

from hal.step_records import fields_read, from_fields, from_records, parameters_of, parts_of

P = ParamSpec("P")
R = TypeVar("R")

_FIRST_TIME = "treadwatch: compiling for this processor, which is done once and takes a minute or two\n"
_EVERY_TIME = (
    "treadwatch: compiled code cannot be cached, so every start takes a minute or two; "
    "NUMBA_CACHE_DIR may name a folder for it ({})\n"
)
_warned: set[str] = set()
_CONSTANTS = (bool, int, float, str, tuple, np.generic)
# What reading or writing the cache may raise: a full disk, no writable folder, a truncated file.
_CACHE_ERRORS = (
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


def compiled(*arguments: str | type) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator that compiles a step for these arguments: types in Numba's notation, or classes of records.

    Example: @compiled(Bodies, ViewEdges, "float64[:, ::1], int64"). [::1] is contiguous, [:] need not be.
    Read-only arrays are accepted. Division by zero gives inf or NaN, as in NumPy.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature: list[types.Type] = []
        fields: dict[str, tuple[str, ...]] = {}
        for name, kind in zip(parameters_of(function), _one_by_one(arguments), strict=True):
            if isinstance(kind, type):
                read = fields_read(function, name, kind)
                fields[name] = tuple(read)
                signature += _one_by_one(read.values())
            else:
                signature.append(kind)
        if not fields:
            return _compile(function, tuple(signature))
        flat = _compile(from_fields(inlined(function), function, fields), tuple(signature))
        result: Callable[P, R] = from_records(flat, function, fields)
        return result

    return decorate


def _one_by_one(arguments: Iterable[str | type]) -> Iterator[Any]:
    """The classes among arguments as they are, and each type that the others name, for arrays to be read."""
    for argument in arguments:
        if isinstance(argument, str):
            parsed, _ = sigutils.normalize_signature(f"({argument},)")
            yield from map(_read_only, parsed)
        else:
            yield argument


def _compile(function: Callable[P, R], signature: tuple[types.Type, ...]) -> Callable[P, R]:
    """function compiled for signature, from the cache if that can be read."""
    why = ""
    # The second attempt replaces a damaged cache, for example where power was cut while it was written.
    for anew in (False, True):
        try:
            return _build(function, signature, kept=True, anew=anew)
        except NumbaError:
            raise  # an error in the step itself
        except _CACHE_ERRORS as error:
            why = str(error).partition("\n")[0]
    _say(_EVERY_TIME, why)
    return _build(function, signature, kept=False)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator for a function that compiled steps call, compiled for the types they pass."""
    part: Any = njit(error_model="numpy")(function)
    part.py_func = function  # so it is already, but not with NUMBA_DISABLE_JIT=1; parts_of() needs it
    result: Callable[P, R] = part
    return result


def in_place(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator for an inlined part that neither makes an array nor returns one, for innermost loops.

    It may write to arrays that it is given, and look at parts of them. To be handed an array costs another
    part 14 ns, in which it is counted who holds the array, and counted off again; this one does not count.
    Its code becomes the caller's, where the compiler knows more of what it is given. Raises TypeError if it
    may return an array: that would be one that nobody holds.
    """
    if not _plain(get_type_hints(function)["return"]):
        raise TypeError(f"{function.__qualname__} may return an array, which a part in place must not")
    part: Any = njit(error_model="numpy", forceinline=True, _nrt=False)(function)
    part.py_func = function
    result: Callable[P, R] = part
    return result


def _plain(hint: Any) -> bool:
    """Whether a type is that of numbers, of nothing, or of tuples of these."""
    if get_origin(hint) is tuple:
        return all(map(_plain, get_args(hint)))
    return isinstance(hint, type) and issubclass(hint, (int, float, np.generic, type(None)))


def _build(
    function: Callable[P, R], signature: tuple[types.Type, ...], *, kept: bool, anew: bool = False
) -> Callable[P, R]:
    """Compile function for signature. kept: use the cache. anew: ignore what is cached and replace it.

    Raises NumbaError, and what reading or writing the cache may raise.
    """
    step: Any = njit(error_model="numpy")(function)
    if not isinstance(step, FunctionType):  # it is one with NUMBA_DISABLE_JIT=1: plain Python
        if kept:
            step._cache = _Cache(step.py_func)  # as Dispatcher.enable_caching does
        if anew:
            step.recompile()  # nothing is compiled yet, but this drops the cached form
        with _interrupts_deferred():
            step.compile(signature)
        step.disable_compile()
        if kept and step.stats.cache_misses:
            _say(_FIRST_TIME)
    result: Callable[P, R] = step
    return result


@contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """Hold back Ctrl-C until the block ends: the compiler calls Python from C, where an exception is lost."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is None:
        # Only the main thread is interrupted, and only there may handlers be set. None is a handler that is
        # not Python's, as in a program that embeds Python: it raises nothing here, and cannot be put back.
        yield
        return
    held_back: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: held_back.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held_back:
            signal.raise_signal(signal.SIGINT)


class _Cache(caching.FunctionCache):  # type: ignore[misc]  # Numba has no types
    """Numba's cache of one step, with a stamp that covers everything that the compiled form rests on."""

    def __init__(self, function: FunctionType) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp(), *_rests_on(function)
        self._cache_file = caching.IndexDataCacheFile(self.cache_path, self._impl.filename_base, stamp)


def _rests_on(function: FunctionType) -> Iterator[object]:
    """What the compiled form of function depends on besides its own file.

    Yields the hashes of the files of the parts that it calls, and the constants and fields of records that
    they and it read.
    """
    for part in parts_of(function):
        if part is not function:
            yield sha256(Path(inspect.getfile(part)).read_bytes()).hexdigest()
        for name in part.__code__.co_names:
            value = part.__globals__.get(name)
            if isinstance(value, np.ndarray):
                yield name, value.tobytes()
            elif isinstance(value, type) and issubclass(value, tuple):
                yield name, getattr(value, "_fields", ())
            elif isinstance(value, _CONSTANTS):
                yield name, repr(value)


def _say(sentence: str, *values: str) -> None:
    """Write to standard error, each sentence only once."""
    if sentence not in _warned:
        _warned.add(sentence)
        sys.stderr.write(sentence.format(*values))


def _read_only(argument: types.Type) -> types.Type:
    return argument.copy(readonly=True) if isinstance(argument, types.Array) else argument
