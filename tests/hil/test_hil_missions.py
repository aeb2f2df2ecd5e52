"""A mission in real time, with the base emulated by another process: the whole program, over real links."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest
import yaml

from config.loader import CONFIG_DIR
from controller.faults.kills import KILLS, run_kill
from hal.errors import HalError
from hal.links.can_bus import open_can_link
from tests.support.chassis_rig import udp_link_config

QUICK = "agilex"


def short_mission(kind: str, folder: Path, length_m: float = 1.5) -> Path:
    """The file that ships, on a short straight path, with a link of its own and a small camera."""
    config = yaml.safe_load((CONFIG_DIR / f"hil-{kind}.yaml").read_text())
    scenario = yaml.safe_load((CONFIG_DIR / "scenarios" / "empty.yaml").read_text())
    scenario["path"] = {"segments": [{"kind": "line", "length_m": length_m}]}
    (folder / "short.yaml").write_text(yaml.safe_dump(scenario))
    config["simulation"]["scenario"] = str(folder / "short.yaml")
    config["camera"] |= {"width": 320, "height": 240, "fps": 15.0}
    config["runner"]["max_duration_s"] = 40.0
    link = config["chassis"]["link"]
    if "url" in link:
        link["url"] = str(folder / f"{kind}-{uuid4().hex[:8]}")
    else:
        bus = udp_link_config()
        try:
            with open_can_link(bus):
                link |= {"channel": bus.channel, "port": bus.port}
        except HalError as error:
            pytest.skip(f"no multicast on this machine: {error}")
    path = folder / "mission.yaml"
    path.write_text(yaml.safe_dump(config))
    return path


@contextmanager
def emulator(kind: str, config: Path) -> Iterator[subprocess.Popen[str]]:
    """`treadwatch emulate` as its own process, ready; killed if it is still there at the end."""
    command = [
        sys.executable,
        "-m",
        "controller",
        "emulate",
        kind.removesuffix("-serial"),
        "--config",
        str(config),
    ]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stderr is not None
            ready = process.stderr.readline()
            assert ready.startswith(f"emulating {kind.removesuffix('-serial')} on "), (
                ready + process.stderr.read()
            )
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("kind", ["agilex", "agilex-serial", "roboclaw", "roboteq", "kobuki"])
def test_the_mission_is_reached(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if kind != QUICK and not request.config.getoption("--hil"):
        pytest.skip("one kind is enough for every day; all of them with --hil")
    config = short_mission(kind, tmp_path)
    with emulator(kind, config) as process:
        drive = [sys.executable, "-m", "controller", "run", "--config", str(config), "--quiet"]
        done = subprocess.run(drive, capture_output=True, text=True, timeout=90, check=False)
        assert "target reached; 1.50 m" in done.stdout, done.stdout + done.stderr
        assert done.returncode == 0, done.stdout + done.stderr
        process.send_signal(signal.SIGTERM)
        told, complaints = process.communicate(timeout=10)
        assert (process.returncode, complaints) == (0, ""), complaints
        assert told.endswith("SIGTERM: ended\n")
    assert not list(tmp_path.glob(f"{kind}-*")), "the link to the port is gone"


@pytest.mark.parametrize("fault", KILLS)
def test_a_process_that_dies_or_hangs_leaves_a_base_that_stands(
    fault: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if not request.config.getoption("--hil"):
        pytest.skip("a quarter of a minute each; with --hil")
    result = run_kill("agilex", short_mission("agilex", tmp_path, 12.0), fault)
    if fault.startswith("kill -9 of the emulator"):
        assert result.stood_after_s is None
    else:
        assert result.stood_after_s is not None
        assert result.stood_after_s < 6.0
    asked = fault in ("SIGTERM to control", "perception frozen (SIGSTOP)")
    assert result.exit_code == (None if fault == "kill -9 of control" else 0 if asked else 1)
