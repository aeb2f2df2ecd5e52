"""Ctrl-C at any time: one line, exit code 130, and what was done so far is kept."""

import multiprocessing
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import controller.mission.command
from controller.__main__ import main
from controller.campaign import command
from controller.campaign.judge import Row
from controller.campaign.plan import run_local
from controller.campaign.task import Task
from controller.errors import UserError
from controller.workers import held, worker_processes


def ended(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """The exit code of a command line."""
    monkeypatch.setattr(sys, "argv", ["treadwatch", *arguments])
    with pytest.raises(SystemExit) as exit_:
        main()
    assert isinstance(exit_.value.code, int)
    return exit_.value.code


def test_before_a_command_can_make_more_of_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(controller.mission.command, "run_mission", interrupted)
    assert ended(monkeypatch, "run") == 130
    assert capsys.readouterr().err.strip() == "treadwatch: interrupted"


def test_an_interrupt_inside_of_a_compiled_step_ends_like_any_other(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As CPython reports an exception that C code did not pass on."""

    def interrupted(*_: object) -> int:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr(controller.mission.command, "run_mission", interrupted)
    assert ended(monkeypatch, "run") == 130
    assert capsys.readouterr().err.strip() == "treadwatch: interrupted"


def test_other_system_errors_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> int:
        raise SystemError("broken")

    monkeypatch.setattr(controller.mission.command, "run_mission", broken)
    monkeypatch.setattr(sys, "argv", ["treadwatch", "run"])
    with pytest.raises(SystemError, match="broken"):
        main()


def test_while_the_program_is_still_being_imported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupting:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "controller.cli.commands":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "controller.cli.commands", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    assert ended(monkeypatch, "run") == 130
    assert capsys.readouterr().err.strip() == "treadwatch: interrupted"


def test_a_campaign_keeps_what_is_done_and_goes_on_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / "report"
    arguments = ["campaign", "--missions", "3", "--families", "empty_aisle", "--policies", "ours"]
    arguments += ["--workers", "1", "--quiet", "--report", str(report)]

    def interrupted_after_the_first(tasks: list[Task], workers: int) -> Iterator[list[Row]]:
        yield next(run_local(tasks, workers))
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(command, "run_local", interrupted_after_the_first)
        assert ended(patched, *arguments) == 130
    said = capsys.readouterr().err.strip()
    assert said == (
        f"treadwatch: interrupted: 1 drives are in {report}/missions.jsonl; "
        "the same command with --resume goes on"
    )
    first = (report / "missions.jsonl").read_text()
    assert ended(monkeypatch, *arguments, "--resume") == 0
    whole = (report / "missions.jsonl").read_text()
    assert whole.count("\n") == 3
    assert first in whole


def blocked() -> set[signal.Signals]:
    """What the process does not hear."""
    return {signal.Signals(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, ())}


def test_workers_do_not_hear_it_and_this_process_does() -> None:
    with worker_processes(1) as pool:
        assert signal.SIGINT in pool.submit(blocked).result()
    assert signal.SIGINT not in blocked()


def test_the_very_first_process_does_not_hear_it(tmp_path: Path) -> None:
    script = tmp_path / "first.py"
    script.write_text(
        "import multiprocessing, signal\n"
        "from controller.workers import held\n"
        "def tell() -> None:\n"
        "    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())\n"
        "    print(signal.SIGINT in blocked, signal.SIGHUP in blocked, flush=True)\n"
        "if __name__ == '__main__':\n"
        "    child = multiprocessing.get_context('spawn').Process(target=tell)\n"
        "    with held(signal.SIGINT, signal.SIGHUP):\n"
        "        child.start()\n"
        "    child.join()\n"
        "    tell()\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True", "False", "False"]


def test_interrupt_during_the_block_is_delivered_after_it() -> None:
    with pytest.raises(KeyboardInterrupt), held(signal.SIGINT):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize(
    ("number", "ended_by"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)]
)
def test_workers_end_at_once_whatever_they_are_doing(
    number: signal.Signals, ended_by: type[BaseException]
) -> None:
    def interrupted() -> None:
        with worker_processes(2) as pool:
            for _ in range(4):
                pool.submit(time.sleep, 600.0)
            signal.raise_signal(number)

    began_s = time.monotonic()
    with pytest.raises(ended_by):
        interrupted()
    assert multiprocessing.active_children() == []
    assert time.monotonic() - began_s < 60.0


def test_a_worker_that_dies_is_told() -> None:
    with pytest.raises(UserError, match="a worker process died"), worker_processes(1) as pool:
        pool.submit(signal.raise_signal, signal.SIGKILL).result()
