"""camera.yaml of a recording: what it may say, and how a mistake in it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.loader import ConfigError, load
from config.recording import RecordingCamera

PLAIN = {
    "width": "640",
    "height": "480",
    "fx": "517.3",
    "fy": "516.5",
    "cx": "318.6",
    "cy": "255.3",
    "depth_factor": "5000.0",
}


def read(folder: Path, **changes: str) -> RecordingCamera:
    path = folder / "camera.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in {**PLAIN, **changes}.items()))
    return load(path, RecordingCamera)


def test_the_seven_needed_keys_are_enough_and_the_rest_has_plain_defaults(tmp_path: Path) -> None:
    camera = read(tmp_path)
    assert (camera.width, camera.height) == (640, 480)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (517.3, 516.5, 318.6, 255.3)
    assert camera.depth_factor == 5000.0
    assert camera.distortion is None
    assert camera.depth_registered is True
    assert camera.camera_height_m is None
    assert camera.depth_min_m is None
    assert camera.depth_max_m is None
    assert camera.depth_intrinsics is None
    assert camera.ignored_keys == ()


def test_every_documented_key_is_read(tmp_path: Path) -> None:
    camera = read(
        tmp_path,
        distortion="[0.26, -0.95, -0.005, 0.0026, 1.16]",
        depth_registered="false",
        fps="30",
        camera_height_m="0.6",
        camera_pitch_deg="4",
        camera_forward_m="-0.2",
        depth_min_m="0.3",
        depth_max_m="10",
        depth_width="848",
        depth_height="480",
        depth_fx="385.0",
        depth_fy="386.0",
        depth_cx="420.0",
        depth_cy="240.0",
        depth_to_colour_translation_m="[0.015, 0, 0]",
        depth_to_colour_rotation="[0, -1, 0, 1, 0, 0, 0, 0, 1]",
    )
    assert camera.distortion == (0.26, -0.95, -0.005, 0.0026, 1.16)
    assert (camera.fps, camera.camera_height_m, camera.camera_pitch_deg) == (30, 0.6, 4)
    assert (camera.camera_forward_m, camera.depth_min_m, camera.depth_max_m) == (-0.2, 0.3, 10)
    assert camera.depth_intrinsics == (385.0, 386.0, 420.0, 240.0)
    assert (camera.depth_width, camera.depth_height) == (848, 480)
    assert camera.depth_to_colour_translation_m == (0.015, 0, 0)
    assert camera.depth_to_colour_rotation[1] == -1
    assert camera.ignored_keys == ()


def test_other_keys_are_noted_and_ignored(tmp_path: Path) -> None:
    camera = read(tmp_path, sensor="Kinect v1", exposure="{auto: true}")
    assert camera.ignored_keys == ("exposure", "sensor")


@pytest.mark.parametrize(
    ("written", "meant"), [("5e3", 5000.0), ("1e+3", 1000.0), ('"5000"', 5000.0), ("5000", 5000.0)]
)
def test_numbers_may_be_written_as_other_programs_write_them(
    tmp_path: Path, written: str, meant: float
) -> None:
    assert read(tmp_path, depth_factor=written).depth_factor == meant


def test_a_size_may_be_written_as_a_decimal_number(tmp_path: Path) -> None:
    assert read(tmp_path, width="640.0").width == 640


@pytest.mark.parametrize("written", ["[]", "null", "[0.1, 0.2, 0.0, 0.0]"])
def test_distortion_may_be_absent_or_end_before_k3(tmp_path: Path, written: str) -> None:
    camera = read(tmp_path, distortion=written)
    assert len(camera.distortion or ()) in (0, 4)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"fx": "wide"}, "fx: .*number, found 'wide'"),
        ({"fx": "0"}, "fx: .*greater than 0"),
        ({"fy": ".nan"}, "fy: .*finite"),
        ({"width": "640.5"}, "width: .*integer"),
        ({"width": "-640"}, "width: .*greater than or equal to 32"),
        ({"height": "31"}, "height: .*greater than or equal to 32"),
        ({"depth_factor": "0"}, "depth_factor: .*greater than or equal to 1"),
        ({"depth_factor": "0.001"}, r"depth_factor: .*greater than or equal to 1, found 0\.001"),
        ({"depth_factor": "true"}, "depth_factor: .*number"),
        ({"cx": "700"}, "cx, cy must lie inside the 640x480 image"),
        ({"distortion": "[0.1, 0.2]"}, r"distortion: must be \[k1, k2, p1, p2, k3\], found 2"),
        ({"distortion": "[0.1, 0.2, a, 0, 0]"}, r"distortion\.2: .*number"),
        ({"depth_registered": "perhaps"}, "depth_registered: .*boolean"),
        ({"camera_height_m": "0"}, "camera_height_m: .*greater than 0"),
        ({"camera_pitch_deg": "120"}, "camera_pitch_deg: .*90"),
        ({"depth_min_m": "4", "depth_max_m": "3"}, "depth_max_m must be greater than depth_min_m"),
        ({"depth_fx": "385"}, "depth_fx, depth_fy, depth_cx and depth_cy must be given together"),
        ({"depth_width": "848"}, "depth_width and depth_height must be given together"),
        ({"depth_to_colour_rotation": "[1, 0, 0, 0, 1, 0, 0, 0, 2]"}, "must be a rotation matrix"),
        ({"depth_to_colour_translation_m": "[1, 0]"}, "depth_to_colour_translation_m"),
    ],
)
def test_a_mistake_is_told_with_file_key_and_reason(
    tmp_path: Path, changes: dict[str, str], told: str
) -> None:
    with pytest.raises(ConfigError, match=told) as caught:
        read(tmp_path, **changes)
    assert str(tmp_path / "camera.yaml") in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", list(PLAIN))
def test_each_needed_key_is_needed(tmp_path: Path, key: str) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text("".join(f"{name}: {value}\n" for name, value in PLAIN.items() if name != key))
    with pytest.raises(ConfigError, match=f"{key}: missing key"):
        load(path, RecordingCamera)
