from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from config.path import ArcSpec, LineSpec, PathSpec
from config.robot import Robot
from config.scenario import load_scenario
from controller.video.depth_view import colour_table
from sim.preview import _map, _routes, depth_colours, main, pose_along
from sim.world import World
from tests.support import video_moments

BEND = PathSpec(
    segments=(
        LineSpec(kind="line", length_m=2.0),
        ArcSpec(kind="arc", radius_m=3.0, angle_deg=-90.0),
        LineSpec(kind="line", length_m=1.0),
    )
)


def test_preview_holds_four_pictures(tmp_path: Path) -> None:
    out = tmp_path / "look.png"
    done = CliRunner().invoke(main, ["crossing", "--time", "4.0", "--along", "3.0", "--out", str(out)])
    assert done.exit_code == 0, done.output
    sheet = cv2.imread(str(out))
    assert sheet is not None
    assert sheet.shape == (960, 1696, 3)
    quarters = [sheet[v : v + 480, u : u + 848] for v in (0, 480) for u in (0, 848)]
    assert all(float(np.std(quarter)) > 10 for quarter in quarters)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("moon", "--out", "look.png"), "no such scenario"),
        (("empty", "--out", "no/such/folder/look.png"), "cannot be written"),
        (("empty", "--out", "look.txt"), "no kind of image"),
        (("empty", "--out", "look.png", "--time", "nan"), "--time: nan is no finite number"),
        (("empty", "--out", "look.png", "--along", "inf"), "--along: inf is no finite number"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: tuple[str, ...], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 2
    assert says in done.output
    assert len(done.output.strip().splitlines()) == 1


def test_the_map_shows_the_walls() -> None:
    scenario = load_scenario("empty")
    world, robot = World(scenario), Robot()
    plan = _map(world, robot, pose_along(scenario.path, 0.0), 0.0)
    room = scenario.room
    scale = min(848 / (room.x_max_m - room.x_min_m), 456 / (room.y_max_m - room.y_min_m))
    top = round(228 - 0.5 * scale * (room.y_max_m - room.y_min_m))
    assert (plan[max(top, 0) + 1, 100] < 100).all()


@pytest.mark.parametrize(
    ("along_m", "x_m", "y_m", "heading_deg"),
    [
        (-1.0, 0.0, 0.0, 0.0),
        (1.5, 1.5, 0.0, 0.0),
        (2.0 + 1.5 * math.pi, 5.0, -3.0, -90.0),
        (99.0, 5.0, -4.0, -90.0),
    ],
)
def test_pose_along_a_path_by_hand(along_m: float, x_m: float, y_m: float, heading_deg: float) -> None:
    pose = pose_along(BEND, along_m)
    assert (pose.x_m, pose.y_m) == pytest.approx((x_m, y_m))
    assert math.degrees(pose.heading_rad) == pytest.approx(heading_deg)


def test_depth_has_the_colours_of_the_video() -> None:
    """sim may not import controller, so the two are compared here."""
    depth = np.tile(np.linspace(100, 10_000, 320).astype(np.uint16), (240, 1))
    shown = depth_colours(replace(video_moments.frame(), depth=depth))[:200]
    levels = np.rint(depth[:200] / 10_000 * 255).astype(np.uint8)
    assert np.abs(shown.astype(int) - colour_table()[levels]).max() <= 8


def test_the_map_shows_the_route_of_a_mover() -> None:
    scenario = load_scenario("crossing")
    world = World(scenario)
    (route,) = _routes(world)
    first, last = world.bodies(0.0), world.bodies(29.5)
    mover = next(index for index, state in enumerate(first) if state.moves)
    assert route[0] == pytest.approx([first[mover].pose.x_m, first[mover].pose.y_m])
    assert route[-1] == pytest.approx([last[mover].pose.x_m, last[mover].pose.y_m])
    assert np.hypot(*(route[-1] - route[0])) > 2.0
