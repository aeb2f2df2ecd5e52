"""`treadwatch replay` over the real recording that ships with the project."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from config.app import load_app, load_replay
from config.loader import CONFIG_DIR
from controller.base.ego_speed import EgoSpeed
from controller.errors import UserError
from controller.replay.command import ReplayOptions, recorded_mount, run_replay
from hal.cameras.tum_replay import TumReplay
from hal.cameras.tum_writer import TumWriter
from hal.types import GyroSamples, Pose
from tests.support.bags import camera_entries, write_bag
from tests.support.recordings import small_frame
from vision.scene import EgoMotion

DESK = Path(__file__).resolve().parents[3] / "recordings" / "desk_rpy"


@pytest.mark.parametrize(
    ("odometry", "used"),
    [("auto", "none: the camera's motion is estimated"), ("groundtruth", "groundtruth.txt: 33 poses")],
)
def test_a_real_static_scene_from_a_moving_camera(
    odometry: str, used: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ReplayOptions(
        DESK,
        odometry,  # type: ignore[arg-type]  # parametrize knows only str
        CONFIG_DIR / "replay.yaml",
        tmp_path / "o.jsonl",
        tmp_path / "v.mp4",
        quiet=True,
    )
    run_replay(options)
    frames = [json.loads(line) for line in (tmp_path / "o.jsonl").read_text().splitlines()]
    assert len(frames) == 10
    assert frames[0]["stamp"] == pytest.approx(1305031236.9, abs=1.0)
    assert all(frame["timing_ms"]["detect"] > 0.0 for frame in frames)
    # Nothing moves on this desk but the camera.
    assert not any(obstacle["moving"] for frame in frames for obstacle in frame["obstacles"])
    # It stands there, though, and is seen.
    assert len(frames[-1]["obstacles"]) > 0
    for frame in frames:
        for obstacle in frame["obstacles"]:
            assert all(math.isfinite(value) for value in obstacle["position"] + obstacle["velocity"])
            assert 0.0 <= obstacle["score"] <= 1.0
    assert (tmp_path / "v.mp4").stat().st_size > 10_000
    summary = capsys.readouterr().out
    assert "10 frames, 0.30 s; 0 skipped" in summary
    assert "0 of them moving" in summary
    assert f"odometry    {used}" in summary


def test_two_replays_see_the_same(tmp_path: Path) -> None:
    seen = []
    for name in ("a.jsonl", "b.jsonl"):
        run_replay(ReplayOptions(DESK, "none", CONFIG_DIR / "replay.yaml", tmp_path / name, quiet=True))
        frames = [json.loads(line) for line in (tmp_path / name).read_text().splitlines()]
        seen.append([{**frame, "timing_ms": None} for frame in frames])
    assert seen[0] == seen[1]


def moved(ahead_m: float, source: str = "visual") -> EgoMotion:
    """The camera went ahead_m along its axis within 0.1 s."""
    return EgoMotion(Pose(np.eye(3), np.array([0.0, 0.0, ahead_m])), 0.1, source, 0.9, 0.01, 0.002)


def test_the_ego_speed_is_the_median_of_the_last_five() -> None:
    speed = EgoSpeed(None)
    assert speed.step(moved(0.0, source="none")) == 0.0
    assert speed.step(moved(0.1)) == pytest.approx(1.0)
    for ahead_m in (0.1, 9.0, 0.12, 0.08):
        last = speed.step(moved(ahead_m))
    assert last == pytest.approx(1.0)
    for _ in range(5):
        last = speed.step(moved(0.05))
    assert last == pytest.approx(0.5)


def test_a_camera_that_goes_back_has_no_speed_ahead() -> None:
    assert EgoSpeed(None).step(moved(-0.2)) == 0.0


def test_a_bag_is_seen_as_the_folder_with_the_same_frames(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frames = []
    with TumReplay(DESK) as recorded:
        for _ in range(5):
            frame = recorded.read(0.0)
            mm = np.rint(frame.depth * (1000.0 * frame.depth_scale_m)).astype(np.uint16)
            frames.append(replace(frame, depth=mm, depth_scale_m=0.001))
    with TumWriter(tmp_path / "folder") as writer:
        for frame in frames:
            writer.write(frame)
    bag = write_bag(tmp_path, "mcap", lambda ros: camera_entries(ros, frames))
    seen = []
    for recording in (tmp_path / "folder", bag):
        observations = tmp_path / f"{recording.name}.jsonl"
        run_replay(ReplayOptions(recording, "none", CONFIG_DIR / "replay.yaml", observations, quiet=True))
        lines = observations.read_text().splitlines()
        seen.append([{**json.loads(line), "timing_ms": None} for line in lines])
    assert len(seen[0]) == 5
    assert seen[0] == seen[1]
    assert "note        colour is /camera/color/image_raw" in capsys.readouterr().out


def test_odometry_of_another_time_is_not_called_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot whose clock is not the camera's."""
    with TumWriter(tmp_path) as writer:
        for number in range(3):
            writer.write(small_frame(number), Pose(np.eye(3), np.zeros(3)) if number == 0 else None)
    run_replay(ReplayOptions(tmp_path, "auto", CONFIG_DIR / "replay.yaml", quiet=True))
    assert "odometry.txt: 1 poses; of the time of 2 of 3 frames there is none" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("late_ns", "told"),
    [
        (0, "odometry    none; gyro.txt: 9 readings of a gyro\n"),
        (10**9, "gyro.txt: 9 readings of a gyro; of the time of 3 of 3 frames there is none\n"),
    ],
)
def test_the_gyro_of_a_recording_is_used_unless_it_is_of_another_time_or_not_wanted(
    late_ns: int, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with TumWriter(tmp_path) as writer:
        for number in range(3):
            stamps_ns = small_frame(number).captured_ns + late_ns + np.arange(3) * 10_000_000
            gyro = GyroSamples(stamps_ns, np.zeros((3, 3)))
            writer.write(replace(small_frame(number), gyro=gyro))
    run_replay(ReplayOptions(tmp_path, "auto", CONFIG_DIR / "replay.yaml", quiet=True))
    assert told in capsys.readouterr().out
    run_replay(ReplayOptions(tmp_path, "auto", CONFIG_DIR / "replay.yaml", quiet=True, use_gyro=False))
    assert "readings of a gyro" not in capsys.readouterr().out


def test_a_video_plays_at_the_pace_of_the_recording(tmp_path: Path) -> None:
    with TumWriter(tmp_path / "slow") as writer:
        for number in range(4):
            writer.write(replace(small_frame(number), captured_ns=number * 125_000_000))
    video = tmp_path / "v.mp4"
    run_replay(ReplayOptions(tmp_path / "slow", "auto", CONFIG_DIR / "replay.yaml", video=video, quiet=True))
    assert cv2.VideoCapture(str(video)).get(cv2.CAP_PROP_FPS) == pytest.approx(8.0)


@pytest.mark.parametrize("name", ["camera.yaml", "rgb.txt", "rgb"])
def test_an_output_that_is_part_of_the_recording_is_refused(name: str, tmp_path: Path) -> None:
    recording = Path(shutil.copytree(DESK, tmp_path / "desk"))
    target = recording / name
    target = sorted(target.iterdir())[0] if target.is_dir() else target
    before = target.read_bytes()
    with pytest.raises(UserError, match="is part of the recording; name another file"):
        run_replay(ReplayOptions(recording, "none", CONFIG_DIR / "replay.yaml", target, quiet=True))
    assert target.read_bytes() == before
    # Observations of an earlier replay beside it are no part of it.
    (recording / "seen.jsonl").write_text("before")
    run_replay(
        ReplayOptions(recording, "none", CONFIG_DIR / "replay.yaml", recording / "seen.jsonl", quiet=True)
    )
    assert len((recording / "seen.jsonl").read_text().splitlines()) == 10


def test_a_bag_is_not_overwritten_with_what_is_seen_in_it(tmp_path: Path) -> None:
    bag = tmp_path / "r.bag"
    bag.write_bytes(b"#ROSBAG V2.0")
    with pytest.raises(UserError, match=r"r\.bag: is part of the recording"):
        run_replay(ReplayOptions(bag, "none", CONFIG_DIR / "replay.yaml", video=bag, quiet=True))
    assert bag.read_bytes() == b"#ROSBAG V2.0"


def test_two_outputs_in_one_file_are_refused(tmp_path: Path) -> None:
    both = tmp_path / "s.webm"
    with pytest.raises(UserError, match="name two files"):
        run_replay(ReplayOptions(DESK, "none", CONFIG_DIR / "replay.yaml", both, both, quiet=True))
    assert not both.exists()


def test_the_summary_says_why_the_camera_cannot_be_trusted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Depth in metres taken for millimetres, or the other way round, is a common mistake."""
    recording = Path(shutil.copytree(DESK, tmp_path / "desk"))
    camera = recording / "camera.yaml"
    camera.write_text(re.sub("depth_factor: .*", "depth_factor: 1", camera.read_text()))
    run_replay(ReplayOptions(recording, "none", CONFIG_DIR / "replay.yaml", quiet=True))
    said = capsys.readouterr().out
    assert re.search(r"camera +10 untrustworthy; mostly: only 0\.0% of the depth image", said), said


@pytest.mark.parametrize(("pitch_deg", "told"), [(4.0, False), (14.0, True)])
def test_a_mounting_that_the_recording_knows_better_is_told(
    pitch_deg: float, told: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = Path(shutil.copytree(DESK, tmp_path / "rec"))
    camera = recording / "camera.yaml"
    camera.write_text(camera.read_text() + "camera_height_m: 0.6\ncamera_pitch_deg: 4.0\n")
    config = tmp_path / "mine.yaml"
    config.write_text(f"robot: {{camera_mount: {{height_m: 0.6, pitch_deg: {pitch_deg}}}}}\n")
    run_replay(ReplayOptions(recording, "none", config, quiet=True))
    summary = capsys.readouterr().out
    assert ("0.60 m high and tipped by 4.0 degrees, not where" in summary) is told
    assert re.search(r"decisions   10 keep; for a robot that drives straight ahead", summary)


@pytest.mark.parametrize("robots", [True, False])
def test_a_robot_s_yaml_knows_the_mounting_that_a_recording_does_not_tell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], robots: bool
) -> None:
    with TumWriter(tmp_path) as writer:
        writer.write(small_frame(0))
    path = CONFIG_DIR / ("robot-bunker.yaml" if robots else "replay.yaml")
    mount, config = load_app(CONFIG_DIR / "robot-bunker.yaml").robot.camera_mount, load_replay(path)
    used = recorded_mount(config, None)
    assert (None if used is None else used.height_m) == (mount.height_m if robots else None)
    run_replay(ReplayOptions(tmp_path, "auto", path, quiet=True))
    said = f"it is that of {path}, {mount.height_m:.2f} m high" if robots else "the floor is found in the"
    assert f"note        the recording does not give the camera's mounting: {said}" in capsys.readouterr().out
