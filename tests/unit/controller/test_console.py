import pytest

from controller.console import Console
from controller.decision import Action, Decision, Reason


def decided(rule: str, number: int | None = None) -> Decision:
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


def test_quiet_leaves_only_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(quiet=True)
    console.event("something")
    console.progress(0.5, "half way")
    console.summary([("a", "1"), ("longer", "2")])
    captured = capsys.readouterr()
    assert captured.out == "a       1\nlonger  2\n"
    assert captured.err == ""
