import json
import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from config.loader import CONFIG_DIR
from controller.decision.decision import Action, Decision, Reason
from controller.errors import UserError
from controller.record.observations import STANDARD_OUTPUT, ObservationFile, observation
from tests.support.scenes import obstacle, scene

SLOW = Decision(Action.DECREASE, 0.61999, Reason("crossing", "person 3 crosses in 2.1 s", obstacle_id=3))


def test_one_frame_has_the_documented_form() -> None:
    seen = scene(
        captured_ns=12_345_000_000,
        sequence=370,
        obstacles=(obstacle(3, (1.0, 0.5, 4.0), (-1.2, 0.0, 0.1), moving=True, score=0.97),),
    )
    assert observation(seen, SLOW, {"detect": 3.1004, "track": 0.4}) == {
        "stamp": 12.345,
        "frame": 370,
        "obstacles": [
            {
                "id": 3,
                "bbox": [300.0, 200.0, 340.0, 300.0],
                "position": [1.0, 0.5, 4.0],
                "velocity": [-1.2, 0.0, 0.1],
                "moving": True,
                "score": 0.97,
                "fragments": 12,
            }
        ],
        "decision": {
            "action": "decrease",
            "target_speed_mps": 0.62,
            "reason": "person 3 crosses in 2.1 s",
            "rule": "crossing",
            "obstacle": 3,
        },
        "camera": {"condition": "good", "reason": ""},
        "timing_ms": {"detect": 3.1, "track": 0.4},
    }


def test_a_recorded_time_keeps_its_microseconds() -> None:
    assert observation(scene(captured_ns=1_305_031_236_733_922_000), None, {})["stamp"] == 1305031236.733922


def test_unknown_value_is_null_not_zero() -> None:
    seen = scene(obstacles=(obstacle(velocity_mps=(math.nan, 0.0, math.inf)),))
    assert observation(seen, None, {})["obstacles"][0]["velocity"] == [None, 0.0, None]


def test_the_file_holds_one_json_line_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl"
    with ObservationFile(path) as sink:
        sink.write(scene(sequence=0), SLOW, {})
        sink.write(scene(sequence=1), None, {})
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["frame"] for line in lines] == [0, 1]
    assert lines[1]["decision"] is None


def test_old_content_is_replaced_by_the_first_line_and_not_before(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl"
    path.write_text("of the last run\n")
    with ObservationFile(path):
        pass
    assert path.read_text() == "of the last run\n"
    with ObservationFile(path) as sink:
        for number in (0, 1):
            sink.write(scene(sequence=number), SLOW, {})
    assert [json.loads(line)["frame"] for line in path.read_text().splitlines()] == [0, 1]


def test_a_place_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    with (
        pytest.raises(UserError, match=r"none/out\.jsonl: observations cannot be written"),
        ObservationFile(tmp_path / "none" / "out.jsonl"),
    ):
        pytest.fail("must not open")


def test_a_full_disk_is_told_in_one_line() -> None:
    with (
        pytest.raises(UserError, match=r"/dev/full: .*No space left") as caught,
        ObservationFile(Path("/dev/full")) as sink,
    ):
        sink.write(scene(), SLOW, {})
    assert "\n" not in str(caught.value)


def test_standard_output_gets_each_line_at_once(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "-").write_text("a file of this name is another thing\n")
    with ObservationFile(STANDARD_OUTPUT) as sink:
        for number in (0, 1):
            sink.write(scene(sequence=number), SLOW, {})
            assert json.loads(capfd.readouterr().out)["frame"] == number
    os.write(1, b"still open\n")
    assert capfd.readouterr().out == "still open\n"
    assert (tmp_path / "-").read_text() == "a file of this name is another thing\n"


@pytest.mark.parametrize("command", ["replay", "run"])
def test_a_pipe_gets_observations_and_nothing_else(command: str, tmp_path: Path) -> None:
    recording = Path(__file__).resolve().parents[3] / "recordings" / "desk_rpy"
    config = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
    config["runner"]["max_duration_s"] = 0.7
    (tmp_path / "sim.yaml").write_text(yaml.safe_dump(config))
    arguments = [str(recording)] if command == "replay" else ["--config", str(tmp_path / "sim.yaml")]
    done = subprocess.run(
        [sys.executable, "-m", "controller", command, *arguments, "--observations", "-"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    frames = [json.loads(line)["frame"] for line in done.stdout.splitlines()]
    assert len(frames) >= 10
    assert frames == sorted(frames)
    assert "perception" in done.stderr


def test_a_reader_that_leaves_is_told_in_one_line() -> None:
    recording = Path(__file__).resolve().parents[3] / "recordings" / "desk_rpy"
    command = [sys.executable, "-m", "controller", "replay", str(recording), "--observations", "-", "--quiet"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        told = process.stderr.read()
        assert process.wait(timeout=120) == 2
    assert told == (
        "treadwatch: standard output: the reader of the observations has gone; write them to a file\n"
    )


def test_a_full_disk_cuts_no_line_off(tmp_path: Path) -> None:
    path = tmp_path / "o.jsonl"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with ObservationFile(path) as sink:
        sink.write(scene(), None, {})
        whole = path.read_text()  # at once
        assert whole.endswith("\n")
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 20, limits[1]))
        try:
            with pytest.raises(UserError, match=r"o\.jsonl: nothing more can be written \(File too large\)"):
                sink.write(scene(), None, {})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert path.read_text() == whole
        sink.write(scene(), None, {})
    assert path.read_text() == whole * 2
