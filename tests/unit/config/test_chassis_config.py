from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from config.app import load_app
from config.chassis import (
    AgilexChassisConfig,
    CanLinkConfig,
    ChassisConfig,
    KobukiChassisConfig,
    RoboclawChassisConfig,
    RoboteqChassisConfig,
    SerialLinkConfig,
)
from config.loader import CONFIG_DIR, ConfigError, Section, load


class Holder(Section):
    """A file with a chassis section alone."""

    chassis: ChassisConfig


AGILEX = "chassis: {kind: agilex, link: {interface: virtual, channel: sim}}"
ROBOCLAW = (
    "chassis: {kind: roboclaw, link: {url: /dev/ttyACM0}, counts_per_m: 9000.0, track_width_m: 0.5, "
    "max_qpps: 20000, accel_qpps2: 20000}"
)

ROBOTEQ = (
    "chassis: {kind: roboteq, link: {url: /dev/ttyACM0}, full_speed_mps: 1.5, counts_per_m: 9000.0, "
    "track_width_m: 0.5}"
)

KOBUKI = "chassis: {kind: kobuki, link: {url: /dev/kobuki}}"


def read(tmp_path: Path, text: str) -> ChassisConfig:
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    return load(path, Holder).chassis


def test_kind_chooses_the_driver(tmp_path: Path) -> None:
    agilex = read(tmp_path, AGILEX)
    assert isinstance(agilex, AgilexChassisConfig)
    assert (agilex.model, agilex.command_period_ms) == ("bunker", 20)
    assert agilex.link == CanLinkConfig(interface="virtual", channel="sim")
    assert CanLinkConfig(interface="virtual", channel="sim").bitrate == 500_000
    roboclaw = read(tmp_path, ROBOCLAW)
    assert isinstance(roboclaw, RoboclawChassisConfig)
    assert (roboclaw.address, roboclaw.timeout_ms, roboclaw.link.baud) == (0x80, 300, 115_200)
    roboteq = read(tmp_path, ROBOTEQ)
    assert isinstance(roboteq, RoboteqChassisConfig)
    kobuki = read(tmp_path, KOBUKI)
    assert isinstance(kobuki, KobukiChassisConfig)
    assert (kobuki.max_speed_mps, kobuki.link.baud) == (0.7, 115_200)
    assert (roboteq.encoder, roboteq.watchdog_ms, roboteq.left_sign) == ("quadrature", 300, 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (AGILEX.replace("agilex", "agilax"), "chassis"),
        (AGILEX.replace("kind: agilex, ", ""), "chassis"),
        (AGILEX.replace("virtual", "virtuell"), "interface"),
        (AGILEX.replace("channel: sim", "chanel: sim"), "chanel: unknown key"),
        (AGILEX.replace("channel: sim", "channel: 0"), "channel"),
        (AGILEX.replace("sim}", "sim, port: 5}"), "port: Input should be greater"),
        (AGILEX.replace("sim}", "sim, port: 5000}"), "only udp_multicast has this, not virtual"),
        (AGILEX.replace("sim}", "sim, bitrate: 500000}"), "bitrate: virtual has none"),
        (
            AGILEX.replace("virtual, channel: sim", "socketcan, channel: can0, bitrate: 250000"),
            "ip link set can0 up type can bitrate 250000",
        ),
        (
            AGILEX.replace("virtual, channel: sim", "udp_multicast, channel: 10.0.0.1"),
            "needs a group address such as 239.74.163.2, found '10.0.0.1'",
        ),
        (AGILEX.replace("virtual, channel: sim", "udp_multicast, channel: can0"), "found 'can0'"),
        (
            AGILEX.replace("}}", "}, model: bnuker}"),
            "model: Input should be 'bunker', 'bunker_mini', 'bunker_pro', 'scout', 'scout_mini' or "
            "'tracer', found 'bnuker'",
        ),
        (AGILEX.replace("}}", "}, model: hunter}"), "found 'hunter'"),
        (
            AGILEX.replace("interface: virtual, channel: sim}", "url: /dev/ttyUSB0}, model: tracer"),
            "tracer cannot be driven over a serial port: its serial line speaks another protocol",
        ),
        (
            AGILEX.replace("interface: virtual, channel: sim}", "url: /dev/ttyUSB0}, model: bunker_mini"),
            "bunker_mini cannot be driven over a serial port: it has CAN only; use CAN",
        ),
        (AGILEX.replace("channel: sim", "url: /dev/ttyUSB0"), "interface: unknown key"),
        (AGILEX.replace("{interface: virtual, channel: sim}", "can0"), "link"),
        (AGILEX.replace("}}", "}, slip_factor: 0.9}"), "slip_factor"),
        (AGILEX.replace("}}", "}, command_period_ms: 20.5}"), "command_period_ms"),
        (ROBOCLAW.replace("9000.0", "0.0"), "counts_per_m"),
        (ROBOCLAW.replace("9000.0", ".nan"), "counts_per_m"),
        (ROBOCLAW.replace("}}", "}}").replace("max_qpps: 20000", "max_qpps: '20000'"), "max_qpps"),
        (ROBOCLAW.replace("accel_qpps2: 20000", "accel_qpps2: 1, timeout_ms: 250"), "multiple of 100"),
        (ROBOCLAW.replace("accel_qpps2: 20000", "accel_qpps2: 1, address: 1"), "address"),
        (ROBOCLAW.replace(", max_qpps: 20000", ""), "max_qpps: missing key"),
        (KOBUKI.replace("}}", "}, max_speed_mps: 0.8}"), "max_speed_mps"),
        (ROBOTEQ.replace("1.5", "0.0"), "full_speed_mps"),
        (ROBOTEQ.replace("0.5}", "0.5, watchdog_ms: 0}"), "watchdog_ms"),
        (ROBOTEQ.replace("0.5}", "0.5, encoder: halls}"), "encoder"),
    ],
)
def test_mistakes_are_named_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert words in message
    assert "robot.yaml" in message
    assert "\n" not in message


