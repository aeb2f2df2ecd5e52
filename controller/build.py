"""Composition: the only place that names concrete devices. YAML in, the parts of a program out.

There are no mode flags behind this file: simulation, hardware in the loop and robot differ only in
which of these parts the YAML asks for.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import assert_never

import cv2

from config.app import AppConfig, ReplayConfig, SimulationConfig
from config.camera import OdometryChoice, RealsenseCameraConfig, ReplayCameraConfig, SimulatedCameraConfig
from config.chassis import (
    AgilexChassisConfig,
    AnyChassisConfig,
    CanLinkConfig,
    KobukiChassisConfig,
    PlantConfig,
    RoboclawChassisConfig,
    RoboteqChassisConfig,
)
from config.governor import InputConfig, UdpInputConfig, UnixInputConfig
from config.loader import resolve
from config.path import LineSpec, PathSpec
from config.robot import Robot
from config.scenario import Scenario, load_scenario
from controller.control import ControlLoop
from controller.decide import DecisionMaker
from controller.follow import PathFollower
from controller.guard import GuardedCanLink, GuardedChassis, GuardLimits
from controller.localise import Localiser
from controller.path import Path
from controller.perceive import Perceiver
from controller.recorder import Surroundings
from controller.shape import SpeedShaper
from hal.api import CanLink, Chassis, Clock, DatagramLink, FrameSource, OdometrySource, SerialLink
from hal.cameras.pose_file import PoseFile, open_odometry
from hal.cameras.realsense import RealsenseCamera
from hal.cameras.tum_replay import TumReplay
from hal.chassis.agilex import COMMANDS as AGILEX_COMMANDS
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_models import model_of
from hal.chassis.agilex_serial import AgilexSerialBus
from hal.chassis.kobuki import KobukiChassis
from hal.chassis.roboclaw import RoboclawChassis
from hal.chassis.roboteq import RoboteqChassis
from hal.links.can_bus import CanBusLink
from hal.links.datagrams import UdpSocket, UnixSocket
from hal.links.pseudo_terminal import PseudoTerminal
from hal.links.scripted import ScriptedCanLink, ScriptedSerialLink, can_pair, serial_pair
from hal.links.serial_port import SerialPortLink
from hal.types import CameraMount, PlanarPose
from sim.agilex_emulator import AgilexEmulator
from sim.camera import SimulatedCamera
from sim.kobuki_emulator import KobukiEmulator
from sim.plant import TrackedPlant
from sim.roboclaw_emulator import RoboclawEmulator
from sim.roboteq_emulator import RoboteqEmulator
from sim.simulation import Emulator, Referee, Simulation
from sim.world import World
from vision.perception import Perception

BodyPose = Callable[[int], PlanarPose | None]

# Recordings are shown at this rate, whatever theirs was.
REPLAY_FPS = 30.0
_ORIGIN = PlanarPose(0.0, 0.0, 0.0)


def limit_vision_threads() -> None:
    """One core for OpenCV: the second one belongs to the control process."""
    cv2.setNumThreads(1)


def mount_of(config: AppConfig) -> CameraMount:
    """Where the camera sits on this robot."""
    mount = config.robot.camera_mount
    return CameraMount(mount.forward_m, mount.left_m, mount.height_m, mount.pitch_rad)


def scenario_of(simulation: SimulationConfig, config_path: FilePath) -> Scenario:
    """The world of a simulation. Raises ConfigError."""
    if simulation.scenario.endswith((".yaml", ".yml")):
        return load_scenario(resolve(simulation.scenario, config_path))
    return load_scenario(simulation.scenario)


def build_path(config: AppConfig, config_path: FilePath) -> Path:
    """The route, from the program's YAML or from the scenario. Raises ConfigError, PathError.

    A governed robot has none but in a simulation: straight on from where it stands.
    """
    if config.path is not None:
        return Path(config.path, config.robot)
    if config.governor is not None and config.simulation is None:
        return straight_ahead(config.robot)
    assert config.simulation is not None, "AppConfig asks for a path or a simulation"
    return Path(scenario_of(config.simulation, config_path).path, config.robot)


def build_perceiver(
    config: AppConfig, odometry: OdometrySource, body_pose: BodyPose, stopwatch_ns: Callable[[], int]
) -> Perceiver:
    """detect and track, timed by stopwatch_ns."""
    limit_vision_threads()
    perception = Perception(
        config.perception, mount_of(config), config.robot.body.height_m, config.robot.body.clearance_m
    )
    return Perceiver(perception, odometry, body_pose, stopwatch_ns)


def build_control(config: AppConfig, config_path: FilePath, chassis: Chassis) -> ControlLoop:
    """Decide, shape and follow around a chassis that is opened elsewhere. Raises ConfigError, PathError."""
    robot, decision = config.robot, config.decision
    period_s = 1.0 / config.runner.control_rate_hz
    path = build_path(config, config_path)
    mount = mount_of(config)
    return ControlLoop(
        path=path,
        decide=DecisionMaker(decision, robot, mount, period_s),
        shape=SpeedShaper(robot.limits, period_s, decision.chassis_delay_s),
        follow=PathFollower(path, robot.limits, decision.chassis_delay_s),
        localiser=Localiser(path.start, mount),
        chassis=chassis,
    )


def open_camera(
    config: AppConfig, config_path: FilePath, clock: Clock, body_pose: BodyPose, start_ns: int
) -> FrameSource:
    """The camera that the YAML names, not yet entered. start_ns: time zero of a simulated world."""
    match config.camera:
        case SimulatedCameraConfig():
            return open_simulated_camera(config, config_path, clock, body_pose, start_ns)
        case RealsenseCameraConfig() as camera:
            return RealsenseCamera(camera, clock)
        case ReplayCameraConfig() as camera:
            return TumReplay(resolve(camera.folder, config_path), camera.max_pair_gap_s, camera.read_ahead)
        case unknown:
            assert_never(unknown)


def open_simulated_camera(
    config: AppConfig, config_path: FilePath, clock: Clock, body_pose: BodyPose, start_ns: int
) -> SimulatedCamera:
    """A camera in the scenario's world, at the path's start until body_pose knows better."""
    assert isinstance(config.camera, SimulatedCameraConfig)
    start = build_path(config, config_path).start
    return SimulatedCamera(
        _world(config, config_path),
        config.camera,
        mount_of(config),
        clock,
        lambda stamp_ns: body_pose(stamp_ns) or start,
        start_ns,
    )


def build_simulation(
    config: AppConfig, config_path: FilePath, emulator: Emulator, start_ns: int
) -> Simulation:
    """The emulated base in the scenario's world, with a referee. start_ns: the world's time zero."""
    return Simulation(emulator, Referee(_world(config, config_path), config.robot.body, start_ns))


def _world(config: AppConfig, config_path: FilePath) -> World:
    assert config.simulation is not None, "AppConfig asks for a simulation"
    return World(scenario_of(config.simulation, config_path), config.simulation.seed)


def surroundings(config: AppConfig) -> Surroundings:
    """What a video shows around the observations."""
    return Surroundings(
        mount_of(config),
        config.robot.body,
        config.robot.body.width_m / 2.0 + config.decision.margins.lateral_m,
        _fps(config),
        config.robot.limits.max_speed_mps,
        config.perception.max_depth_m,
    )


def _fps(config: AppConfig) -> float:
    return REPLAY_FPS if isinstance(config.camera, ReplayCameraConfig) else float(config.camera.fps)


def build_base(config: AppConfig, start: PlanarPose, start_ns: int) -> tuple[Chassis, Emulator | None]:
    """The chassis driver, and the emulator at the other end of its link if one is asked for.

    Neither is opened yet; enter the emulator first. Raises DeviceNotFound, DeviceRefused when entered.
    """
    driver, emulator = _bare_base(config, start, start_ns)
    return _guarded(config, driver), emulator


def build_base_in_memory(
    config: AppConfig, start: PlanarPose, start_ns: int
) -> tuple[Chassis, Emulator, ScriptedCanLink | ScriptedSerialLink]:
    """Guarded driver and emulator on a wire in memory, and the driver's end of it, to be pulled out."""
    of_plant = PlantConfig() if config.simulation is None else config.simulation.plant
    driver, emulator, near = _in_memory(config.chassis, TrackedPlant(of_plant, start, start_ns))
    return _guarded(config, driver), emulator, near


