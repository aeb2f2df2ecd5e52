"""The whole line: rendered frames, perception, decision, ruckig, CAN frames, emulated base."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from config.loader import CONFIG_DIR

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "controller", "run", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def rows(done: subprocess.CompletedProcess[str]) -> dict[str, str]:
    """The summary's rows by subject."""
    parts = [line.split(None, 1) for line in done.stdout.splitlines()]
    return {part[0]: part[1] for part in parts if len(part) == 2}


def test_two_runs_of_one_seed_write_the_same_bytes_and_reach_the_target(tmp_path: Path) -> None:
    written = []
    for name in ("a.jsonl", "b.jsonl"):
        scenario = SCENARIOS / "short_crossing.yaml"
        done = run("--scenario", scenario, "--observations", tmp_path / name, "--quiet")
        assert done.returncode == 0, done.stdout + done.stderr
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1]
    summary = rows(done)
    assert "target reached" in summary["mission"]
    assert summary["contacts"].startswith("0;")
    assert summary["limits"].startswith("kept")
    centimetres = float(summary["target"].split()[0])
    assert abs(centimetres) <= 2.0

    frames = [json.loads(line) for line in written[0].splitlines()]
    assert [frame["frame"] for frame in frames] == list(range(len(frames)))
    assert any(obstacle["moving"] for frame in frames for obstacle in frame["obstacles"])
    assert {frame["decision"]["action"] for frame in frames if frame["decision"]} == {
        "increase",
        "keep",
        "decrease",
    }
    # Time is simulated: a duration measured on this machine would differ from run to run.
    assert all(frame["timing_ms"] == {} for frame in frames)


def test_a_contact_is_told_and_makes_the_exit_code_1() -> None:
    done = run("--scenario", SCENARIOS / "rammed.yaml", "--quiet")
    assert done.returncode == 1, done.stdout + done.stderr
    assert rows(done)["contacts"].startswith("1 with hurrier")


def test_a_simulated_robot_that_waits_without_end_is_given_up(tmp_path: Path) -> None:
    config = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
    config["runner"]["max_standing_s"] = 3.0
    (tmp_path / "sim.yaml").write_text(yaml.safe_dump(config))
    done = run("--config", tmp_path / "sim.yaml", "--scenario", SCENARIOS / "blocked.yaml", "--quiet")
    assert done.returncode == 1, done.stdout + done.stderr
    told = rows(done)
    assert "broken off (stood for runner.max_standing_s of 3 s)" in told["mission"]
    # It waits for the last 3 s, and for half a second of being sure that it stands.
    assert float(told["mission"].partition(" m in ")[2].partition(" s")[0]) < 12.0


@pytest.mark.parametrize("config", ["sim-roboclaw.yaml"])
def test_another_chassis_is_another_yaml(config: str) -> None:
    done = run("--config", CONFIG_DIR / config, "--scenario", SCENARIOS / "short_crossing.yaml", "--quiet")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "target reached" in rows(done)["mission"]
