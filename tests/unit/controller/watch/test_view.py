"""What is printed of the present, and at the end."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.base.drive_lifecycle import Outcome
from controller.control import ControlStep
from controller.realtime.messages import SceneMessage
from controller.terminal.console import Console
from controller.watch.command import build_watch_loop
from controller.watch.no_base import NoBase
from controller.watch.result import WatchResult
from controller.watch.summary import summary_rows
from controller.watch.view import View, base_text, obstacles_text
from hal.geometry import mount_of
from hal.types import CameraMount, ChassisMode, PlanarPose
from tests.support.runner_doubles import control_step
from tests.support.scenes import chassis_state, obstacle, scene
from vision.scene import CameraCondition, CameraHealth, SeenFloor

MS = 1_000_000
CONFIG = load_app(CONFIG_DIR / "sim-realtime.yaml")
LEVEL = CameraMount(0.45, 0.0, 0.6, 0.0)


def step_at(now_ns: int, heading_rad: float = 0.0) -> ControlStep:
    pose = PlanarPose(1.234, -0.5, heading_rad)
    state = chassis_state(now_ns, ChassisMode.STANDBY, 0.25, pose, "it answers")
    return replace(control_step(now_ns, None), chassis=state)


def message(number: int, floor: SeenFloor | None = None, health: CameraHealth | None = None) -> SceneMessage:
    seen = scene(number * 40 * MS, number, (obstacle(7, (-0.4, 0.0, 3.0), (0.6, 0.0, -0.8), True),))
    return SceneMessage(
        replace(seen, floor=floor, health=health or seen.health), {"detect": 4.0, "track": 2.0}
    )


def test_a_line_a_second_says_what_is_seen_and_heard(capsys: pytest.CaptureFixture[str]) -> None:
    result, view = WatchResult(mount=LEVEL), View(Console(quiet=False), CONFIG.robot.camera_mount)
    floor = SeenFloor(0, 0.55, math.radians(6.0), math.radians(-1.5))
    health = CameraHealth(CameraCondition.DEGRADED, "the lens is dirty", 0.9)
    for k in range(101):
        if k % 2 == 0:
            result.take_message(message(k, floor, health))
            view.take_message(message(k))
        result.take(step_at(k * 20 * MS))
        view.show(result, step_at(k * 20 * MS))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    parts = lines[1].split("  |  ")
    assert parts[0] == "   2.00 s  camera degraded (the lens is dirty); 25 frames/s, 6.0 ms each"
    assert parts[1] == (
        "floor 0.55 m below the camera, which looks down by 6.0 degrees and leans to its left by 1.5; "
        "0.60 m and 4.0 degrees are configured"
    )
    assert parts[2] == (
        "obstacles 1; nearest: moving 3.0 m ahead, 0.4 m to the left, 1.00 m/s (-0.8 ahead, -0.6 left)"
    )
    assert parts[3] == "decision would keep, 0.50 m/s straight ahead: nothing is in the way"
    assert parts[4] == "base standby (it answers); 48.0 V"
    assert parts[5].startswith(
        "odometry x 1.23 m, y -0.50 m, heading 0.0 degrees, turned by 0.0 in all; 0.25 m/s"
    )


def test_before_the_first_frame_only_the_base_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    result, view = WatchResult(mount=LEVEL), View(Console(quiet=False), CONFIG.robot.camera_mount)
    for k in range(51):
        result.take(step_at(k * 20 * MS))
        view.show(result, step_at(k * 20 * MS))
    assert capsys.readouterr().out.startswith(
        "   1.00 s  camera no frame yet  |  base standby (it answers); 48.0 V"
    )


def test_faults_of_the_base_are_told() -> None:
    state = replace(
        chassis_state(0, ChassisMode.ESTOP, reason="pressed"), battery_v=math.nan, faults=("hot",)
    )
    assert base_text(state) == "e-stop (pressed); hot"
    assert obstacles_text([]) == "none"


def test_two_turns_on_the_spot_are_720_degrees_and_give_the_slip_factor() -> None:
    """The images show 90 % of them: the tracks slip more than is configured."""
    loop, result = build_watch_loop(CONFIG, NoBase(), None), WatchResult(mount=mount_of(CONFIG.robot))
    result.take_message(message(0))
    for k in range(721):
        result.take(step_at(k * 20 * MS, math.remainder(math.radians(k), math.tau)))
    loop.localiser._sum_odometry_visual, loop.localiser._sum_odometry_odometry = 0.9, 1.0
    loop.request_stop("SIGINT received")
    rows = dict(summary_rows(CONFIG, loop, result))
    assert math.degrees(result.odometry_turn_rad) == pytest.approx(720.0)
    assert "turned by 720.0 in all" in rows["odometry"]
    assert rows["turns"] == (
        "720 degrees by the odometry, of which the images show 90.0%: chassis.slip_factor 1.11 would fit, "
        "1 is configured"
    )
    assert rows["watched"] == "14.4 s (SIGINT received); nothing was commanded"


def test_summary_tells_the_median_of_all_looks_at_the_floor() -> None:
    loop, result = build_watch_loop(CONFIG, NoBase(), None), WatchResult(mount=mount_of(CONFIG.robot))
    for k, height_m in enumerate((0.5, 0.62, 0.58, 0.6, 0.9)):
        for _ in range(3):  # a look is told with every frame until the next one
            result.take_message(message(k, SeenFloor(k, height_m, 0.0, 0.0)))
    loop.request_stop("done", Outcome.STOPPED)
    rows = dict(summary_rows(CONFIG, loop, result))
    assert rows["floor"].startswith("0.60 m below the camera")
    assert rows["floor"].endswith("median of 5 looks")
    assert rows["camera"] == "15 good"
    assert rows["obstacles"] == "1 tracked (ids), 1 of them moving; nearest 2.99 m ahead"
