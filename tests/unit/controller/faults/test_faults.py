"""The table of faults: what each must lead to, and how it gets into the page."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from config.app import HIL_BASES
from controller.errors import UserError
from controller.faults.command import describe, write_section
from controller.faults.kills import DriveProcesses, KillResult
from controller.faults.trials import FAULTS, Fault, TrialResult, run_trial
from hal.types import ChassisMode

# The bases' own time-outs, and what 0.5 m/s needs to go at 2 m/s2 with a lag of 0.08 s, to 1 mm/s.
OWN_TIMEOUT_S = {"agilex": 0.5, "agilex-serial": 0.5, "roboclaw": 0.3, "roboteq": 0.3, "kobuki": 0.6}
STOPPING_S = 0.7


@pytest.mark.parametrize("kind", HIL_BASES)
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_of_every_chassis_ends_in_a_base_that_stands_until_consent(
    kind: str, fault: Fault
) -> None:
    result = run_trial(kind, fault)
    assert result.moved_after_m < 1e-3
    assert result.drives_again
    if fault.name == "stop is asked for":
        assert (result.mode, result.reason) == (ChassisMode.ARMED, "armed")
        assert result.stood_after_s > 1.5, "jerk-limited"
    else:
        assert result.mode in (ChassisMode.ESTOP, ChassisMode.LOST)
        assert result.stood_after_s < OWN_TIMEOUT_S[kind] + STOPPING_S + 0.1


TRIAL = TrialResult(
    "kobuki", "e-stop", ChassisMode.ESTOP, "bumper; gone now, arm again to go on", 0.6, 0.08, 0.0, True
)


def test_the_tables_say_never_and_no_where_a_base_did_not_come_to_rest_or_drive_again() -> None:
    lost = TrialResult("agilex", "unplugged", ChassisMode.LOST, "unplugged", math.nan, 1.0, 0.5, False)
    text = describe([TRIAL, lost], [KillResult("kill -9 of control", 1.04, None, None)], "agilex")
    assert "Made by `treadwatch faults --processes agilex`." in text
    assert "| kobuki | e-stop | e-stop | bumper | 0.60 s | 0.08 m | 0.000 m | yes |" in text
    assert "| agilex | unplugged | lost | unplugged | never | 1.00 m | 0.500 m | **no** |" in text
    assert "| kill -9 of control | 1.0 s | nothing: it was killed | - |" in text
    assert "In real time" not in describe([TRIAL], [], None)


def test_the_section_takes_the_place_of_the_old_one_and_of_nothing_else(tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    write_section(page, "## Faults\n\nfirst\n")
    assert page.read_text() == "# Measured results\n\n## Faults\n\nfirst\n"
    page.write_text("# Mine\n\n## Speed\n\n1\n\n## Faults\n\nold\n### part\n\n## Detection\n\n2\n")
    write_section(page, "## Faults\n\nnew\n")
    expected = "# Mine\n\n## Speed\n\n1\n\n## Faults\n\nnew\n\n## Detection\n\n2\n"
    assert page.read_text() == expected
    write_section(page, "## Faults\n\nnew\n")
    assert page.read_text() == expected
    with pytest.raises(UserError, match="cannot be written"):
        write_section(tmp_path, "## Faults\n")


def test_a_page_that_is_no_text_is_told_and_left_alone(tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    page.write_bytes(b"# Mine \xff\n")
    with pytest.raises(UserError, match="no text in UTF-8"):
        write_section(page, "## Faults\n")
    assert page.read_bytes() == b"# Mine \xff\n"


def test_a_deeper_heading_of_the_same_name_is_another_one(tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    page.write_text("# Mine\n\n### Faults\n\nof mine\n")
    write_section(page, "## Faults\n\nnew\n")
    assert page.read_text() == "# Mine\n\n### Faults\n\nof mine\n\n## Faults\n\nnew\n"


def processes(monkeypatch: pytest.MonkeyPatch, emulator: str) -> list[subprocess.Popen[str]]:
    """What a trio starts from now on: this program in place of the emulator, and one that waits."""
    started: list[subprocess.Popen[str]] = []
    popen = subprocess.Popen

    def start(arguments: list[str], **pipes: Any) -> subprocess.Popen[str]:
        program = emulator if "emulate" in arguments else "import time; time.sleep(600)"
        started.append(popen([sys.executable, "-c", program], **pipes))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    return started


def test_an_emulator_that_does_not_start_is_not_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    program = "import sys, time; print('no port', file=sys.stderr, flush=True); time.sleep(600)"
    started = processes(monkeypatch, program)
    with pytest.raises(UserError, match="the emulator did not start: no port"):
        DriveProcesses("agilex", Path("robot.yaml"))
    assert [one.poll() is not None for one in started] == [True]


def test_a_base_that_tells_nothing_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    told = "print('v 0.1 m/s, w 0 rad/s, x 0 m, y 0 m', flush=True)"
    program = f"import sys, time; print('emulating', file=sys.stderr, flush=True); {told}; time.sleep(600)"
    started = processes(monkeypatch, program)
    drive_processes = DriveProcesses("agilex", Path("robot.yaml"))
    try:
        assert drive_processes.wait_for_speed(lambda v_mps: v_mps == 0.1, 30.0) < 30.0
        began_s = time.monotonic()
        with pytest.raises(UserError, match=r"was not so within 0\.3 s"):
            drive_processes.wait_for_speed(lambda v_mps: v_mps == 0.1, 0.3)
        assert time.monotonic() - began_s < 30.0
    finally:
        drive_processes.close()
    assert all(one.poll() is not None for one in started)
