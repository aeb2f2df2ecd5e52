"""summary.json, report.md and the figures of a campaign."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path

import cv2

from config.faults import Faults
from config.loader import CONFIG_DIR
from config.scenario import Scenario
from controller.campaign.figures import clearance_figure, family_figure, ratio_figure
from controller.campaign.judge import Row
from controller.campaign.own_scenarios import KEPT
from controller.campaign.summary import Summary, Totals, summarise
from controller.errors import UserError
from controller.evaluation.report import markdown

_MAX_FAILED_ROWS = 40  # that are listed in the report; missions.jsonl has all


def write_report(
    folder: Path,
    rows: Iterable[Row],
    command: str,
    only: str,
    own: Mapping[str, Scenario] | None = None,
) -> Summary:
    """Write everything except missions.jsonl. Raises UserError.

    command: the command that repeats it. only: the one that repeats one mission, without the mission.
    own: the scenario files that were driven, by their names.
    """
    rows, own = list(rows), own or {}
    summary = summarise(rows)
    driven = driven_rows(rows, own)
    files = {family: str(folder / KEPT / family) for family in own}
    content = {
        "command": command,
        "missions": len({(row.family, row.seed) for row in rows}),
        "driven": [dict(zip(_DRIVEN_HEADER, one, strict=True)) for one in driven],
    }
    try:
        (folder / "summary.json").write_text(
            json.dumps({**content, **summary.as_dict()}, indent=2) + "\n", encoding="utf-8"
        )
        lines = report_lines(summary, command, driven, only, files)
        (folder / "report.md").write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: the report cannot be written ({error.strerror})") from error
    for name, image in (
        ("ratio.png", ratio_figure(rows)),
        ("families.png", family_figure(summary)),
        ("clearance.png", clearance_figure(rows)),
    ):
        if not cv2.imwrite(str(folder / name), image):
            raise UserError(f"{folder / name}: cannot be written; is the disk full?")
    return summary


def config_option_text(config_path: Path) -> str:
    """The --config of a command that is repeated, with a space before it; "" for the default."""
    return "" if config_path == CONFIG_DIR / "sim.yaml" else f" --config {shlex.quote(str(config_path))}"


def driven_rows(rows: Iterable[Row], own: Mapping[str, Scenario]) -> list[list[str]]:
    """What was driven: family or file, what it is, its seeds, and how many missions."""
    seeds: dict[str, set[int]] = {}
    for row in rows:
        seeds.setdefault(row.family, set()).add(row.seed)
    return [
        [family, _what_it_is(family, own), _seeds_in_words(found), str(len(found))]
        for family, found in seeds.items()
    ]


def _what_it_is(family: str, own: Mapping[str, Scenario]) -> str:
    if family not in own:
        return "family"
    scenario = own[family]
    faults = [name for name in Faults.model_fields if getattr(scenario.faults, name) not in (None, ())]
    glass = [body.name for body in scenario.bodies if body.glass]
    parts = [f"{KEPT}/{family}", " ".join(scenario.description.split())]
    parts += [f"faults: {', '.join(faults)}"] if faults else []
    parts += [f"glass: {', '.join(glass)}"] if glass else []
    return "; ".join(part for part in parts if part)


def _seeds_in_words(seeds: set[int]) -> str:
    return str(min(seeds)) if len(seeds) == 1 else f"{min(seeds)} to {max(seeds)}"


def report_lines(
    summary: Summary, command: str, driven: list[list[str]], only: str, files: Mapping[str, str]
) -> list[str]:
    """The report as Markdown. command, only: as in write_report. files: the scenario files' paths by name."""
    lines = ["# Campaign", "", f"    {command}", ""]
    lines += markdown.section(
        "What was driven",
        """A family makes a world for each seed. A scenario file is one world: its seeds change the noise of
        the sensors, textures, and the starts of movers with start_jitter_s. Yaw slip and vibration occur with
        `--mode camera` only.""",
    )
    # A file name or a description may hold what ends a cell.
    lines += markdown.table(_DRIVEN_HEADER, [[cell.replace("|", "\\|") for cell in row] for row in driven])
    lines += markdown.section(
        "Policies",
        """Time is that of the drive over that of the oracle, which knows all motions in advance; a drive that
        did not arrive, or was at fault in a contact, counts as one that never does. A contact is at fault
        when the robot moved faster than 0.02 m/s and a driver with the same field of view and reaction
        avoids it. A time below 1 goes with a contact that was not at fault, for which the oracle waits.""",
    )
    lines += markdown.table(_HEADER, [[name, *_cells(one)] for name, one in summary.policies.items()])
    lines += markdown.picture("Time over the oracle's", "ratio.png")
    lines += markdown.picture("Smallest clearance", "clearance.png")
    lines += markdown.section(
        "Families",
        """An arrow above a bar: the median drive took longer than the figure shows, or never arrived. No bar:
        there is no time to compare, since something stands in the way for good.""",
    )
    lines += markdown.picture("Median time by family", "families.png")
    lines += _family_table(summary)
    lines += markdown.section(
        "Contacts that were not at fault",
        """At fault is a contact at which the robot moved and that a driver with the same field of view and
        reaction avoids; all others are listed here: somebody walked into the robot, or stepped out of what
        nobody could see. A negative clearance is how deep both outlines overlap at the deepest moment, since
        a simulated body does not stop at a contact.""",
    )
    lines += markdown.table(("mission", "policy", "body", "robot's speed m/s"), _not_at_fault(summary))
    lines += markdown.section(
        "What failed",
        f"Each can be driven again alone, for example: `{only} MISSION --policies POLICY`.",
    )
    shown = [
        [f"{shlex.quote(files.get(family, family))}:{seed}", policy, why]
        for family, seed, policy, why in summary.failing[:_MAX_FAILED_ROWS]
    ]
    lines += markdown.table(["mission", "policy", "why"], shown)
    if len(summary.failing) > _MAX_FAILED_ROWS:
        lines += [f"... and {len(summary.failing) - _MAX_FAILED_ROWS} more: see summary.json.", ""]
    return lines


