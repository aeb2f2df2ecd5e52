"""Every driver on every link that its protocol has, for the contract suite: one line for each."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

import pytest

from config.chassis import CanLinkConfig
from hal.errors import HalError
from tests.support.chassis_rig import (
    Rig,
    agilex_rig,
    can_link_config,
    kobuki_rig,
    roboclaw_rig,
    roboteq_rig,
    udp_link_config,
)
from tests.support.docs_page_chassis import page_rig
from tests.support.real_base import DEFAULT_BASE, real_rig
from tests.support.wires import open_can_link


def _on_bus(make_link: Callable[[], CanLinkConfig]) -> AbstractContextManager[Rig]:
    link = make_link()
    try:
        with open_can_link(link):
            return agilex_rig("bus", link)
    except HalError as error:
        pytest.skip(f"no {link.interface} on this machine: {error}")


def vcan_link_config() -> CanLinkConfig:
    """The virtual bus of the kernel, where it has one."""
    return CanLinkConfig(interface="socketcan", channel="vcan0")


EMULATED: dict[str, Callable[[], AbstractContextManager[Rig]]] = {
    "agilex-scripted": partial(agilex_rig, "scripted"),
    "agilex-virtual": partial(_on_bus, can_link_config),
    "agilex-udp": partial(_on_bus, udp_link_config),
    "agilex-vcan": partial(_on_bus, vcan_link_config),
    "agilex-serial-scripted": partial(agilex_rig, "serial-scripted"),
    "agilex-serial-pty": partial(agilex_rig, "serial-pty"),
    "agilex-bunker_mini": partial(agilex_rig, "scripted", model="bunker_mini"),
    "agilex-scout": partial(agilex_rig, "scripted", model="scout"),
    "agilex-tracer": partial(agilex_rig, "scripted", model="tracer"),
    "roboclaw-scripted": partial(roboclaw_rig, "scripted"),
    "roboclaw-old-firmware": partial(roboclaw_rig, "scripted", status_bytes=2),
    "roboclaw-pty": partial(roboclaw_rig, "pty"),
    "roboteq-scripted": partial(roboteq_rig, "scripted"),
    "roboteq-pty": partial(roboteq_rig, "pty"),
    "kobuki-scripted": partial(kobuki_rig, "scripted"),
    "kobuki-pty": partial(kobuki_rig, "pty"),
    "page-scripted": partial(page_rig, "scripted"),  # the example of docs/add-a-chassis.md
    "page-pty": partial(page_rig, "pty"),
}


def open_real(config: pytest.Config) -> AbstractContextManager[Rig]:
    """The base of the command line: --channel, --base, --attended. Skips without --hil."""
    if not config.getoption("--hil"):
        pytest.skip("moves a real base: put its tracks in the air and add --hil")
    return real_rig(
        Path(config.getoption("--base") or DEFAULT_BASE),
        config.getoption("--channel"),
        config.getoption("--attended"),
    )
