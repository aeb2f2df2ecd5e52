"""What a compiled step promises: ready at import, exact types, nothing changed, nothing stale."""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import pkgutil
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

import controller
import hal
import sim
import vision
from hal.compiled import compiled, inlined
from hal.types import FloatArray


@inlined
def _half(value: float) -> float:
    return 0.5 * value


@compiled("float64[:, ::1], float64")
def _halves_over(values: FloatArray, divisor: float) -> tuple[FloatArray, int]:
    """(N, M) half of each value over divisor, and how many there are."""
    result = np.empty(values.shape)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            result[i, j] = _half(values[i, j]) / divisor
    return result, values.size


VALUES = np.array([[2.0, 4.0, 6.0], [0.0, -1.0, 8.0]])


def test_a_step_returns_what_its_loop_says() -> None:
    halves, count = _halves_over(VALUES, 2.0)
    np.testing.assert_array_equal(halves, [[0.5, 1.0, 1.5], [0.0, -0.25, 2.0]])
    assert count == 6


def test_division_by_zero_is_as_in_numpy() -> None:
    halves, _ = _halves_over(VALUES, 0.0)
    assert np.isinf(halves[0]).all()
    assert np.isnan(halves[1, 0])


def test_arrays_that_may_not_be_written_to_are_welcome() -> None:
    locked = VALUES.copy()
    locked.setflags(write=False)
    np.testing.assert_array_equal(_halves_over(locked, 2.0)[0], _halves_over(VALUES, 2.0)[0])


@pytest.mark.parametrize("values", [VALUES.astype(np.float32), VALUES[:, ::2], VALUES[0]])
def test_another_type_is_refused_and_not_compiled_in_the_middle_of_a_drive(values: NDArray[Any]) -> None:
    with pytest.raises(TypeError, match="No matching definition"):
        _halves_over(values, 2.0)


def test_where_nothing_can_be_kept_it_is_compiled_all_the_same_and_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A function of no file, for which the compiler finds no place."""
    monkeypatch.setattr("hal.compiled._told", set())
    scope: dict[str, Any] = {}
    exec(compile("def twice(value):\n    return 2.0 * value\n", "<nowhere>", "exec"), scope)
    assert compiled("float64")(scope["twice"])(1.5) == 3.0
    compiled("float64")(scope["twice"])
    told = capsys.readouterr().err
    assert told.count("cannot be kept") == 1
    assert "NUMBA_CACHE_DIR" in told


STEP = """
from hal.compiled import compiled

@compiled("float64")
def twice(value):
    return 2.0 * value

