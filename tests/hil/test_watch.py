"""`treadwatch watch` as a whole: in the simulation, at an emulated base that another program drives, and what
it answers to mistakes."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from config.loader import CONFIG_DIR
from tests.support.command_line import refusal, treadwatch
from tests.support.hil_missions import emulator, short_mission
from tests.support.recordings import small_frame


def summary_of(out: str) -> dict[str, str]:
    return {line.split(None, 1)[0]: line.split(None, 1)[1] for line in out.splitlines() if " " in line}


def test_the_simulated_warehouse_is_watched_and_nothing_moves(tmp_path: Path) -> None:
    seen, recorded = tmp_path / "seen.jsonl", tmp_path / "frames"
    done = treadwatch("watch", "--for", "3", "--observations", seen, "--record", recorded)
    assert done.returncode == 0, done.stdout + done.stderr
    # A slow disk may cost frames of the recording; that is told, and nothing else is.
    assert all("frames were left out" in line for line in done.stderr.splitlines()), done.stderr
    said = summary_of(done.stdout)
    assert "(watched for 3 s); nothing was commanded" in said["watched"]
    assert said["floor"].startswith("0.60 m below the camera, which looks down by 4.")
    assert said["odometry"].startswith("x 0.00 m, y 0.00 m, heading 0.0 degrees, turned by 0.0 in all")
    assert sum("camera good" in line for line in done.stdout.splitlines()) >= 2
    lines = [json.loads(line) for line in seen.read_text().splitlines()]
    assert len(lines) > 10
    assert any(line["decision"] is not None for line in lines)
    assert (recorded / "odometry.txt").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_as_asked(number: signal.Signals) -> None:
    command = [sys.executable, "-u", "-m", "controller", "watch", "--no-chassis"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert any("frames/s" in line for line in process.stdout)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert f"({number.name} received); nothing was commanded" in summary_of(out)["watched"]
    assert summary_of(out)["base"] == "standby (there is no base)"


def test_a_drive_of_another_program_is_watched_to_its_end_and_not_disturbed(tmp_path: Path) -> None:
    config = short_mission("agilex", tmp_path)
    arguments = [sys.executable, "-u", "-m", "controller"]
    with (
        emulator("agilex", config),
        subprocess.Popen(
            [*arguments, "watch", "--config", str(config)], stdout=subprocess.PIPE, text=True
        ) as watching,
    ):
        assert watching.stdout is not None
        assert any("standby (it answers)" in line for line in watching.stdout)
        drive = [*arguments, "run", "--config", str(config), "--quiet"]
        done = subprocess.run(drive, capture_output=True, text=True, timeout=90, check=False)
        watching.send_signal(signal.SIGTERM)
        out = watching.communicate(timeout=60)[0]
    assert "target reached; 1.50 m" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0
    assert watching.returncode == 0
    assert "another sender has sent" in out
    assert summary_of(out)["odometry"].startswith("x 1.5")


def robot_yaml(folder: Path, **changes: object) -> Path:
    robot = yaml.safe_load((CONFIG_DIR / "robot-roboclaw.yaml").read_text())
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(robot | changes))
    return path


def test_a_recording_stands_in_for_the_camera_and_ends_it(tmp_path: Path) -> None:
    from hal.cameras.tum_writer import TumWriter

    with TumWriter(tmp_path / "rec") as writer:
        for number in range(20):
            writer.write(small_frame(number))
    path = robot_yaml(tmp_path, camera={"kind": "replay", "folder": str(tmp_path / "rec")})
    done = treadwatch("watch", "--config", path, "--no-chassis", "--quiet")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "(the recording has ended)" in summary_of(done.stdout)["watched"]


def test_mistakes_are_one_line_each(tmp_path: Path) -> None:
    path = robot_yaml(tmp_path, camera={"kind": "replay", "folder": str(tmp_path / "none")})
    assert "none" in refusal("watch", "--config", path, "--no-chassis")
    told = refusal("watch", "--config", CONFIG_DIR / "sim.yaml")
    assert "runner.kind 'lockstep' is simulated time" in told
    assert "--for" in refusal("watch", "--for", "0")
    chassis = yaml.safe_load((CONFIG_DIR / "hil-roboclaw.yaml").read_text())
    chassis["chassis"]["link"]["url"] = str(tmp_path / "no-port")
    (tmp_path / "hil.yaml").write_text(yaml.safe_dump(chassis))
    told = refusal("watch", "--config", tmp_path / "hil.yaml")
    assert told.endswith("to look through the camera alone, add --no-chassis")