def _guarded(config: AppConfig, driver: Chassis) -> Chassis:
    return GuardedChassis(driver, GuardLimits.of(config.robot.limits, 1.0 / config.runner.control_rate_hz))


def _bare_base(config: AppConfig, start: PlanarPose, start_ns: int) -> tuple[Chassis, Emulator | None]:
    simulation, chassis, link = config.simulation, config.chassis, config.chassis.link
    plant = None
    if simulation is not None and simulation.base == "emulated":
        plant = TrackedPlant(simulation.plant, start, start_ns)
    if isinstance(link, CanLinkConfig):
        driver = build_can_driver(chassis, CanBusLink(link))
        return driver, None if plant is None else build_can_emulator(chassis, link, plant)
    if plant is None:
        return build_serial_driver(chassis, SerialPortLink(link)), None
    # In one process and in memory: a pseudo-terminal's bytes arrive when the kernel likes.
    return _in_memory(chassis, plant)[:2]


def _in_memory(
    chassis: AnyChassisConfig, plant: TrackedPlant
) -> tuple[Chassis, Emulator, ScriptedCanLink | ScriptedSerialLink]:
    if isinstance(chassis.link, CanLinkConfig):
        near, far = can_pair()
        return build_can_driver(chassis, near), _can_emulator(chassis, far, plant), near
    here, there = serial_pair()
    return build_serial_driver(chassis, here), build_serial_emulator(chassis, there, plant), here


