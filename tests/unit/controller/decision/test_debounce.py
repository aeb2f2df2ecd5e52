"""Flags that settle before they turn."""

from __future__ import annotations

import numpy as np

from controller.decision.debounce import Debounced

ONE = np.array([7])
YES, NO = np.array([True]), np.array([False])


def test_debounced_value_changes_only_after_it_has_settled() -> None:
    flags = Debounced(0.3)
    assert not flags.update(ONE, YES, NO, 10.0)[0]
    assert not flags.update(ONE, YES, NO, 10.29)[0]
    assert flags.update(ONE, YES, NO, 10.31)[0]
    assert flags.update(ONE, NO, NO, 10.4)[0]
    assert flags.update(ONE, NO, NO, 10.6)[0]
    assert not flags.update(ONE, NO, NO, 10.71)[0]


def test_a_break_starts_the_time_anew() -> None:
    flags = Debounced(0.3)
    flags.update(ONE, YES, NO, 0.0)
    flags.update(ONE, NO, NO, 0.2)
    assert not flags.update(ONE, YES, NO, 0.25)[0]
    assert not flags.update(ONE, YES, NO, 0.5)[0]


def test_a_time_in_which_nothing_is_looked_at_is_a_break_too() -> None:
    flags = Debounced(0.3)
    flags.update(ONE, YES, YES, 0.0)
    flags.update(ONE, NO, NO, 0.1)
    flags.pause()
    assert flags.update(ONE, NO, NO, 5.0)[0]
    assert not flags.update(ONE, NO, NO, 5.31)[0]


def test_a_yes_may_need_no_time() -> None:
    flags = Debounced(0.3)
    assert flags.update(ONE, YES, YES, 0.0)[0]


def test_a_no_may_need_no_time_either() -> None:
    flags = Debounced(0.3)
    flags.update(ONE, YES, YES, 0.0)
    assert not flags.update(ONE, NO, YES, 0.1)[0]


def test_each_id_has_its_own_state_and_lost_ids_are_forgotten() -> None:
    flags = Debounced(0.0)
    both = flags.update(np.array([1, 2]), np.array([True, False]), np.array([True, False]), 0.0)
    assert both.tolist() == [True, False]
    settled = Debounced(0.3)
    settled.update(ONE, YES, YES, 0.0)
    settled.update(np.zeros(0, np.int64), np.zeros(0, np.bool_), np.zeros(0, np.bool_), 0.1)
    assert not settled.update(ONE, YES, NO, 0.2)[0]
