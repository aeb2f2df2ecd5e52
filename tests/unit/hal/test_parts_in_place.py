"""Parts in place: they write to arrays that they are given, but neither make an array nor return one."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from hal.compiled import compiled, in_place
from hal.types import FloatArray


@in_place
def _double(values: FloatArray) -> tuple[int, float]:
    """How many values there are, and the last one after all were doubled."""
    for n in range(len(values)):
        values[n] *= 2.0
    return len(values), values[-1]


@compiled("float64[:, ::1]")
def _doubled_rows(values: FloatArray) -> tuple[FloatArray, int, float]:
    """(N, M) twice the values, how many there are, and the sum of the last ones of all rows."""
    result, count, total = values.copy(), 0, 0.0
    for i in range(len(values)):
        many, last = _double(result[i])
        count += many
        total += last
    return result, count, total


def test_a_part_in_place_writes_to_the_part_of_an_array_that_it_is_given() -> None:
    result, count, total = _doubled_rows(np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]))
    np.testing.assert_array_equal(result, [[2.0, 4.0], [6.0, 8.0], [10.0, 12.0]])
    assert (count, total) == (6, 24.0)


def test_what_was_given_to_a_part_in_place_is_not_freed_in_use() -> None:
    """Its memory would be given to the next result."""
    results = [_doubled_rows(np.full((4, 3), 0.5 * value))[0] for value in range(1000)]
    assert all((result == value).all() for value, result in enumerate(results))


def _first_half(values: FloatArray) -> FloatArray:
    return values[: len(values) // 2]


def _with_its_half(values: FloatArray) -> tuple[int, NDArray[np.float64]]:
    return len(values), values[: len(values) // 2]


@pytest.mark.parametrize("part", [_first_half, _with_its_half])
def test_a_part_in_place_that_may_return_an_array_is_refused(part: object) -> None:
    with pytest.raises(TypeError, match="half may return an array"):
        in_place(part)  # type: ignore[arg-type]


@in_place
def _makes_one(count: int) -> float:
    return float(np.zeros(count)[0])


def test_a_part_in_place_that_makes_an_array_is_refused_at_import() -> None:
    def step(count: int) -> float:
        return _makes_one(count)

    with pytest.raises(NumbaError, match="No implementation of function"):
        compiled("int64")(step)