def test_socketcan_without_a_bitrate_is_fine(tmp_path: Path) -> None:
    chassis = read(tmp_path, AGILEX.replace("virtual, channel: sim", "socketcan, channel: can0"))
    assert isinstance(chassis, AgilexChassisConfig)


def test_one_line_takes_an_agilex_base_to_its_serial_port(tmp_path: Path) -> None:
    chassis = read(tmp_path, AGILEX.replace("interface: virtual, channel: sim", "url: /dev/ttyUSB0"))
    assert isinstance(chassis, AgilexChassisConfig)
    assert chassis.link == SerialLinkConfig(url="/dev/ttyUSB0", baud=115_200)


def test_a_mirrored_motor_counts_backwards(tmp_path: Path) -> None:
    text = ROBOCLAW.replace("accel_qpps2: 20000", "accel_qpps2: 20000, invert_right: true")
    chassis = read(tmp_path, text)
    assert isinstance(chassis, RoboclawChassisConfig)
    assert (chassis.left_sign, chassis.right_sign) == (1, -1)


@pytest.mark.parametrize("section", ["body", "limits", "camera_mount"])
def test_real_robot_without_a_section_is_refused(section: str, tmp_path: Path) -> None:
    content = yaml.safe_load((CONFIG_DIR / "robot-roboteq.yaml").read_text())
    del content["robot"][section]
    changed = tmp_path / "robot.yaml"
    changed.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError, match=f"'realsense' needs robot.{section}: nothing of a real robot"):
        load_app(changed)


@pytest.mark.parametrize(
    "key", ["body.width_m", "body.height_m", "limits.max_speed_mps", "camera_mount.height_m"]
)
def test_not_one_key_of_a_real_robot_is_guessed(key: str, tmp_path: Path) -> None:
    """The default is another robot's width: a wider one would graze what it is told to pass."""
    content = yaml.safe_load((CONFIG_DIR / "robot-kobuki.yaml").read_text())
    section, name = key.split(".")
    del content["robot"][section][name]
    changed = tmp_path / "robot.yaml"
    changed.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError) as refused:
        load_app(changed)
    assert f"'realsense' needs robot.{key}: nothing of a real robot" in str(refused.value)


@pytest.mark.parametrize("path", sorted(CONFIG_DIR.glob("robot-*.yaml")), ids=lambda path: path.stem)
def test_the_files_to_start_from_are_right(path: Path) -> None:
    assert load_app(path).simulation is None


@pytest.mark.parametrize(
    "url",
    [
        "socket://10.0.0.7",
        "socket://:4001",
        "socket://10.0.0.7:99999",
        "rfc2217://base:port",
        "socket://[::1",
    ],
)
def test_a_port_of_another_machine_needs_a_host_and_a_number(tmp_path: Path, url: str) -> None:
    with pytest.raises(ConfigError, match=r"link\.url: needs a host and a port, such as (socket|rfc2217)://"):
        read(tmp_path, KOBUKI.replace("/dev/kobuki", f'"{url}"'))


def test_a_port_of_another_machine_is_taken_as_it_is(tmp_path: Path) -> None:
    link = read(tmp_path, KOBUKI.replace("/dev/kobuki", '"socket://base-7:4001"')).link
    assert link == SerialLinkConfig(url="socket://base-7:4001")
