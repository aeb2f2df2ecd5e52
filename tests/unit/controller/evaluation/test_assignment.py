"""The assignment against all permutations."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.evaluation.assignment import assign
from hal.types import FloatArray

INF = math.inf


def best_of_all(cost: FloatArray) -> tuple[int, float]:
    """Most pairs, then least sum, by trying everything."""
    rows, columns = cost.shape
    best = (0, 0.0)
    for chosen in itertools.product(range(-1, columns), repeat=rows):
        taken = [column for column in chosen if column >= 0]
        if len(set(taken)) < len(taken):
            continue
        values = [cost[row, column] for row, column in enumerate(chosen) if column >= 0]
        if all(math.isfinite(value) for value in values):
            best = min(best, (-len(values), float(sum(values))))
    return -best[0], best[1]


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 4).flatmap(
        lambda columns: st.lists(
            st.lists(st.one_of(st.just(INF), st.floats(0.0, 5.0)), min_size=columns, max_size=columns),
            min_size=1,
            max_size=4,
        )
    )
)
def test_no_other_choice_has_more_pairs_or_as_many_for_less(rows: list[list[float]]) -> None:
    cost = np.array(rows)
    pairs = assign(cost)
    assert len({row for row, _ in pairs}) == len(pairs) == len({column for _, column in pairs})
    count, total = best_of_all(cost)
    assert len(pairs) == count
    assert sum(cost[pair] for pair in pairs) == pytest.approx(total, abs=1e-9)


def test_more_pairs_win_over_a_cheap_one() -> None:
    assert assign(np.array([[0.0, 1.0], [0.1, INF]])) == ((0, 1), (1, 0))


def test_where_no_pair_is_possible_nothing_is_assigned() -> None:
    assert assign(np.empty((0, 3))) == ()
    assert assign(np.empty((3, 0))) == ()
    assert assign(np.full((2, 2), INF)) == ()


@pytest.mark.parametrize("bad", [-1.0, math.nan])
def test_refuses_what_is_no_cost(bad: float) -> None:
    with pytest.raises(ValueError, match="zero or more"):
        assign(np.array([[bad]]))
