"""Records: what a frozen dataclass promises, but that only mypy watches over its fields."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hal.records import record
from hal.types import FloatArray


@record(frozen=True, slots=True)
class _Place:
    x_m: float
    y_m: float = 0.0


@record(frozen=True, slots=True, eq=False)
class _Places:
    x_m: FloatArray


def test_two_that_say_the_same_are_equal_and_one_key() -> None:
    assert _Place(1.0) == _Place(1.0, 0.0) != _Place(2.0)
    assert {_Place(1.0): "here"}[_Place(1.0)] == "here"


def test_a_changed_copy_leaves_the_first_as_it_was() -> None:
    here = _Place(1.0)
    assert (replace(here, y_m=3.0), here) == (_Place(1.0, 3.0), _Place(1.0))


def test_records_of_arrays_are_themselves_only() -> None:
    x_m = np.zeros(2)
    assert _Places(x_m) != _Places(x_m)


def test_record_accepts_no_further_attributes() -> None:
    assert not hasattr(_Place(1.0), "__dict__")
