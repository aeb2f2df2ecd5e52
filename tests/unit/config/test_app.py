"""What the sections of one YAML have to agree on."""

from __future__ import annotations

import pickle
from itertools import count
from pathlib import Path

import pytest
import yaml

from config.app import AppConfig, load_app, load_replay
from config.loader import CONFIG_DIR, ConfigError
from hal.chassis.command import due
from hal.clocks import NS_PER_MS, NS_PER_S

SIM = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())


def speeds(reckoned_mps: float, believed_mps: float) -> dict[str, object]:
    return {
        "robot": {"limits": {"max_obstacle_speed_mps": reckoned_mps}},
        "perception": {"motion": {"max_speed_mps": believed_mps}},
    }


def written(folder: Path, content: dict[str, object]) -> Path:
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize("base", [SIM, {}], ids=["robot", "replay"])
def test_perception_must_believe_every_speed_that_the_decision_allows_for(
    tmp_path: Path, base: dict[str, object]
) -> None:
    load = load_app if base else load_replay
    load(written(tmp_path, base | speeds(2.0, 2.0)))
    load(written(tmp_path, base | speeds(1.5, 2.0)))
    with pytest.raises(ConfigError, match=r"max_speed_mps \(1\.5\) is less than .* \(2\)"):
        load(written(tmp_path, base | speeds(2.0, 1.5)))


