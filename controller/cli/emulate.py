"""`treadwatch emulate`: a chassis emulator as its own process, in real time, for programs with its protocol.

Faults of a real base can be given on its standard input, one word a line: see FAULTS.
"""

from __future__ import annotations

import os
import selectors
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from pydantic import ValidationError

from config.app import AppConfig, hil_file, load_app
from config.chassis import (
    AgilexChassisConfig,
    AnyChassisConfig,
    CanLinkConfig,
    SerialLinkConfig,
)
from config.loader import describe
from config.plant import PlantConfig
from controller.build_chassis import build_can_emulator, build_pseudo_terminal, build_serial_emulator
from controller.errors import UserError
from controller.realtime.service import StopRequest, stop_on_signals
from controller.terminal.outlet import say
from hal.api import Clock
from hal.clocks import NS_PER_MS, NS_PER_S, MonotonicClock
from sim.plant import TrackedPlant
from sim.simulation import Emulator

# Period of a step, and so the delay of an answer; a real controller takes a millisecond or two.
_TICK_NS = 2 * NS_PER_MS

# A process that did not run for this long was frozen, and so was the base that it emulates.
_FROZEN_NS = 200 * NS_PER_MS

_TOLD_EVERY_NS = 100 * NS_PER_MS

FAULTS: dict[str, Callable[[Emulator], None]] = {
    "estop": lambda base: base.press_estop(),
    "release": lambda base: base.release_estop(),
    "restart": lambda base: base.restart(),
    "freeze": lambda base: base.freeze(),
    "thaw": lambda base: base.thaw(),
}


@dataclass(frozen=True, slots=True)
class EmulateOptions:
    """The command line.

    kind: of chassis.
    channel, interface, port: replace what the configuration says.
    config_path: None means hil-KIND.yaml.
    telling: print how the base moves.
    """

    kind: str
    channel: str | None = None
    interface: str | None = None
    port: int | None = None
    config_path: Path | None = None
    telling: bool = False


def run_emulator(options: EmulateOptions, commands: TextIO | None) -> None:
    """Run until SIGTERM or SIGINT. Raises ConfigError, HalError, UserError before it begins."""
    config_path = options.config_path or hil_file(options.kind)
    config = load_app(config_path)
    if config.chassis.kind != options.kind:
        raise UserError(f"{config_path}: its chassis is {config.chassis.kind!r}, not {options.kind!r}")
    clock = MonotonicClock()
    with ExitStack() as stack:
        stop = stack.enter_context(stop_on_signals())
        emulator = stack.enter_context(_emulator(config, options, clock.now_ns()))
        hearer = stack.enter_context(_Commands(commands))
        for line in run_in_real_time(emulator, clock, stop, hearer.read):
            if options.telling or not line.startswith("v "):
                say(line)


@contextmanager
def _emulator(config: AppConfig, options: EmulateOptions, now_ns: int) -> Iterator[Emulator]:
    plant_config = PlantConfig() if config.simulation is None else config.simulation.plant
    plant = TrackedPlant(plant_config, None, now_ns)
    chassis = with_wire(config.chassis, options)
    if isinstance(chassis.link, CanLinkConfig):
        link = can_link(chassis.link, options)
        with build_can_emulator(chassis, link, plant) as can_emulator:
            say(f"emulating {options.kind} on CAN {link.interface} {link.channel!r}", to_stderr=True)
            yield can_emulator
        return
    if options.interface is not None or options.port is not None:
        raise UserError(
            f"--interface, --port: this {options.kind} is on a serial port; only --channel PATH says where"
        )
    terminal = build_pseudo_terminal()
    wanted = options.channel or chassis.link.url
    with build_serial_emulator(chassis, terminal, plant) as emulator, _linked(wanted, terminal.path):
        say(f"emulating {options.kind} on {wanted} -> {terminal.path}", to_stderr=True)
        yield emulator


def with_wire(chassis: AnyChassisConfig, options: EmulateOptions) -> AnyChassisConfig:
    """The chassis with the kind of link that the channel implies: a path is a serial port.

    Raises UserError.
    """
    channel = options.channel
    if channel is None or "/" not in channel or options.interface is not None:
        return chassis
    if not isinstance(chassis, AgilexChassisConfig):
        return chassis
    values = {key: getattr(chassis, key) for key in chassis.model_fields_set}
    try:
        return AgilexChassisConfig.model_validate(values | {"link": SerialLinkConfig(url=channel)})
    except ValidationError as error:
        raise UserError(f"--channel {channel}: {describe(error, AgilexChassisConfig)}") from error


