"""Records as arguments of compiled steps (hal/compiled.py), which are compiled for the fields that they read.

The compiler knows numbers, arrays and named tuples of them, but a named tuple as an argument doubles the time
of a call, and its arrays must have exactly the declared types. So callers pass the fields one by one, and the
named tuples are made within what is compiled, where they cost nothing. For a step with the parameters tracks,
which is a record, and now_ns, two functions are made:

    from_records: _listed(tracks, now_ns) calls the second with (tracks.state, tracks.moving, now_ns)
    from_fields: _listed(tracks_state, tracks_moving, now_ns) calls the step; this one is compiled
"""

from __future__ import annotations

import dis
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from types import CodeType
from typing import Any, get_type_hints

Function = Callable[..., Any]
# The fields that a step reads, for each of its parameters that is a record.
Fields = Mapping[str, Sequence[str]]

_NUMBERS = {float: "float64", int: "int64", bool: "boolean"}


def parameters_of(function: Function) -> tuple[str, ...]:
    """The names of the parameters of a function that takes them by position."""
    code = _code(function)
    return code.co_varnames[: code.co_argcount]


def fields_read(function: Function, parameter: str, record: type) -> dict[str, str]:
    """The fields that function reads of a parameter that is a record, with their types in Numba's notation.

    If function hands the record on, these are all fields that have a type: numbers, and arrays declared with
    the types of hal/types.py. Raises TypeError if function reads a field without a type, or no field.
    """
    typed, read = dict(_typed(record)), set(_read(_code(function), parameter))
    if None in read:
        read = set(typed)
    if not read or read - set(typed):
        what = ", ".join(map(str, read - set(typed))) or "no field"
        raise TypeError(
            f"{function.__qualname__} reads {what} of {parameter}: {record.__name__} declares no type for it"
        )
    return {name: kind for name, kind in typed.items() if name in read}


def from_records(step: Function, function: Function, fields: Fields) -> Function:
    """A function with the parameters of function, which calls step with the fields of the records."""
    names = parameters_of(function)
    given = [part for name in names for part in _parts(name, fields, ".")]
    made: Any = _calling(step, function, names, given, {})
    made.__doc__, made.__wrapped__ = function.__doc__, function
    result: Function = made
    return result


def from_fields(step: Function, function: Function, fields: Fields) -> Function:
    """A function of the single fields, which calls step, the compiled function, with named tuples of them."""
    names = parameters_of(function)
    parameters = [part for name in names for part in _parts(name, fields, "_")]
    given = [f"_{name}({', '.join(_parts(name, fields, '_'))})" if name in fields else name for name in names]
    tuples = {f"_{name}": namedtuple(name, read) for name, read in fields.items()}
    return _calling(step, function, parameters, given, tuples)


def _code(function: Function) -> CodeType:
    code: CodeType = function.__code__
    return code


def _typed(record: type) -> Iterator[tuple[str, str]]:
    """The public fields of a record that have a compiled type, with it."""
    for name, kind in get_type_hints(record, include_extras=True).items():
        if name.startswith("_"):
            continue
        if kind in _NUMBERS:
            yield name, _NUMBERS[kind]
        elif hasattr(kind, "__metadata__"):  # Annotated
            yield name, kind.__metadata__[0]


def _read(code: CodeType, parameter: str) -> Iterator[str | None]:
    """The fields that code reads of a parameter; None where it hands on the parameter as a whole."""
    for load, following in pairwise(dis.get_instructions(code)):
        # From Python 3.13 on, one instruction may load two variables, or store one and load the next.
        loaded = load.argval if isinstance(load.argval, tuple) else (load.argval,)
        if "LOAD_FAST" in load.opname and parameter in loaded:
            is_read = following.opname == "LOAD_ATTR" and loaded[-1] == parameter
            yield following.argval if is_read else None


def _parts(name: str, fields: Fields, joint: str) -> list[str]:
    """A parameter, or its fields if it is a record."""
    return [f"{name}{joint}{field}" for field in fields[name]] if name in fields else [name]


def _calling(
    step: Function, function: Function, parameters: Sequence[str], given: Sequence[str], names: dict[str, Any]
) -> Function:
    """A function of parameters that calls step with what is given; by name, file and line it is function.

    names: others that it uses. The file is where the cache of compiled steps looks for changes.
    """
    scope = {"_step": step, **names}
    exec(f"def {function.__name__}({', '.join(parameters)}): return _step({', '.join(given)})", scope)
    made: Any = scope[function.__name__]
    code = _code(function)
    made.__code__ = made.__code__.replace(co_filename=code.co_filename, co_firstlineno=code.co_firstlineno)
    made.__module__, made.__qualname__ = function.__module__, function.__qualname__
    result: Function = made
    return result