@pytest.mark.parametrize("path", sorted(CONFIG_DIR.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_recording_may_be_looked_at_with_the_yaml_of_its_robot(path: Path) -> None:
    replay = load_replay(path)
    if path.stem == "replay":
        assert not replay.assume_mount
        return
    robot = load_app(path)
    assert (replay.robot, replay.perception, replay.decision) == (
        robot.robot,
        robot.perception,
        robot.decision,
    )
    assert replay.assume_mount


@pytest.mark.parametrize("base", [SIM, {}], ids=["robot", "replay"])
def test_the_range_of_sight_must_not_exceed_the_range_of_depth(
    tmp_path: Path, base: dict[str, object]
) -> None:
    def ranges(counted_on_m: float, looked_at_m: float) -> dict[str, object]:
        return base | {
            "decision": {"sight": {"range_m": counted_on_m}},
            "perception": {"max_depth_m": looked_at_m},
        }

    load = load_app if base else load_replay
    load(written(tmp_path, ranges(5.0, 5.0)))
    with pytest.raises(ConfigError, match=r"range_m \(10\) is more than perception\.max_depth_m \(5\)"):
        load(written(tmp_path, ranges(10.0, 5.0)))


@pytest.mark.parametrize(
    ("shipped", "too_fast_mps", "makes"),
    [
        ("hil-kobuki.yaml", 0.8, "0.7"),
        ("hil-roboclaw.yaml", 1.3, "1.25"),
        ("hil-roboteq.yaml", 1.6, "1.5"),
        ("hil-agilex.yaml", 3.5, "3"),
    ],
)
def test_a_speed_that_the_base_does_not_make_is_refused(
    tmp_path: Path, shipped: str, too_fast_mps: float, makes: str
) -> None:
    content = yaml.safe_load((CONFIG_DIR / shipped).read_text())
    content["robot"] = {"limits": {"max_speed_mps": too_fast_mps}}
    with pytest.raises(ConfigError, match=rf"max_speed_mps \({too_fast_mps:g}\) is more than .* {makes} m/s"):
        load_app(written(tmp_path, content))


def gap_between_commands_ns(command_period_ms: int, rate_hz: float) -> int:
    """By the driver's own rule."""
    exchanges = (round(number * NS_PER_S / rate_hz) for number in count(1))
    return next(now_ns for now_ns in exchanges if due(0, command_period_ms * NS_PER_MS, now_ns))


@pytest.mark.parametrize(
    ("watchdog_ms", "command_period_ms", "rate_hz", "apart_ms"),
    [
        (100, 20, 50.0, None),
        (130, 60, 50.0, None),
        (100, 10, 30.0, None),
        (300, 50, 50.0, None),
        (100, 30, 40.0, None),  # every exchange, 25 ms
        (100, 40, 60.0, None),  # every other one, 33 ms
        (120, 50, 50.0, None),
        (300, 100, 12.0, None),
        (100, 60, 50.0, 60),  # every third exchange
        (100, 20, 20.0, 50),
        (200, 20, 10.0, 100),
        (200, 100, 10.0, 100),
        (150, 100, 500.0, 76),
    ],
)
def test_a_roboteq_is_not_told_to_stop_with_every_command(
    tmp_path: Path, watchdog_ms: int, command_period_ms: int, rate_hz: float, apart_ms: int | None
) -> None:
    content = yaml.safe_load((CONFIG_DIR / "hil-roboteq.yaml").read_text())
    content["chassis"] |= {"watchdog_ms": watchdog_ms, "command_period_ms": command_period_ms}
    content["runner"]["control_rate_hz"] = rate_hz
    gap_ns = gap_between_commands_ns(command_period_ms, rate_hz)
    assert (2 * gap_ns < watchdog_ms * NS_PER_MS) is (apart_ms is None), "what the driver really does"
    assert apart_ms in (None, pytest.approx(gap_ns / NS_PER_MS))
    if apart_ms is None:
        load_app(written(tmp_path, content))
        return
    with pytest.raises(ConfigError) as refused:
        load_app(written(tmp_path, content))
    words = (
        f"watchdog_ms ({watchdog_ms}) must be more than twice the {apart_ms} ms from one command to the next"
    )
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("section", "told"),
    [
        ({"chassis": {"kind": "bunker"}}, "chassis: its 'kind' is 'bunker', which is none of 'agilex', 'ro"),
        ({"camera": {"kind": "realsense", "serial": 912112073118}}, "put it in quotes, '912112073118'"),
        ({"robot": {"limits": {"max_speed_mps": 1, 0: None}}}, "a decimal has a point, not a comma"),
        (
            {"robot": {"limits": {"max_accel_mps2": 1.0}}},
            "emergency_decel_mps2 (0.7) must not be smaller than",
        ),
    ],
)
def test_mistakes_are_told_in_the_words_of_the_file(
    tmp_path: Path, section: dict[str, object], told: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        load_app(written(tmp_path, SIM | section))
    assert told in str(refused.value)


def test_a_latency_with_which_every_scene_is_stale_is_refused(tmp_path: Path) -> None:
    def late(latency_s: float) -> dict[str, object]:
        return {**SIM, "runner": {**SIM["runner"], "perception_latency_s": latency_s}}

    load_app(written(tmp_path, late(0.26)))
    with pytest.raises(ConfigError, match=r"latency_s \(0\.3\) must be less than decision\.sight\.stale_s"):
        load_app(written(tmp_path, late(0.3)))


@pytest.mark.parametrize(
    ("shipped", "chassis", "limits", "makes"),
    [
        ("hil-agilex.yaml", {"model": "scout", "slip_factor": 1.0}, {}, "0.5235"),
        ("hil-agilex.yaml", {"model": "tracer", "slip_factor": 1.1}, {}, "0.7139"),
        # 2 (top speed - speed) / (0.48 m times 1.1), for the outer track.
        ("hil-roboclaw.yaml", {"max_qpps": 14000}, {"max_speed_mps": 1.0}, "0.6313"),
        ("hil-roboteq.yaml", {}, {"max_speed_mps": 1.4}, "0.3788"),
        ("hil-roboteq.yaml", {}, {"max_speed_mps": 1.5}, "0"),
        # 2 x 0.05 m/s / 0.23 m; and what the base itself makes.
        ("hil-kobuki.yaml", {}, {"max_speed_mps": 0.65}, "0.4348"),
        ("hil-kobuki.yaml", {"max_yaw_rate_radps": 0.5}, {"max_speed_mps": 0.3}, "0.5"),
    ],
)
def test_a_turn_that_the_base_does_not_make_at_full_speed_is_refused(
    tmp_path: Path, shipped: str, chassis: dict[str, object], limits: dict[str, object], makes: str
) -> None:
    """The driver would slow the robot to it in one step, behind the guard: no jerk limit holds there."""
    content = yaml.safe_load((CONFIG_DIR / shipped).read_text())
    content["chassis"] |= chassis
    content["robot"]["limits"] = limits
    with pytest.raises(ConfigError) as refused:
        load_app(written(tmp_path, content))
    told = str(refused.value)
    assert "robot.limits.max_yaw_rate_radps (0.8) is more than the base makes" in told
    assert f"{makes} rad/s where it goes at robot.limits.max_speed_mps" in told
    assert "\n" not in told
    if float(makes):
        limits["max_yaw_rate_radps"] = 0.99 * float(makes)
        load_app(written(tmp_path, content))


@pytest.mark.parametrize(
    ("accel_qpps2", "enough"), [(100, False), (8400, False), (15791, False), (15792, True)]
)
def test_a_ramp_softer_than_the_stopping_model_is_refused(
    tmp_path: Path, accel_qpps2: int, enough: bool
) -> None:
    """0.7 m/s2 of the middle are 0.7 (1 + 0.48 x 1.1 / 0.60) = 1.316 of the outer track at half the width."""
    content = yaml.safe_load((CONFIG_DIR / "hil-roboclaw.yaml").read_text())
    content["chassis"]["accel_qpps2"] = accel_qpps2
    if enough:
        load_app(written(tmp_path, content))
        return
    with pytest.raises(ConfigError) as refused:
        load_app(written(tmp_path, content))
    told = str(refused.value)
    assert f"chassis.accel_qpps2 ({accel_qpps2}) is a ramp of {accel_qpps2 / 12000.0:.3g} m/s2" in told
    assert "at least 15792" in told
    assert "\n" not in told


def frames(camera: dict[str, object], stale_s: float) -> dict[str, object]:
    return {
        **SIM,
        "camera": {"kind": "simulated", **camera},
        "decision": {"sight": {"stale_s": stale_s}},
    }


def test_frames_so_rare_that_each_scene_is_stale_before_the_next_are_refused(tmp_path: Path) -> None:
    load_app(written(tmp_path, frames({"fps": 5.0}, 0.26)))
    with pytest.raises(ConfigError) as refused:
        load_app(written(tmp_path, frames({"fps": 2.0}, 0.3)))
    told = str(refused.value)
    assert "camera.fps (2): a scene is 0.56 s old before the next one comes" in told
    assert "decision.sight.stale_s (0.3)" in told
    assert "\n" not in told
    with pytest.raises(ConfigError, match=r"a scene is 0\.26 s old"):
        load_app(written(tmp_path, frames({"fps": 5.0}, 0.25)))


@pytest.mark.parametrize(("latency_s", "enough"), [(0.03, True), (0.2, False)])
def test_in_real_time_the_latency_is_the_camera_s_own(tmp_path: Path, latency_s: float, enough: bool) -> None:
    content = yaml.safe_load((CONFIG_DIR / "robot-bunker.yaml").read_text())
    content["camera"] |= {"fps": 6, "latency_s": latency_s}
    if enough:
        load_app(written(tmp_path, content))
        return
    with pytest.raises(ConfigError, match=r"camera\.fps \(6\): a scene is 0\.367 s old"):
        load_app(written(tmp_path, content))


def test_frames_farther_apart_than_can_be_compared_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"fps \(1\): frames are 1 s apart, more than perception\.max_gap_s"
    ):
        load_app(written(tmp_path, frames({"fps": 1.0}, 4.0)))
    load_app(written(tmp_path, frames({"fps": 1.0}, 4.0) | {"perception": {"max_gap_s": 1.0}}))


def test_the_lock_step_loop_has_its_base_in_the_program(tmp_path: Path) -> None:
    config = yaml.safe_load((CONFIG_DIR / "hil-roboteq.yaml").read_text())
    load_app(written(tmp_path, config))
    with pytest.raises(ConfigError, match=r"lockstep.* needs simulation\.base 'emulated'"):
        load_app(written(tmp_path, config | {"runner": {"kind": "lockstep"}}))


def test_copies_and_other_processes_know_beside_which_yaml_its_files_are(tmp_path: Path) -> None:
    file = written(tmp_path, SIM)
    config = load_app(file)
    changed = config.model_copy(update={"robot": config.robot})
    for one in (config, changed, pickle.loads(pickle.dumps(changed))):
        assert one.file == file
        assert one.resolve("hall.yaml") == tmp_path / "hall.yaml"


def test_where_a_configuration_was_read_from_is_no_part_of_what_it_says(tmp_path: Path) -> None:
    """A campaign is resumed from another folder."""
    (tmp_path / "moved").mkdir()
    here, there = (load_app(written(folder, SIM)) for folder in (tmp_path, tmp_path / "moved"))
    assert here.model_dump_json() == there.model_dump_json()


def test_without_a_file_names_are_relative_to_the_working_directory() -> None:
    config = AppConfig.model_validate(SIM)
    assert (str(config.file), config.resolve("hall.yaml")) == ("configuration", Path("hall.yaml"))
