"""Short missions for hardware in the loop, and the emulator as a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest
import yaml

from config.loader import CONFIG_DIR
from hal.errors import HalError
from tests.support.chassis_rig import udp_link_config
from tests.support.wires import open_can_link


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
