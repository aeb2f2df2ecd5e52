"""docs/add-a-chassis.md: its code is a chassis, and every chassis that ships has gone all of its steps."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
import yaml

from config.app import HIL_BASES
from config.chassis import CHASSIS_KINDS, AnyChassisConfig
from config.loader import CONFIG_DIR
from controller.cli.emulate import FAULTS
from hal.chassis.driver import ChassisDriver, ChassisFeedback
from hal.links.scripted import serial_pair
from hal.types import Setpoint
from tests.support.chassis_rig import MS
from tests.support.contract_rigs import EMULATED
from tests.support.docs_page_chassis import PAGE, page_module
from tests.support.docs_pages import ROOT, changed, python_in, ruff_findings

KINDS = dict(zip(CHASSIS_KINDS, get_args(AnyChassisConfig), strict=True))


def read(path: str) -> str:
    return (ROOT / path).read_text()


def test_the_kinds_were_found() -> None:
    assert set(KINDS) >= {"agilex", "roboclaw", "roboteq", "kobuki"}


@pytest.mark.parametrize("method", PAGE.names(r"_\w+"))
def test_every_method_it_names_is_the_driver_s(method: str) -> None:
    assert hasattr(ChassisDriver, method)


@pytest.mark.parametrize("word", ["command_refusal", "stop_cause", "silence_hint"])
def test_page_names_the_fields_of_the_feedback(word: str) -> None:
    assert word in PAGE.quoted
    assert hasattr(ChassisFeedback, word)


def test_the_page_names_the_faults_that_the_emulator_takes() -> None:
    assert set(FAULTS) <= set(PAGE.quoted)


def test_the_commands_it_gives() -> None:
    assert "treadwatch emulate roboteq" in PAGE.quoted
    assert "treadwatch run --config config/hil-roboteq.yaml" in PAGE.quoted
    for option in ("--hil", "--channel", "--base", "--attended"):
        assert option in PAGE.text
        assert f'"{option}"' in read("tests/conftest.py"), option


def test_the_code_of_the_page_is_one_chassis_in_the_contract_suite() -> None:
    assert len(PAGE.files) == 4, "bytes, feedback, driver, emulator"
    assert len(PAGE.changes) == 2, "config, composition"
    assert {"page-scripted", "page-pty"} < set(EMULATED)
    page = page_module()
    assert issubclass(page.MinitrackChassis, ChassisDriver)
    assert page.drive(0.5, -0.25) == b"D 500 -250*DD\n"
    assert page.parse(b"S 1 -2 3 240*2C") == page.Status(1, -2, 3, 24.0)
    assert page.parse(b"S 1 -2 3 240*FC") is None


@pytest.mark.parametrize(("noise", "advice"), [(b"", "check port, power"), (b"~" * 50, "check baud")])
def test_a_line_where_nobody_of_its_kind_answers_is_told(noise: bytes, advice: str) -> None:
    """As tests/contract/test_wrong_device.py asks of every kind that ships."""
    page = page_module()
    link, _ = serial_pair()
    config = {"kind": "minitrack", "link": {"url": "loop://"}, "counts_per_m": 2000.0, "track_width_m": 0.5}
    chassis = page.MinitrackChassis(link, page.MinitrackConfig.model_validate(config))
    chassis.arm(0)
    link.deliver(noise)
    for now_ns in range(20 * MS, 5000 * MS, 20 * MS):
        state = chassis.exchange(Setpoint(now_ns, 0.0, 0.0, 0.0), now_ns)
    assert advice in state.reason


def test_its_lines_still_fit_once_another_kind_was_added() -> None:
    name, change = PAGE.changes[0]
    last = "    | KobukiChassisConfig\n"
    text = read(name).replace(last, f"{last}    | MyConfig\n")
    assert f"{last}    | MinitrackConfig\n    | MyConfig\n)" in changed(text, change, name)


def test_a_line_that_has_changed_is_told_with_its_page_and_file() -> None:
    name, change = PAGE.changes[0]
    text = read(name).replace("    | KobukiChassisConfig\n", "")
    with pytest.raises(LookupError) as told:
        changed(text, change, f"{PAGE.name}: {name}")
    assert str(told.value) == (
        "docs/add-a-chassis.md: config/chassis.py: this line has changed, change it on the page too: "
        "    | KobukiChassisConfig"
    )


def test_code_pasted_from_the_page_passes_the_checks_and_drives(tmp_path: Path) -> None:
    PAGE.paste(tmp_path)
    assert not ruff_findings(tmp_path)
    config = yaml.safe_load(read("config/sim.yaml"))
    config["chassis"] = {
        "kind": "minitrack",
        "link": {"url": "loop://"},
        "counts_per_m": 2000.0,
        "track_width_m": 0.555,
        "slip_factor": 1.1,
    }
    config["runner"]["max_duration_s"] = 3.0
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(config))
    done = python_in(tmp_path, "-m", "controller", "run", "--config", "mine.yaml", "--quiet")
    # It does not get to the end in 3 s, but it drives, as it is told to.
    assert done.returncode == 1, done.stdout + done.stderr
    driven_m = re.search(r"is over; ([0-9.]+) m in", done.stdout)
    assert driven_m is not None, done.stdout + done.stderr
    assert float(driven_m[1]) > 0.5
    assert "limits      kept" in done.stdout


STEPS = {
    "config/robot-*.yaml": lambda kind: any(
        f"kind: {kind}" in path.read_text() for path in CONFIG_DIR.glob("robot-*.yaml")
    ),
    "config/hil-*.yaml": lambda kind: f"kind: {kind}" in read(f"config/hil-{kind}.yaml"),
    "build_chassis.py": lambda kind: KINDS[kind].__name__ in read("controller/build_chassis.py"),
    "emulator": lambda kind: (ROOT / "sim/emulators" / f"{kind}.py").is_file(),
    "emulator by its bytes": lambda kind: (ROOT / f"tests/unit/sim/emulators/test_{kind}.py").is_file(),
    "driver by its bytes": lambda kind: (ROOT / f"tests/unit/hal/test_{kind}_chassis.py").is_file(),
    "rig": lambda kind: f"def {kind}_rig(" in read("tests/support/chassis_rig.py"),
    "contract": lambda kind: sum(name.startswith(f"{kind}-") for name in EMULATED) >= 2,
    "property": lambda kind: (
        f"def test_{kind}_driver_survives_any_" in read(f"tests/property/test_{kind}_properties.py")
    ),
    "own time-out": lambda kind: f'"{kind}": ' in read("tests/unit/controller/faults/test_faults.py"),
    "guard": lambda kind: f'"{kind}": {kind}_rig' in read("tests/unit/controller/base/test_guard.py"),
    "mission and faults": lambda kind: kind in HIL_BASES,
    "README": lambda kind: kind.lower() in read("README.md").lower(),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", STEPS)
def test_every_chassis_has_gone_every_step(kind: str, step: str) -> None:
    assert STEPS[step](kind)
