"""A chassis driver and the emulator at the other end of its link, stepped together in simulated time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Protocol
from uuid import uuid4

from config.chassis import (
    AgilexChassisConfig,
    AgilexLinkConfig,
    CanLinkConfig,
    KobukiChassisConfig,
    RoboclawChassisConfig,
    RoboteqChassisConfig,
    SerialLinkConfig,
)
from config.plant import PlantConfig
from hal.api import CanLink, Chassis, SerialLink
from hal.chassis.agilex import AgilexChassis, no_can_frames_hint
from hal.chassis.agilex_models import model_of, over_serial
from hal.chassis.agilex_serial import AgilexSerialBus
from hal.chassis.kobuki import KobukiChassis
from hal.chassis.kobuki_packets import WHEEL_BASE_M
from hal.chassis.roboclaw import RoboclawChassis
from hal.chassis.roboteq import RoboteqChassis
from hal.links.can_bus import CanBusLink
from hal.links.scripted import ScriptedSerialLink, can_pair, serial_pair
from hal.types import ChassisMode, ChassisState, Setpoint
from sim.emulators.agilex import AgilexEmulator
from sim.emulators.kobuki import KobukiEmulator
from sim.emulators.roboclaw import RoboclawEmulator
from sim.emulators.roboteq import RoboteqEmulator
from sim.plant import TrackedPlant
from tests.support.wires import PluggedCan, PluggedSerial, SettledPort, SettledTerminal

MS = 1_000_000
PERIOD_NS = 20 * MS
SLIP_FACTOR = 1.1
PLANT = PlantConfig(slip_factor=SLIP_FACTOR)
KOBUKI_PLANT = PlantConfig(track_width_m=WHEEL_BASE_M, slip_factor=SLIP_FACTOR)
COUNTS_PER_M = 20_000.0


class Emulator(Protocol):
    """What every chassis emulator can do."""

    def advance_to(self, now_ns: int) -> None: ...
    def press_estop(self) -> None: ...
    def release_estop(self) -> None: ...
    def restart(self) -> None: ...
    def freeze(self) -> None: ...
    def thaw(self) -> None: ...
    @property
    def plant(self) -> TrackedPlant: ...


@dataclass
class Rig:
    """Emulator first, then the driver, every 20 ms: the order of the lock-step runner.

    wire_step_radps: how coarse a yaw rate the protocol can say. tolerance_mps, tolerance_radps: how well the
    true twist is known. braking_s: how long to wait until braking must show.
    """

    chassis: Chassis
    emulator: Emulator
    plug: PluggedCan | PluggedSerial
    own_timeout_s: float
    battery_v: float
    wire_step_radps: float = 0.001
    tolerance_mps: float = 0.002
    tolerance_radps: float = 0.0015
    braking_s: float = 0.1
    now_ns: int = 0
    state: ChassisState = field(init=False)

    @property
    def plant(self) -> TrackedPlant:
        """The true body."""
        return self.emulator.plant

    def step(self, v_mps: float | None = None, w_radps: float = 0.0) -> ChassisState:
        """One control period; without a speed the command is None."""
        self.now_ns += PERIOD_NS
        self.emulator.advance_to(self.now_ns)
        command = None if v_mps is None else Setpoint(self.now_ns, v_mps, 0.0, w_radps)
        self.state = self.chassis.exchange(command, self.now_ns)
        return self.state

    def run(self, seconds: float, v_mps: float | None = None, w_radps: float = 0.0) -> ChassisState:
        """Many control periods."""
        for _ in range(round(seconds * 50)):
            self.step(v_mps, w_radps)
        return self.state

    def run_emulator_only(self, seconds: float) -> None:
        """The host is gone: only the emulator goes on."""
        self.now_ns += round(seconds * 1e9)
        self.emulator.advance_to(self.now_ns)

    def arm(self) -> None:
        """Consent, and wait until it is followed."""
        self.chassis.arm(self.now_ns)
        for _ in range(100):
            if self.step().mode is ChassisMode.ARMED:
                return
        raise AssertionError(f"did not arm: {self.state.reason}")

    def is_standing(self) -> bool:
        """The true body does not move."""
        v_mps, w_radps = self.plant.twist
        return abs(v_mps) < 0.5 * self.tolerance_mps and abs(w_radps) < self.tolerance_radps

    def require_emulator(self, reason: str) -> None:
        """Skips the test on a real base."""


def can_link_config() -> CanLinkConfig:
    """A virtual bus of its own."""
    return CanLinkConfig(interface="virtual", channel=f"rig-{uuid4().hex}")


def udp_link_config() -> CanLinkConfig:
    """A multicast bus that no other test run is on: its port is drawn by chance."""
    port = 20_000 + uuid4().int % 40_000
    return CanLinkConfig(interface="udp_multicast", channel="239.74.163.91", port=port)


def agilex_config(link: AgilexLinkConfig | None = None, **changes: object) -> AgilexChassisConfig:
    """A BUNKER; the track width is known unless changed."""
    values: dict[str, object] = {
        "kind": "agilex",
        "link": link or can_link_config(),
        "track_width_m": PLANT.track_width_m,
        "slip_factor": SLIP_FACTOR,
    }
    return AgilexChassisConfig.model_validate(values | changes)


def roboclaw_config(**changes: object) -> RoboclawChassisConfig:
    """A base with the plant's tracks."""
    values: dict[str, object] = {
        "kind": "roboclaw",
        "link": SerialLinkConfig(url="loop://", baud=38_400),
        "counts_per_m": COUNTS_PER_M,
        "track_width_m": PLANT.track_width_m,
        "slip_factor": SLIP_FACTOR,
        "max_qpps": 40_000,
        "accel_qpps2": 30_000,
    }
    return RoboclawChassisConfig.model_validate(values | changes)


