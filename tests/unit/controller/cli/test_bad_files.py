"""A file that cannot be read or written is one line on standard error: which, and why; exit code 2."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from config.loader import CONFIG_DIR
from tests.support.command_line import refusal, treadwatch

DESK = Path(__file__).resolve().parents[3] / "recordings" / "desk_rpy"


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return Path(shutil.copytree(DESK, tmp_path / "rec"))


def test_odometry_that_is_asked_for_and_not_there() -> None:
    message = refusal("replay", DESK, "--odometry", "file")
    assert "desk_rpy/odometry.txt: there is no such file; choose another odometry, or none" in message


@pytest.mark.parametrize("command", ["run", "replay"])
def test_a_video_of_an_unknown_kind(command: str) -> None:
    extra = [DESK] if command == "replay" else []
    told = refusal(command, *extra, "--video", "film.gif")
    assert "film.gif: '.gif' is no kind of video; end its name with one of .mp4" in told
    told = refusal(command, *extra, "--video", "film")
    assert "film: which kind of video is not said; end its name with one of .mp4" in told


def test_observations_in_a_folder_that_is_not_there(tmp_path: Path) -> None:
    assert "observations cannot be written" in refusal(
        "replay", DESK, "--observations", tmp_path / "no" / "o.jsonl"
    )


def test_a_recording_that_is_not_there() -> None:
    assert "nowhere" in refusal("replay", "nowhere")


def test_a_bag_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_text("these are notes")
    message = refusal("replay", tmp_path / "run.mcap")
    assert "run.mcap: cannot be read as a ROS bag" in message
    assert "ros2 bag info" in message


def test_topics_of_a_folder() -> None:
    assert "is no ROS bag, so it has no topics" in refusal("replay", DESK, "--depth-topic", "/depth")


def test_a_topic_of_odometry_that_is_not_wanted(tmp_path: Path) -> None:
    wish = ("--odometry", "none", "--odometry-topic", "/odom")
    assert "--odometry-topic has no effect" in refusal("replay", tmp_path / "run.mcap", *wish)


def test_a_topic_of_a_gyro_that_is_not_wanted(tmp_path: Path) -> None:
    wish = ("--no-gyro", "--gyro-topic", "/imu")
    assert "--gyro-topic has no effect" in refusal("replay", tmp_path / "run.mcap", *wish)


@pytest.mark.parametrize(
    ("option", "name", "told"),
    [
        ("--record", ".", "holds a recording already"),
        ("--observations", "nowhere/o.jsonl", "observations cannot be written there"),
        ("--video", "nowhere/v.mp4", "the video cannot be written there"),
    ],
)
def test_unwritable_recording_is_reported_before_the_robot_is_armed(
    option: str, name: str, told: str, recording: Path
) -> None:
    message = refusal("run", "--config", CONFIG_DIR / "sim-realtime.yaml", option, recording / name)
    assert told in message


@pytest.mark.parametrize("config", ["sim.yaml", "sim-realtime.yaml"])
def test_two_outputs_of_a_drive_in_one_file(config: str, tmp_path: Path) -> None:
    (tmp_path / "also.mp4").symlink_to(tmp_path / "both.mp4")
    outputs = ("--observations", tmp_path / "both.mp4", "--video", tmp_path / "also.mp4")
    message = refusal("run", "--config", CONFIG_DIR / config, *outputs)
    assert "both.mp4: cannot hold both the observations and the video; name two files" in message
    assert not (tmp_path / "both.mp4").exists()


def test_a_recording_in_place_of_the_camera_that_is_none(tmp_path: Path) -> None:
    robot = yaml.safe_load((CONFIG_DIR / "robot-roboclaw.yaml").read_text())
    robot["camera"] = {"kind": "replay", "folder": str(tmp_path / "nowhere")}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot))
    assert "nowhere: there is no such folder" in refusal("run", "--config", tmp_path / "robot.yaml")


def test_a_recording_without_its_calibration(recording: Path) -> None:
    (recording / "camera.yaml").unlink()
    assert "camera.yaml" in refusal("replay", recording)


def test_a_recording_with_a_bad_calibration(recording: Path) -> None:
    text = (recording / "camera.yaml").read_text()
    (recording / "camera.yaml").write_text(text.replace("fx: 517.3", "fx: -517.3"))
    message = refusal("replay", recording)
    assert "camera.yaml: fx:" in message
    assert "-517.3" in message


def test_true_poses_that_the_recording_does_not_have(recording: Path) -> None:
    (recording / "groundtruth.txt").unlink()
    assert "groundtruth.txt: there is no such file" in refusal(
        "replay", recording, "--odometry", "groundtruth"
    )


def test_a_recording_whose_images_all_have_another_size(recording: Path) -> None:
    text = (recording / "camera.yaml").read_text()
    (recording / "camera.yaml").write_text(text.replace("width: 640", "width: 848"))
    message = refusal("replay", recording)
    assert "none of the" in message


def test_bad_frames_are_skipped_counted_and_named(recording: Path) -> None:
    colour = sorted((recording / "rgb").iterdir())
    colour[2].write_bytes(colour[2].read_bytes()[:20_000])
    depth = sorted((recording / "depth").iterdir())
    shutil.copy(colour[5], depth[5])
    done = treadwatch("replay", recording, "--quiet")
    assert done.returncode == 0, done.stderr
    assert "2 skipped" in done.stdout
    assert colour[2].name in done.stdout
    assert depth[5].name in done.stdout


def test_a_page_that_cannot_be_written_is_told_before_anything_is_measured(tmp_path: Path) -> None:
    page = tmp_path / "nowhere" / "results.md"
    assert f"{page}: may not be written" in refusal("faults", "--into", page)


@pytest.mark.parametrize(
    "arguments",
    [
        ("replay", "{}"),
        ("replay", "{}.bag"),
        ("replay", DESK, "--video", "{}.mp4"),
        ("replay", DESK, "--observations", "{}"),
        ("evaluate", "{}", "--report", "{}"),
        ("run", "--scenario", "empty", "--record", "{}"),
        ("bench", "--json", "{}/figures.json"),
        ("faults", "--into", "{}/page.md"),
        ("emulate", "kobuki", "--channel", "{}"),
    ],
)
def test_a_path_that_may_not_even_be_looked_at(tmp_path: Path, arguments: tuple[str | Path, ...]) -> None:
    """The system refuses a name this long as it does one in a folder that belongs to somebody else."""
    nowhere = str(tmp_path / ("x" * 300))
    message = refusal(*(str(argument).format(nowhere) for argument in arguments))
    assert "x" * 300 in message


def onto_a_full_disk(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """What the command answers where its standard output cannot be written."""
    command = [sys.executable, "-m", "controller", *map(str, arguments)]
    with Path("/dev/full").open("w") as full:
        return subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120, check=False
        )


def test_a_disk_that_is_full_behind_standard_output_ends_no_replay() -> None:
    done = onto_a_full_disk("replay", DESK)
    assert done.returncode == 0
    assert done.stderr.splitlines() == [
        "treadwatch: warning: nothing more can be written to standard output (No space left on device)"
    ]


@pytest.mark.parametrize(
    "arguments", [("envelope",), ("--help",), ("--version",), ("run", "--help"), ("campaign", "-h")]
)
def test_a_result_that_cannot_be_written_is_refused(arguments: tuple[str, ...]) -> None:
    done = onto_a_full_disk(*arguments)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "treadwatch: standard output: cannot be written (No space left on device); "
        "make room, or send it elsewhere"
    ]


@pytest.mark.parametrize("arguments", [("envelope",), ("--help",)])
def test_a_reader_that_has_read_enough_hears_no_complaint(arguments: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "controller", *arguments]
    with os.fdopen(writer, "w") as unread:
        done = subprocess.run(
            command, stdout=unread, stderr=subprocess.PIPE, text=True, timeout=120, check=False
        )
    assert (done.returncode, done.stderr) == (1, "")
