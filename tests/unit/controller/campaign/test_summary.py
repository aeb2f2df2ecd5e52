from __future__ import annotations

import math

import pytest

from controller.campaign.summary import summarise, totals
from tests.support.campaign import made_row


def test_totals_add_up_and_ratios_count_where_both_arrived() -> None:
    one = totals(
        [
            made_row(1),
            made_row(2, time_s=8.0, contacts=2, contacts_at_fault=1, min_clearance_m=-0.1),
            made_row(3, time_s=15.0, false_stops=2, flaps=1, max_jerk_mps3=2.0),
            made_row(4, reached=False, time_s=None),
            made_row(5, reached=False, expected=False, time_s=None, oracle_time_s=None),
        ]
    )
    assert (one.missions, one.reached, one.expected) == (5, 3, 4)
    assert (one.contacts, one.contacts_at_fault, one.min_clearance_m) == (2, 1, -0.1)
    assert one.ratio_median == pytest.approx(1.5)
    assert one.ratio_p90 == math.inf
    assert (one.false_stops, one.missions_with_false_stop, one.flaps, one.max_jerk_mps3) == (2, 1, 1, 2.0)


def test_failed_missions_are_listed_with_their_reason() -> None:
    summary = summarise(
        [
            made_row(1),
            made_row(2, contacts=1, contacts_at_fault=1, touched=("pallet",)),
            made_row(3, reached=False, time_s=None),
            made_row(4, reached=False, expected=False, time_s=None),
            made_row(5, limit_violations=3, reversals=1),
        ]
    )
    assert summary.failing == [
        ("crossing_left", 2, "ours", "touched pallet while driving"),
        ("crossing_left", 3, "ours", "did not reach its target"),
        ("crossing_left", 5, "ours", "3 setpoints outside the limits; 1 reversals"),
    ]
