import os
from collections.abc import Iterator
from typing import TextIO

import pytest

from controller.decision.decision import Action, Decision, Reason, Rule
from controller.terminal.console import Console


def decided(rule: Rule, number: int | None = None) -> Decision:
    return Decision(Action.DECREASE, 0.5, Reason(rule, f"because of {rule} {number}", obstacle_id=number))


def test_a_reason_is_told_once_when_it_has_settled(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(quiet=False)
    for step in range(100):
        console.decision(step * 0.02, decided("crossing", 3), 0.8)
    lines = capsys.readouterr().out.splitlines()
    assert lines == ["   0.50 s  0.80 m/s  decrease  because of crossing 3"]


def test_flickering_between_reasons_is_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(quiet=False)
    for step in range(100):
        console.decision(step * 0.02, decided("crossing", step % 2), 0.8)
    assert capsys.readouterr().out == ""


def test_a_robot_that_does_not_get_on_says_why_ever_more_rarely(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(quiet=False)
    for step in range(50 * 45):
        console.standing(100.0 + step * 0.02, step * 0.02, decided("static", 3))
    console.standing(146.0, 0.0, decided("free"))
    console.standing(160.0, 12.0, decided("static", 4))
    assert capsys.readouterr().out.splitlines() == [
        " 110.00 s  standing for 10 s, since 100.00 s: because of static 3",
        " 120.00 s  standing for 20 s, since 100.00 s: because of static 3",
        " 140.00 s  standing for 40 s, since 100.00 s: because of static 3",
        " 160.00 s  standing for 12 s, since 148.00 s: because of static 4",
    ]


def test_complaints_of_the_base_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    Console(quiet=False).complaints(12.5, ["warning: board warm", "battery low"])
    assert capsys.readouterr().out.splitlines() == [
        "  12.50 s  the base says: warning: board warm",
        "  12.50 s  the base says: battery low",
    ]


def test_the_voltage_stands_beside_a_complaint(capsys: pytest.CaptureFixture[str]) -> None:
    """A bit of a table that nobody has may mean an empty battery."""
    Console(quiet=False).complaints(12.5, ["system fault: unknown bit 0x0001"], 21.5)
    assert capsys.readouterr().out == (
        "  12.50 s  the base says: system fault: unknown bit 0x0001 (battery 21.5 V)\n"
    )


def test_quiet_leaves_only_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(quiet=True)
    console.event("something")
    console.progress(0.5, "half way")
    console.summary([("a", "1"), ("longer", "2")])
    captured = capsys.readouterr()
    assert captured.out == "a       1\nlonger  2\n"
    assert captured.err == ""


@pytest.fixture
def unread() -> Iterator[TextIO]:
    """A stream whose reader has gone."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as gone:
        yield gone


def test_a_reader_that_has_gone_is_told_once_on_standard_error_and_stops_nothing(
    unread: TextIO, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout", unread)
    console = Console(quiet=False)
    console.event("first")
    console.event("second")
    console.summary([("mission", "target reached")])
    unread.flush()
    assert capsys.readouterr().err.splitlines() == [
        "treadwatch: warning: nothing more can be written to standard output (Broken pipe)"
    ]


def test_a_standard_error_that_cannot_be_written_stops_nothing(
    unread: TextIO, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr", unread)
    console = Console(quiet=False)
    console.warning("the bend is blind")
    console.event("driving")
    unread.flush()
    assert capsys.readouterr().out.splitlines() == ["driving"]


def test_why_the_robot_comes_to_rest_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(quiet=False)
    for step in range(3):
        console.stopping(14.6 + step * 0.02, 0.9, "SIGTERM received")
    assert capsys.readouterr().out.splitlines() == ["  14.60 s  0.90 m/s  stops     SIGTERM received"]


def test_a_view_is_one_line_where_nobody_looks_at_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    Console(quiet=False).view(3.0, [("camera", "good"), ("base", "standby")])
    Console(quiet=True).view(3.0, [("camera", "good")])
    Console(quiet=False, aside=True).view(4.0, [("camera", "good")])
    out, err = capsys.readouterr()
    assert out == "   3.00 s  camera good  |  base standby\n"
    assert err == "   4.00 s  camera good\n"


def test_on_a_terminal_a_view_is_redrawn_in_place_and_never_over_an_event(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "31")
    console = Console(quiet=False)
    rows = [("camera", "good and a long text beside it"), ("base", "standby")]
    shown = "\r\033[Jcamera  good and a long text\n        beside it\nbase    standby\n"
    for back in ("", "\033[3A"):
        console.view(1.0, rows)
        assert capsys.readouterr().out == back + shown
    console.warning("the disk is full")
    capsys.readouterr()
    console.view(2.0, rows)
    assert capsys.readouterr().out == shown
