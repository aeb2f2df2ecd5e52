"""Bends that the camera cannot see round: named before the drive, and only those."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from config.app import AppConfig, load_app
from config.loader import CONFIG_DIR
from controller.mission.blind_bends import blind_bend_warning, view_of
from controller.mission.command import run_mission
from controller.mission.options import MissionOptions

SCENARIOS = sorted((CONFIG_DIR / "scenarios").glob("*.yaml"))
ROBOTS = sorted(CONFIG_DIR.glob("robot-*.yaml"))


def segments(radius_m: float, angle_deg: float, line_m: float = 3.0) -> list[dict[str, object]]:
    line = {"kind": "line", "length_m": line_m}
    return [line, {"kind": "arc", "radius_m": radius_m, "angle_deg": angle_deg}, line]


def hall(folder: Path, radius_m: float, angle_deg: float, width: int = 848, seen_s: float = 60.0) -> Path:
    """A simulated robot in an empty hall with one bend in its path."""
    scenario = {
        "name": "hall",
        "description": "nothing stands here",
        "path": {"segments": segments(radius_m, angle_deg)},
        "room": {"x_min_m": -9.0, "x_max_m": 19.0, "y_min_m": -9.0, "y_max_m": 19.0},
        "bodies": [],
    }
    (folder / "hall.yaml").write_text(yaml.safe_dump(scenario))
    content = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
    content["simulation"]["scenario"] = "hall.yaml"
    content["camera"]["width"] = width
    content["runner"]["max_duration_s"] = seen_s
    (folder / "sim.yaml").write_text(yaml.safe_dump(content))
    return folder / "sim.yaml"


def warning(config: Path) -> str | None:
    return blind_bend_warning(load_app(config))


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda path: path.stem)
def test_shipped_paths_have_no_blind_bend(robot: Path) -> None:
    assert warning(robot) is None


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
def test_the_scenarios_that_ship_can_be_seen_round(scenario: Path) -> None:
    config = load_app(CONFIG_DIR / "sim.yaml")
    assert config.simulation is not None
    simulation = config.simulation.model_copy(update={"scenario": scenario.stem})
    assert blind_bend_warning(config.model_copy(update={"simulation": simulation})) is None


def test_a_tight_half_turn_is_named_with_what_would_do(tmp_path: Path) -> None:
    told = warning(hall(tmp_path, 1.5, 180.0))
    assert told is not None
    assert told.startswith(
        "hall.yaml: path.segments.1: a view of 69 degrees does not reach round this bend of "
    )
    assert "1.5 m radius: 5." in told
    assert "widen it to a radius of 1.7 m or more, or use a camera with a wider view" in told
    assert warning(hall(tmp_path, 1.7, 180.0)) is None
    assert warning(hall(tmp_path, 1.5, -180.0)) is not None


def test_a_short_bend_is_seen_round_however_tight(tmp_path: Path) -> None:
    """Its floor was seen before the robot came to it: a simulated one drives it."""
    assert warning(hall(tmp_path, 1.0, 90.0)) is None


def test_a_narrower_camera_needs_wider_bends(tmp_path: Path) -> None:
    assert warning(hall(tmp_path, 1.8, 180.0)) is None
    told = warning(hall(tmp_path, 1.8, 180.0, width=640))
    assert told is not None
    assert "a view of 55 degrees" in told


def test_a_bend_in_the_middle_of_a_long_path_is_found_where_it_is(tmp_path: Path) -> None:
    content = yaml.safe_load((CONFIG_DIR / "robot-bunker.yaml").read_text())
    content["path"] = {"segments": [*segments(4.0, 90.0, 60.0), *segments(1.4, 180.0, 50.0)]}
    file = tmp_path / "my-robot.yaml"
    file.write_text(yaml.safe_dump(content))
    told = warning(file)
    assert told is not None
    assert told.startswith(f"{file}: path.segments.4:")
    # 60 + 6.3 + 60 + 50 m lead to it.
    assert "17" in told.partition(" m along the path")[0].rpartition(" ")[2]


def test_the_views_of_a_realsense() -> None:
    path = CONFIG_DIR / "robot-bunker.yaml"
    content = yaml.safe_load(path.read_text())
    for width, height, degrees in ((848, 480, 69), (640, 480, 55), (1280, 720, 69), (1920, 1080, 69)):
        content["camera"] |= {"width": width, "height": height}
        view = view_of(AppConfig.model_validate(content))
        assert view is not None
        assert view.degrees == pytest.approx(degrees, abs=1.0)


def test_recording_in_place_of_the_camera_gives_no_warning(tmp_path: Path) -> None:
    content = yaml.safe_load((CONFIG_DIR / "robot-bunker.yaml").read_text())
    content["camera"] = {"kind": "replay", "folder": str(tmp_path)}
    content["path"] = {"segments": segments(1.5, 180.0)}
    config = AppConfig.model_validate(content)
    assert view_of(config) is None
    assert blind_bend_warning(config) is None


def test_a_mission_says_it_once_and_drives(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_mission(MissionOptions(hall(tmp_path, 1.5, 180.0, seen_s=0.1), quiet=True))
    said = capsys.readouterr()
    lines = said.err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("treadwatch: warning: hall.yaml: path.segments.1:")
    assert "mission" in said.out