print(twice(1.5))
"""


def run_step(folder: Path, most_bytes: int | None = None) -> tuple[int, str, str]:
    """Exit code, output and errors of a program with one step, whose compiled form is kept in folder; no file
    may grow beyond most_bytes."""
    program, root = folder / "step.py", str(Path(__file__).resolve().parents[3])
    program.write_text(STEP, encoding="utf-8")
    # What stands in its file is made anew when that changes: here it does not.
    os.utime(program, (1.0, 1.0))
    environment = {"NUMBA_CACHE_DIR": str(folder / "kept"), "PYTHONPATH": root, "PATH": os.environ["PATH"]}

    def limit() -> None:
        if most_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))

    done = subprocess.run(
        [sys.executable, "-B", str(program)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limit,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("left_bytes", [0, 20])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_what_is_kept_is_read_again_and_made_anew_where_it_is_damaged(
    tmp_path: Path, ending: str, left_bytes: int
) -> None:
    code, answer, told = run_step(tmp_path)
    assert (code, answer) == (0, "3.0\n")
    assert "compiling for this processor" in told
    assert run_step(tmp_path) == (0, "3.0\n", "")
    (file,) = (tmp_path / "kept").rglob(f"*.{ending}")
    file.write_bytes(file.read_bytes()[:left_bytes])
    code, answer, told = run_step(tmp_path)
    assert (code, answer) == (0, "3.0\n")
    assert "compiling for this processor" in told
    assert run_step(tmp_path) == (0, "3.0\n", "")


def test_a_full_disk_keeps_nothing_and_hinders_nobody(tmp_path: Path) -> None:
    code, answer, told = run_step(tmp_path, most_bytes=200)
    assert (code, answer) == (0, "3.0\n")
    assert "cannot be kept" in told
    assert "File too large" in told


def test_an_error_in_a_step_is_told_when_its_module_is_imported() -> None:
    def wrong(value: float) -> float:
        return value + "one"  # type: ignore[operator]

    with pytest.raises(Exception, match="No implementation of function"):
        compiled("float64")(wrong)


def test_without_the_compiler_it_is_plain_python() -> None:
    program = (
        "from hal.compiled import compiled\n"
        "step = compiled('float64')(lambda value: type(value).__name__)\n"
        "assert step('text') == 'str'\n"
    )
    environment = {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(Path(__file__).resolve().parents[3])}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def modules() -> Iterator[ModuleType]:
    for package in (hal, vision, sim, controller):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not found.name.endswith("__main__"):
                yield importlib.import_module(found.name)


def steps() -> list[Any]:
    """Every compiled step of the project, and what is inlined into one."""
    return [
        step
        for module in modules()
        for step in vars(module).values()
        if isinstance(step, Dispatcher) and step.py_func.__module__ == module.__name__
    ]


# Parts that more than one file needs; a step may call none of another file.
COPIES = {"_cell", "_lead", "_led"}


def test_copies_of_a_part_are_the_same_word_for_word() -> None:
    found: dict[str, list[str]] = {name: [] for name in COPIES}
    for step in steps():
        name = step.py_func.__name__
        if name in COPIES:
            (function,) = ast.parse(inspect.getsource(step.py_func)).body
            assert isinstance(function, ast.FunctionDef)
            found[name].append("\n".join(map(ast.unparse, function.body[1:])))
    assert {name: len(texts) > 1 and len(set(texts)) == 1 for name, texts in found.items()} == dict.fromkeys(
        COPIES, True
    )


def assigned_in(module: ModuleType) -> set[str]:
    """Names that are defined at the top of a module itself, not imported by it."""
    tree = ast.parse(inspect.getsource(module))
    names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    targets = [node.targets for node in tree.body if isinstance(node, ast.Assign)]
    return names | {
        name.id
        for several in targets
        for target in several
        for name in ast.walk(target)
        if isinstance(name, ast.Name)
    }


def test_what_a_step_calls_and_its_constants_stand_in_its_own_file() -> None:
    """It would go on with what these were before a change: only a change of its own file makes it anew. The
    same holds for a constant of its own that is reckoned from another file's."""
    own = {
        module.__name__: assigned_in(module)
        for module in {sys.modules[s.py_func.__module__] for s in steps()}
    }
    foreign = {
        (step.py_func.__module__, step.py_func.__name__, name)
        for step in steps()
        for name in step.py_func.__code__.co_names
        if isinstance(
            step.py_func.__globals__.get(name), Dispatcher | int | float | np.generic | np.ndarray | tuple
        )
        if name not in own[step.py_func.__module__]
    }
    assert len(steps()) > 10
    assert foreign == set()
    assert reckoned_from_elsewhere() == set()


def reckoned_from_elsewhere() -> set[tuple[str, str]]:
    """Module and constant, used by a step, of those that rest on a value of another module."""
    found = set()
    for step in steps():
        module = sys.modules[step.py_func.__module__]
        for node in ast.parse(inspect.getsource(module)).body:
            if not isinstance(node, ast.Assign) or not isinstance(node.targets[0], ast.Name):
                continue
            name = node.targets[0].id
            if name in step.py_func.__code__.co_names:
                used = {one.id for one in ast.walk(node.value) if isinstance(one, ast.Name)}
                imported = used - assigned_in(module) - {"np", "math", "range", "len", "tuple"}
                found |= {(module.__name__, name) for _ in imported}
    return found
