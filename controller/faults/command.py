"""`treadwatch faults`: runs every fault, prints the tables, and writes them into a page of results."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path

from config.app import HIL_BASES, hil_file
from controller.errors import UserError
from controller.faults.kills import KILLS, KillResult, run_kill
from controller.faults.trials import FAULTS, TrialResult, run_trial
from controller.terminal.outlet import say, say_result

HEADING = "## Faults"


@dataclass(frozen=True, slots=True)
class FaultsOptions:
    """The command line.

    kind: chassis for the faults of processes; None: these are left out.
    into: page that the tables are written to, if any.
    """

    kind: str | None
    into: Path | None


def run_faults(options: FaultsOptions) -> None:
    """Run all faults, print the tables. Raises ConfigError, HalError, UserError."""
    page = options.into
    if page is not None and not os.access(page if os.path.exists(page) else page.parent, os.W_OK):
        # Reported now, not after minutes of measuring.
        raise UserError(f"{page}: may not be written; name a page in a folder that exists")
    trials = []
    for kind in HIL_BASES:
        for fault in FAULTS:
            say(f"{kind}: {fault.name}", to_stderr=True)
            trials.append(run_trial(kind, fault))
    kills = []
    for name in KILLS if options.kind is not None else ():
        assert options.kind is not None
        say(f"{options.kind}, processes: {name}", to_stderr=True)
        kills.append(run_kill(options.kind, hil_file(options.kind), name))
    section = describe(trials, kills, options.kind)
    if options.into is not None:
        write_section(options.into, section)
    say_result(section)


def describe(trials: list[TrialResult], kills: list[KillResult], kind: str | None) -> str:
    """The section about faults, in Markdown."""
    lines = [
        HEADING,
        "",
        f"Made by `treadwatch faults{f' --processes {kind}' if kind else ''}`.",
        "",
        "In simulated time, from 0.5 m/s, with output guard, driver, link and emulated base.",
        "",
        "- mode, reason: what the driver reports.",
        "- stopped after, distance: from the fault until the simulated base stands still.",
        "- moved by itself: distance in the 3 s after the cause has gone, while 0.5 m/s is still commanded.",
        "- drives again: after a zero command and a person's consent.",
        "",
        "| chassis | fault | mode | reason | stopped after | distance | moved by itself | drives again |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for trial in trials:
        reason = trial.reason.removesuffix("; gone now, arm again to go on")
        stood = "never" if math.isnan(trial.stood_after_s) else f"{trial.stood_after_s:.2f} s"
        drives_again = "yes" if trial.drives_again else "**no**"
        lines.append(
            f"| {trial.kind} | {trial.fault} | {trial.mode.value} | {reason} | {stood} "
            f"| {trial.travelled_m:.2f} m | {trial.moved_after_m:.3f} m | {drives_again} |"
        )
    if kills:
        lines += [
            "",
            f"In real time, three processes ({kind} emulator, control, perception), from 0.3 m/s or more.",
            "The emulator prints its speed ten times per second; while it is frozen it prints nothing.",
            "",
            "| fault | base stood after | the mission ended with | exit code |",
            "|---|---|---|---|",
        ]
    for kill in kills:
        stood = "-" if kill.stood_after_s is None else f"{kill.stood_after_s:.1f} s"
        code = "-" if kill.exit_code is None else str(kill.exit_code)
        lines.append(f"| {kill.fault} | {stood} | {kill.ended or 'nothing: it was killed'} | {code} |")
    return "\n".join(lines) + "\n"


def write_section(path: Path, section: str) -> None:
    """Write the section into a page, in place of an earlier one. Raises UserError."""
    try:
        page = path.read_text(encoding="utf-8") if os.path.exists(path) else "# Measured results\n"
        found = re.search(rf"^{HEADING}\n", page, re.MULTILINE)
        if found is not None:
            before, after = page[: found.start()], page[found.end() :]
            following = re.search(r"^## ", after, re.MULTILINE)
            rest = after[following.start() :] if following else ""
            page = before + section + ("\n" + rest if rest else "")
        else:
            page = page.rstrip("\n") + "\n\n" + section
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise UserError(f"--into {path}: cannot be written ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise UserError(f"--into {path}: is no text in UTF-8 ({error.reason}); give another page") from error