def roboteq_config(**changes: object) -> RoboteqChassisConfig:
    """A base with the plant's tracks."""
    values: dict[str, object] = {
        "kind": "roboteq",
        "link": SerialLinkConfig(url="loop://"),
        "full_speed_mps": 1.0,
        "counts_per_m": COUNTS_PER_M,
        "track_width_m": PLANT.track_width_m,
        "slip_factor": SLIP_FACTOR,
    }
    return RoboteqChassisConfig.model_validate(values | changes)


def kobuki_config(**changes: object) -> KobukiChassisConfig:
    """A Kobuki on a floor as slippery as the plant's."""
    values: dict[str, object] = {
        "kind": "kobuki",
        "link": SerialLinkConfig(url="loop://"),
        "slip_factor": SLIP_FACTOR,
    }
    return KobukiChassisConfig.model_validate(values | changes)


def serial_ends(kind: str) -> tuple[SerialLink, SerialLink]:
    """Driver's end, emulator's end; kind: "scripted", or "pty" for pyserial on a pseudo-terminal."""
    if kind == "scripted":
        return serial_pair()
    terminal = SettledTerminal()
    return SettledPort(SerialLinkConfig(url=terminal.path, baud=38_400), terminal), terminal


@contextmanager
def agilex_rig(kind: str, link: CanLinkConfig | None = None, model: str = "bunker") -> Iterator[Rig]:
    """kind: "scripted" or "bus" (two python-can buses on link) for CAN; "serial-scripted" or "serial-pty"
    for RS-232."""
    can_bus = link or can_link_config()
    bus: AgilexLinkConfig = can_bus
    no_frames_hint = no_can_frames_hint
    with ExitStack() as stack:
        if kind.startswith("serial-"):
            near, far = serial_ends(kind.removeprefix("serial-"))
            serial_plug = PluggedSerial(near)
            serial_bus = AgilexSerialBus(serial_plug)
            ends: tuple[CanLink, CanLink] = serial_bus, AgilexSerialBus(far)
            plug: PluggedCan | PluggedSerial = serial_plug
            bus, no_frames_hint = SerialLinkConfig(url="loop://"), serial_bus.silence_hint
        else:
            ends = can_pair() if kind == "scripted" else (CanBusLink(can_bus), CanBusLink(can_bus))
            plug = can_plug = PluggedCan(ends[0])
            ends = can_plug, ends[1]
        config = agilex_config(bus, model=model)
        emulator = AgilexEmulator(
            ends[1], TrackedPlant(PLANT), model=model_of(config), over_serial=over_serial(config)
        )
        stack.enter_context(emulator)
        chassis = stack.enter_context(AgilexChassis(ends[0], config, no_frames_hint))
        yield Rig(chassis, emulator, plug, own_timeout_s=0.5, battery_v=50.0)


@contextmanager
def roboclaw_rig(kind: str, status_bytes: int = 4) -> Iterator[Rig]:
    """kind: as of serial_ends."""
    config = roboclaw_config()
    with ExitStack() as stack:
        ends = serial_ends(kind)
        plug = PluggedSerial(ends[0])
        plant = TrackedPlant(PLANT)
        emulator = stack.enter_context(
            RoboclawEmulator(ends[1], plant, counts_per_m=COUNTS_PER_M, status_bytes=status_bytes)
        )
        chassis = stack.enter_context(RoboclawChassis(plug, config))
        yield Rig(chassis, emulator, plug, own_timeout_s=config.timeout_ms / 1000, battery_v=25.2)


@contextmanager
def roboteq_rig(kind: str) -> Iterator[Rig]:
    """kind: as of serial_ends."""
    config = roboteq_config()
    with ExitStack() as stack:
        ends = serial_ends(kind)
        plug = PluggedSerial(ends[0])
        emulator = stack.enter_context(
            RoboteqEmulator(
                ends[1],
                TrackedPlant(PLANT),
                full_speed_mps=config.full_speed_mps,
                counts_per_m=COUNTS_PER_M,
            )
        )
        chassis = stack.enter_context(RoboteqChassis(plug, config))
        yield Rig(chassis, emulator, plug, own_timeout_s=config.watchdog_ms / 1000, battery_v=24.6)


@contextmanager
def kobuki_rig(kind: str) -> Iterator[Rig]:
    """kind: as of serial_ends."""
    with ExitStack() as stack:
        ends = serial_ends(kind)
        plug = PluggedSerial(ends[0])
        emulator = stack.enter_context(KobukiEmulator(ends[1], TrackedPlant(KOBUKI_PLANT)))
        chassis = stack.enter_context(KobukiChassis(plug, kobuki_config()))
        # A spin is said as the speed of a wheel, in mm/s.
        step_radps = 0.001 / (0.5 * WHEEL_BASE_M)
        yield Rig(chassis, emulator, plug, own_timeout_s=0.6, battery_v=16.2, wire_step_radps=step_radps)


def exchange_amid(chassis: Chassis, link: ScriptedSerialLink, chunks: list[bytes]) -> None:
    """One exchange for each chunk that arrives, asked to drive; see check_state."""
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        check_state(chassis.exchange(Setpoint(k * 20 * MS, 1.0, 0.0, 0.5), k * 20 * MS))


def check_state(state: ChassisState) -> None:
    """Nobody consented, so nothing may be driven, whatever was heard; what is told is finite."""
    assert state.mode is not ChassisMode.ARMED, "nobody consented"
    assert state.sent is None or (state.sent.v_mps, state.sent.w_radps) == (0.0, 0.0)
    assert all(math.isfinite(value) for value in (state.pose.x_m, state.pose.y_m, state.pose.heading_rad))