def _family_table(summary: Summary) -> list[str]:
    """One row a family, one column a policy."""

    def cell(one: Totals) -> str:
        text = f"{number_or_never(one.ratio_median)}, {one.reached}/{one.expected}"
        return text + (f", {one.contacts_at_fault} at fault" if one.contacts_at_fault else "")

    rows = [
        [str(number), family, *(cell(by_policy[policy]) for policy in summary.policies)]
        for number, (family, by_policy) in enumerate(summary.families.items(), start=1)
    ]
    what = "Median time over the oracle's, and reached of those that should be; the rest is in summary.json."
    return [what, "", *markdown.table(("", "family", *summary.policies), rows)]


def _not_at_fault(summary: Summary) -> list[list[str]]:
    return [
        [f"{family}:{seed}", policy, body, f"{v_mps:.2f}"]
        for family, seed, policy, body, v_mps in summary.not_at_fault
    ]


_DRIVEN_HEADER = ("name", "what", "seeds", "missions")
_HEADER = (
    "policy", "missions", "reached", "contacts", "at fault", "median x", "p90 x", "clearance m",
    "false stops", "flaps", "reversals", "outside limits",
)  # fmt: skip


def _cells(totals: Totals) -> list[str]:
    return [
        str(totals.missions),
        f"{totals.reached}/{totals.expected}",
        str(totals.contacts),
        str(totals.contacts_at_fault),
        number_or_never(totals.ratio_median),
        number_or_never(totals.ratio_p90),
        number_or_never(totals.min_clearance_m),
        str(totals.false_stops),
        str(totals.flaps),
        str(totals.reversals),
        str(totals.limit_violations),
    ]


def number_or_never(value: float | None) -> str:
    """Two decimals; "-" for None, "never" for infinity."""
    if value is None:
        return "-"
    return f"{value:.2f}" if math.isfinite(value) else "never"