def can_link(link: CanLinkConfig, options: EmulateOptions) -> CanLinkConfig:
    """The file's link with what the command line changes. Raises UserError."""
    values = {key: getattr(link, key) for key in link.model_fields_set}
    if options.channel is not None and options.interface is None and options.channel != link.channel:
        # can0, vcan0: socketcan; a group address: multicast.
        implied = "udp_multicast" if "." in options.channel else "socketcan"
        values = {"interface": implied} | ({"port": link.port} if "." in options.channel else {})
    elif options.interface is not None:
        values = {"interface": options.interface, "channel": link.channel}
    values |= {} if options.channel is None else {"channel": options.channel}
    values |= {} if options.port is None else {"port": options.port}
    try:
        return CanLinkConfig.model_validate(values)
    except ValidationError as error:
        raise UserError(f"--channel, --interface, --port: {describe(error, CanLinkConfig)}") from error


@contextmanager
def _linked(path: str, target: str) -> Iterator[None]:
    """A symbolic link to the pseudo-terminal, for as long as the block runs. Raises UserError."""
    link = Path(path)
    try:
        if link.is_symlink() and os.readlink(link).startswith("/dev/pts/"):
            # An emulator that was killed leaves its link, and its terminal's number may be this one's now.
            if link.exists() and os.readlink(link) != target:
                raise UserError(
                    f"--channel {path}: another emulator is there ({os.readlink(link)}); stop it, choose "
                    "another path, or remove this link if nothing runs any more"
                )
            link.unlink()
        link.symlink_to(target)
    except OSError as error:
        raise UserError(
            f"--channel {path}: no link can be made there ({error.strerror}); choose a path that is free"
        ) from error
    try:
        yield
    finally:
        if link.is_symlink() and os.readlink(link) == target:
            link.unlink()


def run_in_real_time(
    emulator: Emulator, clock: Clock, stop: StopRequest, read_commands: Callable[[], list[str]]
) -> Iterator[str]:
    """Step the base until stop; yields lines to print, and how the base moves ten times a second."""
    told_ns = deadline_ns = last_ns = clock.now_ns()
    while not stop:
        clock.sleep_until_ns(deadline_ns)
        now_ns = clock.now_ns()
        deadline_ns = max(deadline_ns + _TICK_NS, now_ns)
        if now_ns - last_ns > _FROZEN_NS:
            # Messages that were due meanwhile must not be sent now in one burst: a frozen base sends none.
            emulator.freeze()
            emulator.advance_to(now_ns)
            emulator.thaw()
            yield f"was frozen for {(now_ns - last_ns) / NS_PER_S:.1f} s"
        last_ns = now_ns
        for command in read_commands():
            fault = FAULTS.get(command)
            if fault is None:
                yield f"{command!r}? one of {', '.join(FAULTS)}"
            else:
                fault(emulator)
                yield f"did {command}"
        emulator.advance_to(now_ns)
        if now_ns - told_ns >= _TOLD_EVERY_NS:
            told_ns = now_ns
            v_mps, w_radps = emulator.plant.twist
            pose = emulator.plant.pose
            yield f"v {v_mps:.3f} m/s, w {w_radps:.3f} rad/s, x {pose.x_m:.2f} m, y {pose.y_m:.2f} m"
    yield f"{stop.reason}: ended"


class _Commands:
    """Reads lines from a stream without blocking."""

    def __init__(self, stream: TextIO | None) -> None:
        self._selector = selectors.DefaultSelector()
        self._stream = stream
        self._partial = ""

    def __enter__(self) -> _Commands:
        if self._stream is not None:
            try:
                self._selector.register(self._stream, selectors.EVENT_READ)
            except (OSError, ValueError):  # a file or /dev/null: no commands come
                self._stream = None
        return self

    def __exit__(self, *_: object) -> None:
        self._selector.close()

    def read(self) -> list[str]:
        """The complete lines that have arrived."""
        if self._stream is None or not self._selector.select(timeout=0):
            return []
        data = os.read(self._stream.fileno(), 4096)
        if not data:  # closed
            self._selector.unregister(self._stream)
            self._stream = None
            return []
        *lines, self._partial = (self._partial + data.decode("utf-8", "replace")).split("\n")
        return [line.strip() for line in lines if line.strip()]
