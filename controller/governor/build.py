"""The governor's parts from YAML; controller/build.py makes all the others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import assert_never

from config.app import AppConfig
from config.governor import GovernorConfig, InputConfig, UdpInputConfig, UnixInputConfig
from controller.build import build_path, mount_of
from controller.governor.governor import SpeedGovernor
from controller.governor.inbox import Inbox
from controller.governor.loop import Commands, GovernorLoop
from controller.localise import Localiser
from hal.api import Chassis
from hal.links.datagrams import DatagramSocket, UdpSocket, UnixSocket


def build_governor(config: AppConfig) -> SpeedGovernor:
    """For a program of one's own: step it with scenes and odometry."""
    return SpeedGovernor(
        config.governor or GovernorConfig(),
        config.decision,
        config.robot,
        mount_of(config),
        1.0 / config.runner.control_rate_hz,
    )


def build_governor_loop(
    config: AppConfig, config_path: FilePath, chassis: Chassis, commands: Commands
) -> GovernorLoop:
    """Around a chassis that is opened elsewhere. Raises ConfigError, PathError."""
    start = build_path(config, config_path).start
    return GovernorLoop(build_governor(config), commands, Localiser(start, mount_of(config)), chassis)


def open_input(config: InputConfig) -> DatagramSocket:
    """Where commands arrive, not yet entered."""
    match config:
        case UdpInputConfig():
            return UdpSocket(config.host, config.port)
        case UnixInputConfig():
            return UnixSocket(FilePath(config.path).expanduser(), config.group_may_command)
        case unknown:
            assert_never(unknown)


def build_inbox(link: DatagramSocket, config: GovernorConfig, warn: Callable[[str], None]) -> Inbox:
    """What is made of the messages; warn is told of the first one of each kind that is dropped."""
    return Inbox(link, config, warn)
