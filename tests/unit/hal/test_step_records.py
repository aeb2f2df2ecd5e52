"""Records as arguments of compiled steps: their fields are read by name, checked by type, and cached."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.perception import DepthNoise
from hal.compiled import compiled, inlined
from hal.types import Flags, FloatArray, Matrix, Vector

ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """N points. names has no type that the compiler knows."""

    xy_m: Matrix
    weight: Vector
    counts: Flags
    names: list[str]


@dataclass(frozen=True, slots=True)
class Line:
    slope: float
    offset_m: float
    order: int


@inlined
def _height_m(line: Line, x_m: float) -> float:
    return line.offset_m + line.slope * x_m


@compiled(Points, "float64", Line)
def _above(points: Points, margin_m: float, line: Line) -> tuple[FloatArray, float]:
    """How far the points (N,) that count are above the line and a margin, and the sum of their weights."""
    above_m, weight = np.zeros(len(points.xy_m)), 0.0
    for k in range(len(points.xy_m)):
        if points.counts[k]:
            above_m[k] = points.xy_m[k, 1] - _height_m(line, points.xy_m[k, 0]) - margin_m
            weight += points.weight[k]
    return above_m, weight


@compiled("float64", DepthNoise)
def _sigma_m(depth_m: float, noise: DepthNoise) -> float:
    return noise.floor_m + noise.quadratic_per_m * depth_m * depth_m


POINTS = Points(
    xy_m=np.array([[0.0, 1.0], [2.0, 5.0], [1.0, 1.0]]),
    weight=np.array([1.0, 2.0, 4.0]),
    counts=np.array([True, True, False]),
    names=["a", "b", "c"],
)
LINE = Line(slope=2.0, offset_m=0.5, order=1)


def test_fields_of_a_record_are_read_by_name() -> None:
    above_m, weight = _above(POINTS, 0.25, LINE)
    np.testing.assert_array_equal(above_m, [0.25, 0.25, 0.0])
    assert weight == 3.0


def test_record_may_be_a_section_of_the_settings() -> None:
    assert _sigma_m(2.0, DepthNoise(floor_m=0.01, quadratic_per_m=0.02)) == pytest.approx(0.09)


def test_step_takes_records_by_keyword_too() -> None:
    assert _above(line=LINE, points=POINTS, margin_m=0.25)[1] == 3.0


def test_strided_and_read_only_arrays_are_accepted_in_a_record() -> None:
    wide = np.zeros((3, 4))
    wide[:, ::2] = POINTS.xy_m
    wide.setflags(write=False)
    above_m, _ = _above(replace(POINTS, xy_m=wide[:, ::2]), 0.25, LINE)
    np.testing.assert_array_equal(above_m, [0.25, 0.25, 0.0])


@pytest.mark.parametrize("weight", [np.zeros(3, np.float32), np.zeros((3, 1)), [1.0, 2.0, 4.0]])
def test_array_of_another_type_in_a_record_is_refused(weight: Any) -> None:
    with pytest.raises(TypeError, match="No matching definition"):
        _above(replace(POINTS, weight=weight), 0.25, LINE)


def test_record_step_keeps_its_name_and_its_text() -> None:
    assert (_above.__module__, _above.__qualname__) == (__name__, "_above")
    assert (_above.__doc__ or "").startswith("How far the points")


def test_field_without_a_type_is_refused_when_the_step_is_made() -> None:
    def named(points: Points) -> int:
        return len(points.names)

    with pytest.raises(TypeError, match="reads names of points: Points declares no type"):
        compiled(Points)(named)


def test_record_of_which_nothing_is_read_is_refused() -> None:
    def idle(points: Points) -> int:
        return 0

    with pytest.raises(TypeError, match="reads no field of points"):
        compiled(Points)(idle)


def test_step_with_too_few_types_is_refused() -> None:
    def scaled(line: Line, by: float) -> float:
        return line.slope * by

    with pytest.raises(ValueError, match="zip"):
        compiled(Line)(scaled)


STEP = """
from dataclasses import dataclass
from hal.compiled import compiled
from parts import Line, height_m

@compiled("float64", Line)
def step(x_m, line):
    return height_m(line, x_m)

print(step(3.0, Line(2.0, 0.5)))
"""
PARTS = """
from dataclasses import dataclass
from hal.compiled import inlined

@dataclass
class Line:
    {first}: float
    {second}: float

@inlined
def height_m(line, x_m):
    return line.offset_m + line.slope * x_m
"""


def run(folder: Path, **environment: str) -> tuple[str, str]:
    """Output and errors of the program STEP, whose compiled form is kept in folder."""
    program = folder / "step.py"
    program.write_text(STEP, encoding="utf-8")
    os.utime(program, (1.0, 1.0))  # the cache of the step's own file is as old as the file in each run
    done = subprocess.run(
        [sys.executable, "-B", str(program)],
        env={"NUMBA_CACHE_DIR": str(folder / "kept"), "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout, done.stderr.partition(":")[0]


def test_cached_step_is_rebuilt_when_its_record_changes(tmp_path: Path) -> None:
    def answer(first: str, second: str) -> tuple[str, str]:
        (tmp_path / "parts.py").write_text(PARTS.format(first=first, second=second), encoding="utf-8")
        return run(tmp_path)

    assert answer("slope", "offset_m") == ("6.5\n", "treadwatch")
    assert answer("slope", "offset_m") == ("6.5\n", "")
    assert answer("offset_m", "slope") == ("3.5\n", "treadwatch")


def test_without_the_compiler_a_step_takes_records_too(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(PARTS.format(first="slope", second="offset_m"), encoding="utf-8")
    assert run(tmp_path, NUMBA_DISABLE_JIT="1") == ("6.5\n", "")
    assert not (tmp_path / "kept").exists()
