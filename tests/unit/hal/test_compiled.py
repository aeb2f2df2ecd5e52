"""What a compiled step promises: ready at import, exact types, nothing changed, nothing stale."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
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


def test_step_is_compiled_with_a_message_if_it_cannot_be_cached(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A function of no file, for which the compiler finds no place."""
    monkeypatch.setattr("hal.compiled._warned", set())
    scope: dict[str, Any] = {}
    exec(compile("def twice(value):\n    return 2.0 * value\n", "<nowhere>", "exec"), scope)
    assert compiled("float64")(scope["twice"])(1.5) == 3.0
    compiled("float64")(scope["twice"])
    told = capsys.readouterr().err
    assert told.count("cannot be cached") == 1
    assert "NUMBA_CACHE_DIR" in told


STEP = """
from hal.compiled import compiled

@compiled("float64")
def twice(value):
    return 2.0 * value

print(twice(1.5))
"""


PARTS = """
from hal.compiled import inlined

TIMES = {times}

@inlined
def plus(value):
    return value + {plus}
"""

STEP_OF_PARTS = """
from hal.compiled import compiled, inlined
from parts import TIMES, plus

@inlined
def twice_plus(value):
    return 2.0 * plus(value)

@compiled("float64")
def step(value):
    return TIMES * twice_plus(value)

print(step(1.5))
"""


def run_step(folder: Path, most_bytes: int | None = None, text: str = STEP) -> tuple[int, str, str]:
    """Exit code, output and errors of a program with one step, whose compiled form is kept in folder; no file
    may grow beyond most_bytes."""
    program, root = folder / "step.py", str(Path(__file__).resolve().parents[3])
    program.write_text(text, encoding="utf-8")
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


def test_cached_step_is_rebuilt_when_a_part_or_constant_changes(tmp_path: Path) -> None:
    """A part, called by way of another one, and a constant, both of another file."""

    def told_with(times: float, plus: float) -> tuple[str, str]:
        (tmp_path / "parts.py").write_text(PARTS.format(times=times, plus=plus), encoding="utf-8")
        code, answer, told = run_step(tmp_path, text=STEP_OF_PARTS)
        assert code == 0
        return answer, told.partition(":")[0]

    assert told_with(1.0, 0.0) == ("3.0\n", "treadwatch")
    assert told_with(1.0, 0.0) == ("3.0\n", "")
    assert told_with(1.0, 0.5) == ("4.0\n", "treadwatch")
    assert told_with(3.0, 0.5) == ("12.0\n", "treadwatch")
    assert told_with(3.0, 0.5) == ("12.0\n", "")


@pytest.mark.parametrize("left_bytes", [0, 20])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_cache_is_read_again_and_rebuilt_if_damaged(tmp_path: Path, ending: str, left_bytes: int) -> None:
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
    assert "cannot be cached" in told
    assert "File too large" in told


def test_an_error_in_a_step_is_told_when_its_module_is_imported() -> None:
    def wrong(value: float) -> float:
        return value + "one"  # type: ignore[operator]  # wrong on purpose

    with pytest.raises(Exception, match="No implementation of function"):
        compiled("float64")(wrong)


def test_ctrl_c_waits_until_the_step_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    finish, finished = Dispatcher.compile, []

    def interrupted(step: Dispatcher, signature: object) -> None:
        signal.raise_signal(signal.SIGINT)
        finish(step, signature)
        finished.append(step)

    def twice(value: float) -> float:
        return 2.0 * value

    monkeypatch.setattr(Dispatcher, "compile", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            compiled("float64")(twice)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(finished) == 1


def test_handler_of_ctrl_c_that_is_not_python_s_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such a handler reads as None, and cannot be set again."""
    monkeypatch.setattr(signal, "getsignal", lambda _number: None)
    monkeypatch.setattr(signal, "signal", lambda *_: pytest.fail("the handler was replaced"))

    def thrice(value: float) -> float:
        return 3.0 * value

    assert compiled("float64")(thrice)(2.0) == 6.0


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


def steps() -> list[FunctionType]:
    """Every compiled step of the project, and what is inlined into one, as written."""
    written = [
        (module, step.py_func if isinstance(step, Dispatcher) else inspect.unwrap(step))
        for module in modules()
        for step in vars(module).values()
        if isinstance(step, Dispatcher) or takes_records(step)
    ]
    return [function for module, function in written if function.__module__ == module.__name__]


def takes_records(step: object) -> bool:
    return isinstance(step, FunctionType) and isinstance(step.__globals__.get("_step"), Dispatcher)


def test_a_step_reads_no_constant_by_way_of_a_module() -> None:
    """What is kept of it would not be made anew when that changes."""
    foreign = {
        (step.__module__, name)
        for step in steps()
        for name in step.__code__.co_names
        if isinstance(step.__globals__.get(name), ModuleType) and name not in ("np", "math")
    }
    assert len(steps()) > 10
    assert "out_of_view" in [step.__name__ for step in steps()]  # one that takes records
    assert foreign == set()


def test_a_step_has_no_code_within_its_code() -> None:
    """Constants that only a comprehension or an inner function reads would not be noticed, either."""
    nested = {
        (step.__module__, step.__name__)
        for step in steps()
        if any(isinstance(constant, CodeType) for constant in step.__code__.co_consts)
    }
    assert nested == set()
