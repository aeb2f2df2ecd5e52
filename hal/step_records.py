"""Records as arguments of compiled steps (hal/compiled.py), which are compiled for the fields that they read.

The compiler knows numbers, arrays and named tuples of them, but a named tuple as an argument doubles the time
of a call, and its arrays must have exactly the declared types. So callers pass the fields one by one, and the
named tuples are made within what is compiled, where they cost nothing. For a step with the parameters tracks,
which is a record, and now_ns, two functions are made:

    from_records: _listed(tracks, now_ns) calls the second with (tracks.state, tracks.moving, now_ns)
    from_fields: _listed(tracks_state, tracks_moving, now_ns) calls the step; this one is compiled

A step is given the fields whose names occur in its code or in that of the parts it calls. A name that means
something else there, or the field of another record, adds an array that nobody reads, 0.08 us a call.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from types import CodeType, FunctionType
from typing import Any, get_type_hints

Function = Callable[..., Any]
# The fields that a step reads, for each of its parameters that is a record.
Fields = Mapping[str, Sequence[str]]

_NUMBERS: dict[object, str] = {float: "float64", int: "int64", bool: "boolean"}


def parameters_of(function: Function) -> tuple[str, ...]:
    """The names of the parameters of a function that takes them by position."""
    code = _code(function)
    return code.co_varnames[: code.co_argcount]


def fields_read(function: Function, parameter: str, record: type) -> dict[str, str]:
    """The fields that function may read of a parameter that is a record, with their types for Numba.

    Numbers have a type, and arrays that are declared with the types of hal/types.py. Raises TypeError if
    function reads a field without a type, or no field.
    """
    hints = get_type_hints(record, include_extras=True)
    named = {name for part in parts_of(function) for name in part.__code__.co_names}
    read = {name: _type_of(hint) for name, hint in hints.items() if name in named}
    typed = {name: kind for name, kind in read.items() if kind is not None}
    if not typed or len(typed) < len(read):
        what = ", ".join(read.keys() - typed.keys()) or "no field"
        raise TypeError(
            f"{function.__qualname__} reads {what} of {parameter}: {record.__name__} declares no type for it"
        )
    return typed


def parts_of(function: Function) -> list[FunctionType]:
    """function and the inlined parts that it calls, directly or by way of another part, each once."""
    found: list[FunctionType] = []

    def visit(part: Any) -> None:
        if part not in found:
            found.append(part)
            for name in part.__code__.co_names:
                called = part.__globals__.get(name)
                if hasattr(called, "py_func"):
                    visit(called.py_func)

    visit(function)
    return found


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


def _type_of(hint: object) -> str | None:
    """The compiled type of a field that is declared with hint; None if it has none."""
    if hasattr(hint, "__metadata__"):  # Annotated
        return str(hint.__metadata__[0])
    return _NUMBERS.get(hint)


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
