"""Totals of all rows of a campaign: by policy, and by family and policy."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

from controller.campaign.judge import Row
from controller.campaign.policies import POLICY_NAMES
from controller.campaign.task import failed, time_ratio


@dataclass(frozen=True, slots=True)
class Totals:
    """Totals of some missions of one policy.

    ratio_median, ratio_p90: time over the oracle's time, of missions whose target should be reached. inf if
        the percentile is a drive that did not arrive or had a contact at fault; None if there are no such
        missions.
    """

    missions: int
    expected: int
    reached: int
    contacts: int
    contacts_at_fault: int
    ratio_median: float | None
    ratio_p90: float | None
    time_median_s: float | None
    min_clearance_m: float | None
    false_stops: int
    missions_with_false_stop: int
    flaps: int
    reversals: int
    limit_violations: int
    max_jerk_mps3: float
    max_accel_mps2: float


def totals(rows: list[Row]) -> Totals:
    """The totals of rows of one policy."""
    ratios = [ratio for ratio in map(time_ratio, rows) if not math.isnan(ratio)]
    times = [row.time_s for row in rows if row.time_s is not None]
    clearances = [row.min_clearance_m for row in rows if math.isfinite(row.min_clearance_m)]
    return Totals(
        missions=len(rows),
        expected=sum(row.expected for row in rows),
        reached=sum(row.reached and row.expected for row in rows),
        contacts=sum(row.contacts for row in rows),
        contacts_at_fault=sum(row.contacts_at_fault for row in rows),
        ratio_median=_percentile(ratios, 50),
        ratio_p90=_percentile(ratios, 90),
        time_median_s=_percentile(times, 50),
        min_clearance_m=round(min(clearances), 4) if clearances else None,
        false_stops=sum(row.false_stops for row in rows),
        missions_with_false_stop=sum(row.false_stops > 0 for row in rows),
        flaps=sum(row.flaps for row in rows),
        reversals=sum(row.reversals for row in rows),
        limit_violations=sum(row.limit_violations for row in rows),
        max_jerk_mps3=max((row.max_jerk_mps3 for row in rows), default=0.0),
        max_accel_mps2=max((row.max_accel_mps2 for row in rows), default=0.0),
    )


def _percentile(values: list[float], percent: float) -> float | None:
    """The smallest value that this percentage of the values do not exceed. Not interpolated, because values
    may be infinite."""
    return round(float(np.percentile(values, percent, method="inverted_cdf")), 4) if values else None


@dataclass(frozen=True, slots=True)
class Summary:
    """The totals, and what happened in single missions.

    policies: by name. families: by family, then policy.
    failing: (family, seed, policy, what happened).
    not_at_fault: contacts that were not at fault: (family, seed, policy, body, speed of the robot in m/s).
    """

    policies: dict[str, Totals]
    families: dict[str, dict[str, Totals]]
    failing: list[tuple[str, int, str, str]]
    not_at_fault: list[tuple[str, int, str, str, float]]

    def as_dict(self) -> dict[str, object]:
        """The summary as a dictionary for summary.json."""
        return {
            "policies": {name: _json_values(one) for name, one in self.policies.items()},
            "families": {
                family: {name: _json_values(one) for name, one in by_policy.items()}
                for family, by_policy in self.families.items()
            },
            "failing": [
                {"family": family, "seed": seed, "policy": policy, "why": why}
                for family, seed, policy, why in self.failing
            ],
            "contacts_not_at_fault": [
                {"family": family, "seed": seed, "policy": policy, "body": body, "v_mps": v_mps}
                for family, seed, policy, body, v_mps in self.not_at_fault
            ],
        }


def _json_values(totals: Totals) -> dict[str, object]:
    """The totals for JSON, with null for infinity."""
    values = asdict(totals)
    return {key: None if value == math.inf else value for key, value in values.items()}


def summarise(rows: Iterable[Row]) -> Summary:
    """Summarise rows: policies and failures in the order of POLICY_NAMES, families in that of the rows."""
    rows = list(rows)
    driven = {row.policy for row in rows}
    # In their own order: the file of missions is sorted, so that "field" would come before "ours".
    policies = [name for name in POLICY_NAMES if name in driven]
    policies += sorted(driven - set(policies))
    families = list(dict.fromkeys(row.family for row in rows))
    return Summary(
        {name: totals([row for row in rows if row.policy == name]) for name in policies},
        {
            family: {
                name: totals([row for row in rows if row.policy == name and row.family == family])
                for name in policies
            }
            for family in families
        },
        [
            (row.family, row.seed, row.policy, why_failed(row))
            for row in sorted(rows, key=lambda row: policies.index(row.policy))
            if failed(row)
        ],
        [
            (row.family, row.seed, row.policy, body, v_mps)
            for row in rows
            for body, v_mps in zip(row.touched_not_at_fault, row.touched_at_mps, strict=True)
        ],
    )


def why_failed(row: Row) -> str:
    """Why a drive failed, in words; "" if it did not."""
    reasons = []
    if row.contacts_at_fault:
        reasons.append(f"touched {', '.join(row.touched)} while driving")
    if row.expected and not row.reached:
        reasons.append("did not reach its target")
    if row.limit_violations:
        reasons.append(f"{row.limit_violations} setpoints outside the limits")
    if row.reversals:
        reasons.append(f"{row.reversals} reversals")
    return "; ".join(reasons)
