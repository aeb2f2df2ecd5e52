"""Composition of the chassis: driver, link, output guard, and the emulator at the other end of the link.

Only this file and controller/build.py name concrete devices.
"""

from __future__ import annotations

from typing import assert_never

from config.app import AppConfig
from config.chassis import (
    AgilexChassisConfig,
    AnyChassisConfig,
    CanLinkConfig,
    KobukiChassisConfig,
    RoboclawChassisConfig,
    RoboteqChassisConfig,
)
from config.plant import PlantConfig
from controller.base.guard import GuardedCanLink, GuardedChassis, GuardLimits
from hal.api import CanLink, Chassis, ChassisListener, SerialLink
from hal.chassis.agilex import COMMANDS as AGILEX_COMMANDS
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_models import model_of
from hal.chassis.agilex_serial import AgilexSerialBus
from hal.chassis.driver import ChassisDriver
from hal.chassis.kobuki import KobukiChassis
from hal.chassis.roboclaw import RoboclawChassis
from hal.chassis.roboteq import RoboteqChassis
from hal.links.can_bus import CanBusLink
from hal.links.pseudo_terminal import PseudoTerminal
from hal.links.scripted import ScriptedCanLink, ScriptedSerialLink, can_pair, serial_pair
from hal.links.serial_port import SerialPortLink
from hal.types import PlanarPose
from sim.emulators.agilex import AgilexEmulator
from sim.emulators.kobuki import KobukiEmulator
from sim.emulators.roboclaw import RoboclawEmulator
from sim.emulators.roboteq import RoboteqEmulator
from sim.plant import TrackedPlant
from sim.simulation import Emulator


def build_base(config: AppConfig, start: PlanarPose, start_ns: int) -> tuple[Chassis, Emulator | None]:
    """The chassis driver, and the emulator at the other end of its link if one is asked for.

    Neither is opened yet; enter the emulator first. Raises DeviceNotFound, DeviceRefused when entered.
    """
    driver, emulator = _bare_base(config, start, start_ns)
    return _guarded(config, driver), emulator


def build_listener(
    config: AppConfig, start: PlanarPose, start_ns: int
) -> tuple[ChassisListener, Emulator | None]:
    """The same, only to be listened to: what it returns can be neither armed nor commanded."""
    return _bare_base(config, start, start_ns)


def build_base_in_memory(
    config: AppConfig, start: PlanarPose, start_ns: int
) -> tuple[Chassis, Emulator, ScriptedCanLink | ScriptedSerialLink]:
    """Guarded driver and emulator on a link in memory, and the driver's end of it, to disconnect it."""
    of_plant = PlantConfig() if config.simulation is None else config.simulation.plant
    driver, emulator, near = _in_memory(config.chassis, TrackedPlant(of_plant, start, start_ns))
    return _guarded(config, driver), emulator, near


def _guarded(config: AppConfig, driver: Chassis) -> Chassis:
    period_s, max_age_s = 1.0 / config.runner.control_rate_hz, 1e-3 * config.chassis.command_timeout_ms
    return GuardedChassis(driver, GuardLimits.of(config.robot.limits, period_s, max_age_s))


def _bare_base(config: AppConfig, start: PlanarPose, start_ns: int) -> tuple[ChassisDriver, Emulator | None]:
    simulation, chassis, link = config.simulation, config.chassis, config.chassis.link
    plant = None
    if simulation is not None and simulation.base == "emulated":
        plant = TrackedPlant(simulation.plant, start, start_ns)
    if isinstance(link, CanLinkConfig):
        driver = build_can_driver(chassis, CanBusLink(link))
        return driver, None if plant is None else build_can_emulator(chassis, link, plant)
    if plant is None:
        return build_serial_driver(chassis, SerialPortLink(link)), None
    # In one process, in memory: when the bytes of a pseudo-terminal arrive is up to the kernel.
    return _in_memory(chassis, plant)[:2]


def _in_memory(
    chassis: AnyChassisConfig, plant: TrackedPlant
) -> tuple[ChassisDriver, Emulator, ScriptedCanLink | ScriptedSerialLink]:
    if isinstance(chassis.link, CanLinkConfig):
        near, far = can_pair()
        return build_can_driver(chassis, near), _can_emulator(chassis, far, plant), near
    here, there = serial_pair()
    return build_serial_driver(chassis, here), build_serial_emulator(chassis, there, plant), here


def build_can_driver(config: AnyChassisConfig, link: CanLink) -> ChassisDriver:
    """The driver on a CAN bus, which may send only the listed commands; without the output guard."""
    assert isinstance(config, AgilexChassisConfig), "the one kind that is reached over CAN"
    return AgilexChassis(GuardedCanLink(link, AGILEX_COMMANDS), config)


def build_serial_driver(config: AnyChassisConfig, link: SerialLink) -> ChassisDriver:
    """The driver on a serial line; without the output guard."""
    match config:
        case AgilexChassisConfig():
            bus = AgilexSerialBus(link)
            return AgilexChassis(GuardedCanLink(bus, AGILEX_COMMANDS), config, bus.silence_hint)
        case RoboclawChassisConfig():
            return RoboclawChassis(link, config)
        case RoboteqChassisConfig():
            return RoboteqChassis(link, config)
        case KobukiChassisConfig():
            return KobukiChassis(link, config)
        case unknown:
            assert_never(unknown)


def build_can_emulator(config: AnyChassisConfig, link: CanLinkConfig, plant: TrackedPlant) -> Emulator:
    """The emulated base at the other end of a CAN bus. Raises DeviceNotFound, DeviceRefused when entered."""
    return _can_emulator(config, CanBusLink(link), plant)


def _can_emulator(config: AnyChassisConfig, link: CanLink, plant: TrackedPlant) -> Emulator:
    assert isinstance(config, AgilexChassisConfig), "the one kind that is reached over CAN"
    return AgilexEmulator(link, plant, model=model_of(config))


def build_pseudo_terminal() -> PseudoTerminal:
    """A serial port at which this process acts as the device."""
    return PseudoTerminal()


def build_serial_emulator(config: AnyChassisConfig, link: SerialLink, plant: TrackedPlant) -> Emulator:
    """The emulated base that this configuration expects, at the other end of a serial line."""
    match config:
        case AgilexChassisConfig():
            bus = AgilexSerialBus(link)
            return AgilexEmulator(bus, plant, model=model_of(config), over_serial=True)
        case RoboclawChassisConfig():
            return RoboclawEmulator(
                link,
                plant,
                counts_per_m=config.counts_per_m,
                address=config.address,
                signs=(config.left_sign, config.right_sign),
            )
        case RoboteqChassisConfig():
            return RoboteqEmulator(
                link,
                plant,
                full_speed_mps=config.full_speed_mps,
                counts_per_m=config.counts_per_m,
                signs=(config.left_sign, config.right_sign),
            )
        case KobukiChassisConfig():
            return KobukiEmulator(link, plant)
        case unknown:
            assert_never(unknown)
