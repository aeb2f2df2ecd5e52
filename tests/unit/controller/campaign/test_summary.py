from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from controller.campaign.figures import _ratio_range
from controller.campaign.judge import Row
from controller.campaign.report import report_lines
from controller.campaign.store import parse_row
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


def test_our_failures_come_first_and_say_how_to_repeat_them() -> None:
    """A scenario file is named as it can be given: by its copy in the report's folder."""
    lost = [made_row(seed, contacts=1, contacts_at_fault=1, touched=("pallet",)) for seed in (1, 2)]
    yard = replace(lost[1], family="yard.yaml")
    summary = summarise([replace(lost[0], policy="field"), lost[0], replace(yard, policy="field"), yard])
    assert [one[2] for one in summary.failing] == ["ours", "ours", "field", "field"]
    only = "treadwatch campaign --mode noise --config robot.yaml --only"
    files = {"yard.yaml": "out/my report/scenarios/yard.yaml"}
    lines = report_lines(summary, "treadwatch campaign", [], only, files)
    assert any(f"`{only} MISSION --policies POLICY`" in line for line in lines)
    assert "| crossing_left:1 | ours | touched pallet while driving |" in lines
    assert "| 'out/my report/scenarios/yard.yaml':2 | ours | touched pallet while driving |" in lines


def hit(policy: str = "ours") -> Row:
    row = made_row(7, contacts=1, touched_not_at_fault=("pedestrian",), touched_at_mps=(0.41,))
    return replace(row, policy=policy)


def test_contacts_that_were_not_at_fault_are_listed() -> None:
    summary = summarise([made_row(1), hit()])
    assert summary.not_at_fault == [("crossing_left", 7, "ours", "pedestrian", 0.41)]
    text = "\n".join(report_lines(summary, "treadwatch campaign", [], "treadwatch campaign --only", {}))
    assert "| crossing_left:7 | ours | pedestrian | 0.41 |" in text


def test_such_a_contact_is_read_back_from_the_file() -> None:
    assert parse_row(json.loads(json.dumps(hit().as_dict()))) == hit()


def test_our_policy_comes_first_and_a_family_is_one_row() -> None:
    summary = summarise([hit("field"), hit("ours"), hit("another")])
    assert list(summary.policies) == ["ours", "field", "another"]
    lines = report_lines(summary, "treadwatch campaign", [], "treadwatch campaign --only", {})
    assert "|  | family | ours | field | another |" in lines
    assert sum(line.startswith("| 1 | crossing_left |") for line in lines) == 1


@pytest.mark.parametrize(
    ("ratios", "low", "high"),
    [([1.0, 1.34, math.inf], 0.9, 1.4), ([0.85, 1.02], 0.75, 1.2), ([1.0, 8.0], 0.9, 3.0), ([], 0.9, 1.2)],
)
def test_the_axis_of_times_holds_what_there_is(ratios: list[float], low: float, high: float) -> None:
    assert _ratio_range(ratios) == pytest.approx((low, high))
