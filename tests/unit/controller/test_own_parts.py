"""Own parts that the camera does not see, or that hide too much of its image, are refused before a drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from config.app import load_app
from config.camera import RealsenseCameraConfig
from config.loader import CONFIG_DIR, ConfigError
from config.own_parts import OwnPart
from controller.build import require_camera
from controller.own_parts import require_own_parts_in_view
from hal.types import CameraMount, Intrinsics
from tests.support.command_line import refusal

SIM = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
DESK = Path(__file__).resolve().parents[2] / "recordings" / "desk_rpy"
VGA = Intrinsics(640, 480, 610.0, 610.0, 319.5, 239.5)
MOUNT = CameraMount(0.0, 0.0, 0.6, 0.0)
FILE = Path("robot.yaml")


def part(from_m: tuple[float, float, float], to_m: tuple[float, float, float]) -> OwnPart:
    return OwnPart(name="bumper", from_m=from_m, to_m=to_m)


SEEN = part((0.40, -0.35, 0.25), (0.51, 0.35, 0.45))
TOO_LOW = part((0.40, -0.35, 0.0), (0.51, 0.35, 0.10))
TOO_LARGE = part((0.20, -0.39, 0.10), (0.51, 0.39, 0.65))


def robot(folder: Path, own: OwnPart, **camera: object) -> Path:
    """The simulation's YAML with this part, and its camera at the turning centre."""
    path, content = folder / "robot.yaml", dict[str, Any](SIM)
    content["robot"] = {**SIM["robot"], "camera_mount": {"forward_m": 0.0, "height_m": 0.6, "pitch_deg": 4.0}}
    content["camera"] = {**(camera or SIM["camera"]), "own_parts": [own.model_dump(mode="json")]}
    path.write_text(yaml.safe_dump(content))
    return path


def test_what_is_in_view_is_taken() -> None:
    require_own_parts_in_view(FILE, [SEEN], MOUNT, VGA)
    require_own_parts_in_view(FILE, [], MOUNT, VGA)


def test_what_is_out_of_view_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"robot.yaml: camera.own_parts \('bumper'\): this box is nowhere in"
    ):
        require_own_parts_in_view(FILE, [SEEN, TOO_LOW], MOUNT, VGA)


def test_what_hides_more_than_half_of_the_image_is_refused_with_its_share() -> None:
    with pytest.raises(ConfigError, match="the boxes hide 82% of the image, and at most 50% may be"):
        require_own_parts_in_view(FILE, [TOO_LARGE], MOUNT, VGA)


def test_several_boxes_are_counted_together_and_once() -> None:
    """Each of the lower ones hides 19 % of the image, the upper one a half."""
    left, right = part((0.4, 0.0, 0.1), (0.5, 0.39, 0.55)), part((0.4, -0.39, 0.1), (0.5, 0.0, 0.55))
    require_own_parts_in_view(FILE, [left, left, right], MOUNT, VGA)
    upper = part((0.4, -0.39, 0.6), (0.5, 0.39, 0.9))
    with pytest.raises(ConfigError, match="the boxes hide 87% of the image"):
        require_own_parts_in_view(FILE, [left, right, upper], MOUNT, VGA)


def test_a_camera_that_is_not_open_yet_is_checked_by_its_nominal_view(tmp_path: Path) -> None:
    require_camera(load_app(robot(tmp_path, SEEN)))
    with pytest.raises(ConfigError, match="is nowhere in the camera's view"):
        require_camera(load_app(robot(tmp_path, TOO_LOW)))


def test_the_nominal_view_of_a_realsense_is_as_wide_as_it_says_elsewhere() -> None:
    for width, height in ((848, 480), (640, 480), (1280, 720)):
        camera = RealsenseCameraConfig(width=width, height=height)
        _, _, fx, fy, cx, _ = camera.nominal_view
        assert (cx + 0.5) / fx == pytest.approx(camera.edge_tangents[0])
        assert fy == fx == pytest.approx(1.28 * height, rel=0.01)


@pytest.mark.parametrize(
    ("own", "says"),
    [
        (TOO_LOW, "is nowhere in the camera's view"),
        (TOO_LARGE, "of the image, and at most 50% may be hidden"),
    ],
)
def test_a_drive_is_refused_in_one_line(tmp_path: Path, own: OwnPart, says: str) -> None:
    path = robot(tmp_path, own)
    line = refusal("run", "--config", path)
    assert line.startswith(f"treadwatch: {path}: camera.own_parts")
    assert says in line


def test_a_replay_is_refused_too(tmp_path: Path) -> None:
    assert "is nowhere in the camera's view" in refusal("replay", DESK, "--config", robot(tmp_path, TOO_LOW))


def test_a_replay_without_a_mounting_does_not_know_where_they_are(tmp_path: Path) -> None:
    path = tmp_path / "replay.yaml"
    path.write_text(yaml.safe_dump({"camera": {"own_parts": [SEEN.model_dump(mode="json")]}}))
    assert "camera.own_parts needs the camera's mounting" in refusal("replay", DESK, "--config", path)
