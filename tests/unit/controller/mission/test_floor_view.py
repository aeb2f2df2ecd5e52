"""A camera that sees the floor too far ahead is told before the drive."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from config.app import load_app
from config.camera import ReplayCameraConfig
from config.loader import CONFIG_DIR
from controller.mission.floor_view import floor_view_warning


def warning(height_m: float, pitch_deg: float, config: str = "sim.yaml") -> str | None:
    app = load_app(CONFIG_DIR / config)
    changes = {"height_m": height_m, "pitch_deg": pitch_deg}
    mount = type(app.robot.camera_mount).model_validate({**app.robot.camera_mount.model_dump(), **changes})
    return floor_view_warning(
        app.model_copy(update={"robot": app.robot.model_copy(update={"camera_mount": mount})})
    )


def test_a_high_level_camera_is_told_with_the_pitch_that_it_needs() -> None:
    """atan(240 / 610) = 21.5 degrees below the axis: floor from 1.6 / tan(21.5 degrees) = 4.07 m on."""
    told = warning(1.6, 0.0)
    assert told is not None
    assert "sees the floor only from 4.1 m on" in told
    needed_deg = math.ceil(math.degrees(math.atan(1.6 / 2.5)) - 21.48)
    assert f"a pitch_deg of at least {needed_deg} or mount it lower" in told
    assert warning(1.6, needed_deg) is None


def test_a_camera_that_looks_up_never_sees_the_floor() -> None:
    told = warning(0.6, -25.0)
    assert told is not None
    assert "never sees the floor" in told


@pytest.mark.parametrize(
    "config", ["sim.yaml", "robot-bunker.yaml", "robot-roboclaw.yaml", "robot-roboteq.yaml"]
)
def test_the_mountings_that_ship_are_low_enough(config: str) -> None:
    app = load_app(CONFIG_DIR / config)
    assert floor_view_warning(app) is None


def test_a_recording_tells_its_view_only_when_it_is_open(tmp_path: Path) -> None:
    app = load_app(CONFIG_DIR / "sim.yaml")
    recording = ReplayCameraConfig(folder=str(tmp_path))
    assert floor_view_warning(app.model_copy(update={"camera": recording})) is None
