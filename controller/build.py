"""Composition: builds the parts of a program from its YAML configuration.

Only this file and controller/build_chassis.py name concrete devices (apart from bench, campaign and
evaluation). There are no mode flags in the rest of the program: simulation, hardware in the loop and robot
differ only in the parts that the YAML asks for.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import assert_never

import cv2

from config.app import AppConfig
from config.camera import (
    OdometryChoice,
    RealsenseCameraConfig,
    ReplayCameraConfig,
    SimulatedCameraConfig,
)
from config.faults import NO_FAULTS, Faults
from config.governor import UdpInputConfig, UnixInputConfig
from config.path import LineSpec, PathSpec
from config.robot import Robot
from config.scenario import Scenario, load_scenario
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.control import ControlLoop, Decides
from controller.decision.decide import DecisionMaker
from controller.follow import PathFollower
from controller.own_parts import require_own_parts_in_view
from controller.path.path import Path, PathError
from controller.perceive import Perceiver
from controller.record.recorder import VideoSettings
from controller.shape import SpeedShaper
from hal.api import Chassis, Clock, DatagramLink, FrameSource, OdometrySource
from hal.cameras.bag_file import is_bag
from hal.cameras.bag_replay import BagReplay
from hal.cameras.bag_topics import WantedTopics
from hal.cameras.paced_recording import PacedRecording
from hal.cameras.pose_file import open_odometry
from hal.cameras.pose_track import PoseTrack
from hal.cameras.realsense import RealsenseCamera
from hal.cameras.recording import Recording
from hal.cameras.tum_replay import TumReplay
from hal.clocks import NS_PER_S
from hal.errors import BadRecording
from hal.geometry import mount_of
from hal.links.datagrams import UdpSocket, UnixSocket
from hal.types import Intrinsics, PlanarPose
from sim.rendering.camera import SimulatedCamera
from sim.rendering.faulty_camera import FaultyCamera
from sim.rendering.late_camera import LateCamera
from sim.simulation import Emulator, Referee, Simulation
from sim.world import World
from vision.perception import Perception

BodyPose = Callable[[int], PlanarPose | None]

# Frame rate that is assumed for recordings: for the period of the decision, and for videos where the
# recording's own rate is not known.
REPLAY_FPS = 30.0


def limit_vision_threads() -> None:
    """Let OpenCV use one core: the second one is for the control process."""
    cv2.setNumThreads(1)


def scenario_of(config: AppConfig) -> Scenario:
    """The world that is simulated. Raises ConfigError."""
    assert config.simulation is not None, "AppConfig asks for a simulation"
    scenario = config.simulation.scenario
    return load_scenario(config.resolve(scenario) if scenario.endswith((".yaml", ".yml")) else scenario)


def path_spec(config: AppConfig) -> tuple[str, PathSpec]:
    """Name of the file with the route (the program's YAML, or the scenario), and the route.

    Raises ConfigError.
    """
    if config.path is not None:
        return str(config.file), config.path
    assert config.simulation is not None, "AppConfig asks for a path or a simulation"
    return config.simulation.scenario, scenario_of(config).path


def build_path(config: AppConfig) -> Path:
    """The route, from the program's YAML or from the scenario. Raises ConfigError, PathError.

    A governed robot has a route in a simulation only; otherwise a straight one is returned.
    """
    if config.path is None and config.simulation is None:
        return straight_ahead(config.robot)
    where, spec = path_spec(config)
    try:
        return Path(spec, config.robot)
    except PathError as error:
        raise PathError(f"{where}: {error}") from error


def build_perceiver(
    config: AppConfig, odometry: OdometrySource, body_pose: BodyPose, stopwatch_ns: Callable[[], int]
) -> Perceiver:
    """Perception: detect and track, timed by stopwatch_ns."""
    limit_vision_threads()
    perception = Perception(
        config.perception,
        mount_of(config.robot),
        config.robot.body.height_m,
        config.robot.body.clearance_m,
        config.camera.own_parts,
    )
    return Perceiver(perception, odometry, body_pose, stopwatch_ns)


def build_control(config: AppConfig, chassis: Chassis) -> ControlLoop:
    """Decide, shape and follow, for a chassis that is opened elsewhere. Raises ConfigError, PathError."""
    return build_control_loop(config, build_path(config), build_decision(config), chassis)


def build_decision(config: AppConfig) -> DecisionMaker:
    """The decision for this robot and its camera."""
    period_s = 1.0 / config.runner.control_rate_hz
    noise = config.perception.depth_noise
    return DecisionMaker(config.decision, config.robot, mount_of(config.robot), period_s, noise)


def build_control_loop(config: AppConfig, path: Path, decide: Decides, chassis: Chassis) -> ControlLoop:
    """Shape, follow and localise around a decision; campaigns put other policies in its place."""
    limits, delay_s = config.robot.limits, config.decision.chassis_delay_s
    return ControlLoop(
        path=path,
        decide=decide,
        shape=SpeedShaper(limits, 1.0 / config.runner.control_rate_hz, delay_s),
        follow=PathFollower(path, limits, delay_s),
        localiser=Localiser(path.start, mount_of(config.robot)),
        chassis=chassis,
        response=ResponseMonitor(delay_s, limits.max_speed_mps),
    )


def open_camera(config: AppConfig, clock: Clock, body_pose: BodyPose, start_ns: int) -> FrameSource:
    """The camera that the YAML names, not yet entered. start_ns: time zero of a simulated world."""
    match config.camera:
        case SimulatedCameraConfig():
            faulty = open_faulty_camera(config, clock, body_pose, start_ns)
            return LateCamera(faulty, build_faults(config), clock, start_ns)
        case RealsenseCameraConfig() as camera:
            return RealsenseCamera(camera, clock)
        case ReplayCameraConfig() as camera:
            return PacedRecording(_recording(config, camera), clock)
        case unknown:
            assert_never(unknown)


def require_camera(config: AppConfig) -> None:
    """Check, before a robot is armed, that a recording can be opened, which another process will read, and
    that the own parts are where the camera sees them.

    Raises HalError, ConfigError.
    """
    view = config.camera.nominal_view
    camera = None if view is None else Intrinsics(*view)
    if isinstance(config.camera, ReplayCameraConfig):
        camera = _recording(config, config.camera).intrinsics
    if camera is not None:
        require_own_parts_in_view(config.file, config.camera.own_parts, mount_of(config.robot), camera)


def _recording(config: AppConfig, camera: ReplayCameraConfig) -> Recording:
    path = config.resolve(camera.folder)
    wanted = WantedTopics(camera.colour_topic, camera.depth_topic, gyro=camera.gyro_topic)
    if is_bag(path):
        return BagReplay(path, "none", wanted, camera.max_pair_gap_s, camera.gyro)
    _refuse_topics(path, wanted)
    return TumReplay(path, camera.max_pair_gap_s, camera.read_ahead, camera.gyro)


def open_simulated_camera(
    config: AppConfig, clock: Clock, body_pose: BodyPose, start_ns: int
) -> SimulatedCamera:
    """A camera in the scenario's world; the robot is at the path's start until body_pose tells its pose."""
    assert isinstance(config.camera, SimulatedCameraConfig)
    start = build_path(config).start
    return SimulatedCamera(
        build_world(config),
        config.camera,
        mount_of(config.robot),
        clock,
        body_pose=lambda stamp_ns: body_pose(stamp_ns) or start,
        start_ns=start_ns,
        own_parts=() if config.simulation is None else config.simulation.own_parts,
    )


def open_faulty_camera(config: AppConfig, clock: Clock, body_pose: BodyPose, start_ns: int) -> FaultyCamera:
    """The same camera with the faults of the scenario, except late frames, which the loop or LateCamera
    delays."""
    camera = open_simulated_camera(config, clock, body_pose, start_ns)
    scenario = scenario_of(config)
    glass = tuple(number for number, body in enumerate(scenario.bodies, start=1) if body.glass)
    return FaultyCamera(camera, scenario.faults, glass)


def build_faults(config: AppConfig) -> Faults:
    """What goes wrong in the scenario that is simulated. Raises ConfigError."""
    return NO_FAULTS if config.simulation is None else scenario_of(config).faults


def build_simulation(config: AppConfig, emulator: Emulator, start_ns: int) -> Simulation:
    """The emulated base in the scenario's world, with a referee. start_ns: the world's time zero."""
    referee = Referee(build_world(config), config.robot.body, start_ns)
    lost_s = build_faults(config).feedback_lost_s
    return Simulation(emulator, referee, None if lost_s is None else start_ns + round(lost_s * NS_PER_S))


def build_world(config: AppConfig) -> World:
    """The scenario that is simulated. Raises ConfigError."""
    assert config.simulation is not None, "AppConfig asks for a simulation"
    return World(scenario_of(config), config.simulation.seed)


def video_settings(config: AppConfig) -> VideoSettings:
    """What a video shows around the observations."""
    return VideoSettings(
        mount=mount_of(config.robot),
        body=config.robot.body,
        corridor_half_width_m=config.robot.body.width_m / 2.0 + config.decision.margins.lateral_m,
        fps=_fps(config),
        top_speed_mps=config.robot.limits.max_speed_mps,
        range_m=config.perception.max_depth_m,
        own_parts=config.camera.own_parts,
    )


def _fps(config: AppConfig) -> float:
    return REPLAY_FPS if isinstance(config.camera, ReplayCameraConfig) else float(config.camera.fps)


def open_commands(config: AppConfig) -> DatagramLink:
    """The socket at which a governor's commands arrive, not yet entered."""
    assert config.governor is not None, "checked by controller/governor/command.py"
    match config.governor.input:
        case UdpInputConfig() as udp:
            return UdpSocket(udp.host, udp.port)
        case UnixInputConfig() as unix:
            return UnixSocket(config.resolve(unix.path), unix.group_may_command)
        case unknown:
            assert_never(unknown)


def open_replay(
    path: FilePath, odometry: OdometryChoice, wanted: WantedTopics | None = None, use_gyro: bool = True
) -> tuple[Recording, PoseTrack | None]:
    """A recording (a folder or a ROS bag), not yet entered, and its odometry. wanted: topics of a bag.

    Raises BadRecording, and DeviceNotFound for a bag without the package that reads it.
    """
    wanted = wanted or WantedTopics()
    if is_bag(path):
        if odometry == "none" and wanted.odometry is not None:
            raise BadRecording(f"{path}: --odometry-topic has no effect with --odometry none; leave one out")
        if not use_gyro and wanted.gyro is not None:
            raise BadRecording(f"{path}: --gyro-topic has no effect with --no-gyro; leave one out")
        bag = BagReplay(path, odometry, wanted, use_gyro=use_gyro)
        return bag, bag.odometry
    _refuse_topics(path, wanted)
    return TumReplay(path, use_gyro=use_gyro), open_odometry(path, odometry)


def _refuse_topics(folder: FilePath, wanted: WantedTopics) -> None:
    if wanted != WantedTopics():
        raise BadRecording(
            f"{folder}: is no ROS bag, so it has no topics; leave out colour-topic and the like"
        )


def straight_ahead(robot: Robot) -> Path:
    """The path where none is given: straight on, longer than any camera sees."""
    return Path(PathSpec(segments=(LineSpec(kind="line", length_m=1000.0),)), robot)
