"""What a drive's exit code says, and that the help says the same."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from config.robot import Limits
from controller.base.drive_lifecycle import Outcome
from controller.cli.commands import cli
from controller.governor.command import Governing
from controller.mission.result import DriveResult, MissionResult
from controller.record.tally import SetpointTally
from tests.support.docs_pages import ROOT


def ended(kind: Any, outcome: Outcome, *, violations: int = 0, contacts: tuple[str, ...] = ()) -> Any:
    tally = SetpointTally(Limits(), 0.02)
    tally.violations = violations
    loop = SimpleNamespace(lifecycle=SimpleNamespace(outcome=outcome))
    simulation = SimpleNamespace(referee=SimpleNamespace(contacts=list(contacts)))
    more = {"inbox": None} if kind is Governing else {}
    return kind(setpoints=tally, loop=loop, simulation=simulation, **more)


@pytest.mark.parametrize(
    ("kind", "good"),
    [(MissionResult, {Outcome.REACHED, Outcome.STOPPED}), (Governing, {Outcome.STOPPED})],
)
def test_a_drive_succeeds_where_it_ended_as_asked_touched_nothing_and_kept_its_limits(
    kind: type[DriveResult], good: set[Outcome]
) -> None:
    assert {outcome for outcome in Outcome if ended(kind, outcome).succeeded} == good
    for outcome in good:
        assert not ended(kind, outcome, violations=1).succeeded
        assert not ended(kind, outcome, contacts=("a crate",)).succeeded
        cut_off = ended(kind, outcome)
        cut_off.cut_off.append("the disk is full")
        assert not cut_off.succeeded


@pytest.mark.parametrize("command", ["run", "govern"])
def test_the_help_tells_the_exit_codes(command: str) -> None:
    shown = " ".join(CliRunner().invoke(cli, [command, "--help"]).output.split())
    assert "Exit code 0 if" in shown
    assert "came to rest" in shown
    assert "nothing was touched, the limits were kept and all files were written; else 1." in shown


def test_the_readme_says_so() -> None:
    text = " ".join((ROOT / "README.md").read_text().split())
    assert "exit code of `treadwatch run` is - 0 if the robot reached its target, or came to rest" in text
    assert (
        "touched nothing, kept its limits and wrote all that it was to write; - 1 if not; - 2 for a" in text
    )
