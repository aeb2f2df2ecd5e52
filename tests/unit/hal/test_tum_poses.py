"""Camera poses from odometry.txt and groundtruth.txt."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hal.cameras.pose_file import PoseFile, open_odometry
from hal.cameras.pose_track import rotation_matrix
from hal.errors import BadRecording
from tests.support.recordings import DESK_RPY

S = 1_000_000_000
HALF = math.sqrt(0.5)  # sine and cosine of 45 degrees: a quarter turn as a quaternion


def poses(folder: Path, *lines: str) -> PoseFile:
    path = folder / "odometry.txt"
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines) + "\n")
    return PoseFile(path)


def test_a_pose_at_its_own_time_is_given_as_written(tmp_path: Path) -> None:
    pose = poses(tmp_path, f"1305031236.733922 1 2 3 0 0 {HALF} {HALF}").camera_pose(1305031236_733922000)
    assert pose is not None
    np.testing.assert_allclose(pose.translation_m, [1, 2, 3])
    np.testing.assert_allclose(pose.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


def test_between_two_poses_position_is_linear_and_attitude_turns_evenly(tmp_path: Path) -> None:
    file = poses(tmp_path, "0.0 0 0 0 0 0 0 1", f"0.1 1 -2 4 {HALF} 0 0 {HALF}")
    pose = file.camera_pose(25_000_000)
    assert pose is not None
    np.testing.assert_allclose(pose.translation_m, [0.25, -0.5, 1.0])
    # A quarter of a quarter turn about x: 22.5 degrees.
    c, s = math.cos(math.radians(22.5)), math.sin(math.radians(22.5))
    expected = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    np.testing.assert_allclose(pose.rotation, expected, atol=1e-12)


def test_the_turn_is_the_short_one_when_the_quaternions_sign_flips(tmp_path: Path) -> None:
    c, s = math.cos(math.radians(5)), math.sin(math.radians(5))
    pose = poses(tmp_path, "0.0 0 0 0 0 0 0 1", f"0.1 0 0 0 0 0 {-s} {-c}").camera_pose(S // 20)
    assert pose is not None
    np.testing.assert_allclose(pose.rotation[1, 0], math.sin(math.radians(5)), atol=1e-12)


def test_before_the_first_after_the_last_and_in_a_gap_nothing_is_known(tmp_path: Path) -> None:
    file = poses(tmp_path, "1.0 0 0 0 0 0 0 1", "1.2 0 0 0 0 0 0 1", "1.401 0 0 0 0 0 0 1")
    assert file.camera_pose(S - 1) is None
    assert file.camera_pose(1_401_000_001) is None
    assert file.camera_pose(1_100_000_000) is not None  # a gap of exactly 0.2 s is bridged
    assert file.camera_pose(1_300_000_000) is None  # 0.201 s is not
    assert file.camera_pose(1_200_000_000) is not None
    assert file.camera_pose(1_401_000_000) is not None


def test_a_written_quaternion_of_four_digits_gives_a_true_rotation(tmp_path: Path) -> None:
    pose = poses(tmp_path, "1 0 0 0 0.7006 0.6350 -0.2384 -0.2218").camera_pose(S)
    assert pose is not None
    np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-12)


def test_lines_out_of_order_are_sorted(tmp_path: Path) -> None:
    file = poses(tmp_path, "0.1 1 0 0 0 0 0 1", "0.0 0 0 0 0 0 0 1")
    pose = file.camera_pose(S // 20)
    assert pose is not None
    assert pose.translation_m[0] == pytest.approx(0.5)
    assert len(file) == 2


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("0.2 1 2 3 0 0 0", "has 7 columns, a pose is t tx ty tz qx qy qz qw"),
        ("0.2 1 2 3 0 0 0 1 9", "has 9 columns"),
        ("soon 1 2 3 0 0 0 1", "'soon' is not a time in seconds"),
        ("0.2 1 2 x 0 0 0 1", "not a number"),
        ("0.2 1 nan 3 0 0 0 1", "not finite"),
        ("0.2 1 2 3 0 0 inf 1", "not finite"),
        ("0.2 1 2 3 0 0 0 0", r"length 0\.000 instead of 1"),
        ("0.2 1 2 3 0.5 0.5 0.5 0.7", r"length 1\.114 instead of 1"),
        ("0.1 1 2 3 0 0 0 1", r"the time 0\.1 stands here for the second time"),
    ],
)
def test_a_bad_line_is_refused_with_file_and_line(tmp_path: Path, line: str, told: str) -> None:
    with pytest.raises(BadRecording, match=rf"odometry\.txt:3: .*{told}.*") as caught:
        poses(tmp_path, "0.1 0 0 0 0 0 0 1", line)
    assert "\n" not in str(caught.value)


def test_a_file_without_poses_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match="holds no pose"):
        poses(tmp_path)


def test_odometry_is_chosen_by_name(tmp_path: Path) -> None:
    assert open_odometry(tmp_path, "auto") is None
    assert open_odometry(tmp_path, "none") is None
    with pytest.raises(BadRecording, match=r"odometry\.txt: there is no such file"):
        open_odometry(tmp_path, "file")
    with pytest.raises(BadRecording, match=r"groundtruth\.txt: there is no such file"):
        open_odometry(tmp_path, "groundtruth")
    (tmp_path / "odometry.txt").write_text("0 1 0 0 0 0 0 1\n")
    (tmp_path / "groundtruth.txt").write_text("0 2 0 0 0 0 0 1\n")
    chosen = {name: open_odometry(tmp_path, name) for name in ("auto", "file", "groundtruth")}
    for name, x_m in (("auto", 1.0), ("file", 1.0), ("groundtruth", 2.0)):
        file = chosen[name]
        assert file is not None
        pose = file.camera_pose(0)
        assert pose is not None
        assert pose.translation_m[0] == x_m
    assert open_odometry(tmp_path, "none") is None


def test_the_real_recordings_poses_turn_as_its_readme_says() -> None:
    file = open_odometry(DESK_RPY, "groundtruth")
    assert file is not None
    first, last = file.camera_pose(1305031236_729693000), file.camera_pose(1305031237_029714000)
    assert first is not None
    assert last is not None
    turn = (first.inverse() @ last).rotation
    rate_degps = math.degrees(math.acos((np.trace(turn) - 1) / 2)) / 0.300021
    assert 50 < rate_degps < 62


unit_quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


@given(unit_quaternions)
def test_a_written_pose_is_read_back(tmp_path_factory: pytest.TempPathFactory, q: tuple[float, ...]) -> None:
    qx, qy, qz, qw = np.array(q) / math.hypot(*q)
    path = tmp_path_factory.mktemp("poses") / "odometry.txt"
    path.write_text(f"1.0 1.0 -2.0 3.5 {qx:.9f} {qy:.9f} {qz:.9f} {qw:.9f}\n")
    pose = PoseFile(path).camera_pose(S)
    assert pose is not None
    np.testing.assert_allclose(pose.rotation, rotation_matrix(np.array([qx, qy, qz, qw])), atol=1e-6)
    np.testing.assert_allclose(pose.translation_m, [1.0, -2.0, 3.5])


@given(unit_quaternions)
def test_a_quaternion_makes_a_rotation(q: tuple[float, ...]) -> None:
    rotation = rotation_matrix(np.array(q) / math.hypot(*q))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
