"""Measures the exchange of every chassis driver over every link that works without hardware."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from uuid import uuid4

from config.app import HIL_BASES, AppConfig, hil_file, load_app
from config.chassis import CanLinkConfig
from controller.bench.driving import TimedChassis, measure_exchange
from controller.bench.figures import Durations
from controller.bench.progress import progress
from controller.bench.reel import Tick
from controller.build_chassis import (
    build_base,
    build_base_in_memory,
    build_pseudo_terminal,
    build_serial_emulator,
)
from hal.api import Chassis
from hal.clocks import NS_PER_MS
from hal.errors import HalError
from hal.types import PlanarPose
from sim.plant import TrackedPlant
from sim.simulation import Emulator

_ORIGIN = PlanarPose(0.0, 0.0, 0.0)
_PTY_DELAY_NS = NS_PER_MS // 10  # within this time the kernel passes on the bytes of a pseudo-terminal


@dataclass(frozen=True, slots=True)
class Wire:
    """One chassis driver on one kind of link.

    name: as in the figures.
    file: the * of its hil-*.yaml.
    build: makes the guarded driver and the base at the other end.
    asynchronous: what was sent arrives a moment later.
    """

    name: str
    file: str
    build: Callable[[AppConfig], tuple[Chassis, Emulator]]
    asynchronous: bool = False


def _in_memory(config: AppConfig) -> tuple[Chassis, Emulator]:
    chassis, emulator, _ = build_base_in_memory(config, _ORIGIN, 0)
    return chassis, emulator


def _on_bus(link: CanLinkConfig) -> Callable[[AppConfig], tuple[Chassis, Emulator]]:
    def build(config: AppConfig) -> tuple[Chassis, Emulator]:
        assert config.simulation is not None
        changes = {
            "chassis": config.chassis.model_copy(update={"link": link}),
            "simulation": config.simulation.model_copy(update={"base": "emulated"}),
        }
        chassis, emulator = build_base(config.model_copy(update=changes), _ORIGIN, 0)
        assert emulator is not None, "it is emulated"
        return chassis, emulator

    return build


def _on_terminal(config: AppConfig) -> tuple[Chassis, Emulator]:
    assert config.simulation is not None
    terminal = build_pseudo_terminal()
    assert not isinstance(config.chassis.link, CanLinkConfig)
    link = config.chassis.link.model_copy(update={"url": terminal.path})
    chassis_config = config.chassis.model_copy(update={"link": link})
    chassis, _ = build_base(config.model_copy(update={"chassis": chassis_config}), _ORIGIN, 0)
    plant = TrackedPlant(config.simulation.plant, _ORIGIN, 0)
    return chassis, build_serial_emulator(chassis_config, terminal, plant)


def wires() -> tuple[Wire, ...]:
    """All drivers (hil-*.yaml) on all links. Buses and ports are chosen at random at each call."""
    virtual = CanLinkConfig(interface="virtual", channel=f"bench-{uuid4().hex}")
    multicast = CanLinkConfig(
        interface="udp_multicast", channel="239.74.163.90", port=20_000 + uuid4().int % 40_000
    )
    found = []
    for file in HIL_BASES:
        name = file.replace("-", "_")
        found.append(Wire(f"{name}_in_memory", file, _in_memory))
        if isinstance(load_app(hil_file(file)).chassis.link, CanLinkConfig):
            found.append(Wire(f"{name}_virtual_can", file, _on_bus(virtual)))
            found.append(Wire(f"{name}_multicast_can", file, _on_bus(multicast)))
        else:
            found.append(Wire(f"{name}_pty", file, _on_terminal, asynchronous=True))
    return tuple(found)


def measure_exchanges(exchanges: int, stopwatch_ns: Callable[[], int]) -> dict[str, Durations]:
    """Durations by name of chassis and link. A link that this machine does not have is left out."""
    figures = {}
    for wire in wires():
        config = load_app(hil_file(wire.file))
        with progress(f"exchange, {wire.name.replace('_', ' ')}", exchanges) as tick:
            try:
                figures[wire.name] = _measure(wire, config, exchanges, stopwatch_ns, tick)
            except HalError:
                continue
    return figures


def _measure(
    wire: Wire, config: AppConfig, exchanges: int, stopwatch_ns: Callable[[], int], tick: Tick
) -> Durations:
    chassis, emulator = wire.build(config)
    wait = _wait if wire.asynchronous else _no_wait
    return measure_exchange(TimedChassis(chassis, stopwatch_ns), emulator, exchanges, tick, wait)


def _wait() -> None:
    # Does not sleep, because the next measurement would then begin with cold caches.
    end_ns = time.perf_counter_ns() + _PTY_DELAY_NS
    while time.perf_counter_ns() < end_ns:
        os.sched_yield()


def _no_wait() -> None:
    """Do not wait: what was sent has arrived."""