def build_can_driver(config: AnyChassisConfig, link: CanLink) -> Chassis:
    """The driver on a CAN bus, behind the list of what may be sent there; without the output guard."""
    assert isinstance(config, AgilexChassisConfig), "the one kind that is reached over CAN"
    return AgilexChassis(GuardedCanLink(link, AGILEX_COMMANDS), config)


def build_serial_driver(config: AnyChassisConfig, link: SerialLink) -> Chassis:
    """The driver on a serial line; without the output guard."""
    match config:
        case AgilexChassisConfig():
            bus = AgilexSerialBus(link)
            return AgilexChassis(GuardedCanLink(bus, AGILEX_COMMANDS), config, bus.silence)
        case RoboclawChassisConfig():
            return RoboclawChassis(link, config)
        case RoboteqChassisConfig():
            return RoboteqChassis(link, config)
        case KobukiChassisConfig():
            return KobukiChassis(link, config)
        case unknown:
            assert_never(unknown)


def build_can_emulator(config: AnyChassisConfig, link: CanLinkConfig, plant: TrackedPlant) -> Emulator:
    """The base at the other end of a CAN bus. Raises DeviceNotFound, DeviceRefused when entered."""
    return _can_emulator(config, CanBusLink(link), plant)


def _can_emulator(config: AnyChassisConfig, link: CanLink, plant: TrackedPlant) -> Emulator:
    assert isinstance(config, AgilexChassisConfig), "the one kind that is reached over CAN"
    return AgilexEmulator(link, plant, model=model_of(config))


def build_pseudo_terminal() -> PseudoTerminal:
    """A serial port of which this process is the device."""
    return PseudoTerminal()


def build_serial_emulator(config: AnyChassisConfig, link: SerialLink, plant: TrackedPlant) -> Emulator:
    """The base that this driver's configuration expects, at the other end of a serial line."""
    match config:
        case AgilexChassisConfig():
            bus = AgilexSerialBus(link)
            return AgilexEmulator(bus, plant, model=model_of(config), over_serial=True)
        case RoboclawChassisConfig():
            return RoboclawEmulator(link, plant, counts_per_m=config.counts_per_m, address=config.address)
        case RoboteqChassisConfig():
            return RoboteqEmulator(
                link, plant, full_speed_mps=config.full_speed_mps, counts_per_m=config.counts_per_m
            )
        case KobukiChassisConfig():
            return KobukiEmulator(link, plant)
        case unknown:
            assert_never(unknown)


def open_commands(config: InputConfig) -> DatagramLink:
    """Where a governor's commands arrive, not yet entered."""
    match config:
        case UdpInputConfig():
            return UdpSocket(config.host, config.port)
        case UnixInputConfig():
            return UnixSocket(FilePath(config.path).expanduser(), config.group_may_command)
        case unknown:
            assert_never(unknown)


def open_replay(folder: FilePath, odometry: OdometryChoice) -> tuple[TumReplay, PoseFile | None]:
    """A recording, not yet entered, and its odometry. Raises BadRecording."""
    return TumReplay(folder), open_odometry(folder, odometry)


def build_replay_perceiver(
    config: ReplayConfig,
    mount: CameraMount | None,
    odometry: OdometrySource | None,
    stopwatch_ns: Callable[[], int],
) -> Perceiver:
    """detect and track for a recording, whose body stands at the origin of every frame."""
    limit_vision_threads()
    body = config.robot.body
    perception = Perception(config.perception, mount, body.height_m, body.clearance_m)
    return Perceiver(perception, odometry, lambda _stamp_ns: _ORIGIN, stopwatch_ns)


def build_replay_decision(config: ReplayConfig, mount: CameraMount | None) -> DecisionMaker:
    """A decision for each frame; an unknown mounting is taken as level, at the robot's front."""
    front_m = config.robot.body.front_m
    level = CameraMount(front_m, 0.0, config.robot.camera_mount.height_m, 0.0)
    return DecisionMaker(config.decision, config.robot, mount or level, 1.0 / REPLAY_FPS)


def replay_surroundings(config: ReplayConfig, mount: CameraMount | None) -> Surroundings:
    """What a replay's video shows around the observations."""
    return Surroundings(
        mount,
        config.robot.body if mount is not None else None,
        config.robot.body.width_m / 2.0 + config.decision.margins.lateral_m,
        REPLAY_FPS,
        config.robot.limits.max_speed_mps,
        config.perception.max_depth_m,
    )


def straight_ahead(robot: Robot) -> Path:
    """A path where there is none: straight on, longer than any camera sees."""
    return Path(PathSpec(segments=(LineSpec(kind="line", length_m=1000.0),)), robot)
