"""The whole configuration of one program: robot, camera, chassis, what it does and how it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from config.camera import (
    AnyCameraConfig,
    CameraConfig,
    CameraSection,
    ReplayCameraConfig,
    SimulatedCameraConfig,
)
from config.chassis import ChassisConfig
from config.chassis_checks import check_protocol, check_top_speed, check_turns
from config.decision import DecisionConfig
from config.governor import GovernorConfig
from config.loader import CONFIG_DIR, Section, load, read_yaml, resolve
from config.own_parts import OwnPart, check_own_parts
from config.path import PathSpec
from config.perception import PerceptionConfig
from config.plant import PlantConfig
from config.robot import Robot

# Every base that can be emulated, as in hil_file.
HIL_BASES = tuple(sorted(path.stem.removeprefix("hil-") for path in CONFIG_DIR.glob("hil-*.yaml")))
# Keys that a robot with a real camera must give; in a simulation each has a default.
_OF_A_REAL_ROBOT = {
    "body": ("width_m", "length_m", "rear_m", "height_m"),
    "limits": ("max_speed_mps",),
    "camera_mount": ("forward_m", "height_m", "pitch_deg"),
}


class SimulationConfig(Section):
    """The simulated outside: a world with moving things, and the plant that the emulator drives."""

    scenario: str = Field(description="a scenario that ships, by name, or a YAML file beside this one")
    seed: int = Field(default=1, ge=0)
    plant: PlantConfig = PlantConfig()
    own_parts: Annotated[tuple[OwnPart, ...], Field(strict=False)] = Field(
        default=(),
        description="parts of the robot that the simulated camera sees; camera.own_parts cuts them out again",
    )
    base: Literal["emulated", "external"] = Field(
        default="emulated",
        description="external: a base or an emulator of its own stands at the other end of chassis.link, "
        "and the simulated camera follows the motion that it reports",
    )


class LockstepRunner(Section):
    """One thread, simulated time, repeatable to the bit. `treadwatch replay` has a loop of its own."""

    kind: Literal["lockstep"]
    control_rate_hz: float = Field(default=50.0, ge=10, le=500)
    perception_latency_s: float = Field(
        default=0.060, ge=0, le=1, description="from exposure until the decision can use the scene"
    )
    max_duration_s: float = Field(default=300.0, gt=0, description="give up after this much time")
    max_standing_s: float = Field(
        default=120.0,
        gt=0,
        description="end the run once the robot has stood for this long",
    )


class RealtimeRunner(Section):
    """Perception and control as two processes on the monotonic clock."""

    kind: Literal["realtime"]
    control_rate_hz: float = Field(default=50.0, ge=10, le=500)
    priority: int = Field(default=50, ge=0, le=90, description="SCHED_FIFO; 0: ordinary scheduling")
    frame_timeout_s: float = Field(default=1.0, gt=0, le=10)
    max_duration_s: float | None = Field(default=None, gt=0)


RunnerConfig = Annotated[LockstepRunner | RealtimeRunner, Field(discriminator="kind")]


def _check_speeds(robot: Robot, perception: PerceptionConfig) -> None:
    """Perception must believe every speed that the decision allows for. Raises ValueError."""
    reckoned_mps, believed_mps = robot.limits.max_obstacle_speed_mps, perception.motion.max_speed_mps
    if believed_mps < reckoned_mps:
        raise ValueError(
            f"perception.motion.max_speed_mps ({believed_mps:g}) is less than "
            f"robot.limits.max_obstacle_speed_mps ({reckoned_mps:g}): give both the same value"
        )


def _check_range(perception: PerceptionConfig, decision: DecisionConfig) -> None:
    """The speed may only rely on floor within the depth that perception looks at. Raises ValueError."""
    counted_on_m, looked_at_m = decision.sight.range_m, perception.max_depth_m
    if counted_on_m > looked_at_m:
        raise ValueError(
            f"decision.sight.range_m ({counted_on_m:g}) is more than perception.max_depth_m "
            f"({looked_at_m:g}), beyond which nothing is looked at: give both the same value"
        )


def _check_latency(runner: LockstepRunner | RealtimeRunner, decision: DecisionConfig) -> None:
    """If every scene is stale when it arrives, the robot never moves. Raises ValueError."""
    if isinstance(runner, LockstepRunner) and runner.perception_latency_s >= decision.sight.stale_s:
        raise ValueError(
            f"runner.perception_latency_s ({runner.perception_latency_s:g}) must be less than "
            f"decision.sight.stale_s ({decision.sight.stale_s:g}): every scene would be stale when it comes"
        )


def _check_frames(
    camera: AnyCameraConfig,
    runner: LockstepRunner | RealtimeRunner,
    perception: PerceptionConfig,
    decision: DecisionConfig,
) -> None:
    """If a scene grows stale before the next one comes, the robot brakes between any two. Raises ValueError.

    A recording is not checked: its rate is not in the configuration.
    """
    if isinstance(camera, ReplayCameraConfig):
        return
    period_s, latency_s = 1.0 / camera.fps, 0.0
    if isinstance(runner, LockstepRunner):
        latency_s = runner.perception_latency_s
    elif not isinstance(camera, SimulatedCameraConfig):
        latency_s = camera.latency_s
    if period_s + latency_s > decision.sight.stale_s + 1e-9:
        raise ValueError(
            f"camera.fps ({camera.fps:g}): a scene is {period_s + latency_s:.3g} s old before the next one "
            f"comes, with the latency of {latency_s:g} s, and stale after decision.sight.stale_s "
            f"({decision.sight.stale_s:g}): the robot would stop between any two; raise fps or stale_s"
        )
    if period_s > perception.max_gap_s:
        raise ValueError(
            f"camera.fps ({camera.fps:g}): frames are {period_s:.3g} s apart, more than perception.max_gap_s "
            f"({perception.max_gap_s:g}), so no two would be compared; raise either"
        )


class AppConfig(Section):
    """What `treadwatch run` and `treadwatch govern` read with --config FILE.

    It knows its file: the files that it names are beside it. Copies know it, too, also in another process.
    """

    robot: Robot = Robot()
    camera: CameraConfig
    chassis: ChassisConfig
    perception: PerceptionConfig = PerceptionConfig()
    decision: DecisionConfig = DecisionConfig()
    path: PathSpec | None = Field(default=None, description="the route; a simulation has its own")
    simulation: SimulationConfig | None = None
    governor: GovernorConfig | None = Field(
        default=None,
        description="another planner commands the robot, in place of a path: `treadwatch govern`",
    )
    runner: RunnerConfig

    # Without a file, names are relative to the working directory, and messages say this.
    _file: Path = PrivateAttr(default=Path("configuration"))

    @property
    def file(self) -> Path:
        """The YAML that this was read from."""
        return self._file

    def resolve(self, name: str) -> Path:
        """The path of a file that this configuration names (config/loader.py)."""
        return resolve(name, self._file)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.camera.kind != "simulated":
            self._check_real_robot()  # first: a default that does not fit is not the user's mistake
        check_own_parts(self.camera.own_parts, self.robot)
        _check_speeds(self.robot, self.perception)
        _check_range(self.perception, self.decision)
        _check_latency(self.runner, self.decision)
        _check_frames(self.camera, self.runner, self.perception, self.decision)
        check_top_speed(self.robot, self.chassis)
        self._check_way()
        check_turns(self.robot, self.chassis)
        self._check_simulated_time()
        check_protocol(self.robot, self.chassis, self.runner.control_rate_hz)
        return self

    def _check_way(self) -> None:
        """Exactly one of scenario, path and governor says where the robot goes. Raises ValueError."""
        simulated = self.camera.kind == "simulated"
        if simulated and self.simulation is None:
            raise ValueError("camera.kind 'simulated' needs a 'simulation' section with a scenario")
        if not simulated and self.path is None and self.governor is None:
            raise ValueError(
                f"camera.kind {self.camera.kind!r} needs a 'path': there is no scenario to give one"
            )
        if self.governor is not None and self.path is not None:
            raise ValueError("give a 'path' or a 'governor', not both")
        if self.governor is not None and self.runner.kind != "realtime":
            raise ValueError("a 'governor' hears commands as they come and needs runner.kind 'realtime'")
        if simulated and self.path is not None:
            raise ValueError("a simulation drives the path of its scenario: write it there, not here")

    def _check_simulated_time(self) -> None:
        """Nothing outside of the program keeps to the time of the lock-step loop. Raises ValueError."""
        if self.runner.kind != "lockstep":
            return
        if self.camera.kind != "simulated":
            raise ValueError(
                "runner.kind 'lockstep' runs on simulated time and needs camera.kind 'simulated'"
            )
        if self.simulation is not None and self.simulation.base == "external":
            raise ValueError(
                "runner.kind 'lockstep' runs on simulated time and needs simulation.base 'emulated'; with an "
                "external base use runner.kind 'realtime'"
            )

    def _check_real_robot(self) -> None:
        """Size, mounting and speed of a real robot have no defaults. Raises ValueError."""
        missing = []
        for section, keys in _OF_A_REAL_ROBOT.items():
            if section not in self.robot.model_fields_set:
                missing.append(section)
                continue
            given = getattr(self.robot, section).model_fields_set
            missing += [f"{section}.{key}" for key in keys if key not in given]
        if missing:
            raise ValueError(
                f"camera.kind {self.camera.kind!r} needs robot.{', robot.'.join(missing)}: nothing of a real "
                "robot is guessed; measure yours"
            )


def load_app(path: Path) -> AppConfig:
    """Read and check one program's YAML. Raises ConfigError."""
    config = load(path, AppConfig)
    config._file = path
    return config


class ReplayedCameraConfig(CameraSection):
    """The camera of a recording that is replayed: everything but own_parts is in the recording."""


class ReplayConfig(Section):
    """What `treadwatch replay --config FILE` reads: how a recording is looked at.

    The camera's mounting is taken from the recording if it says so, from here with assume_mount or where this
    is the YAML of a robot, and is unknown otherwise (a hand-held camera has none).
    """

    robot: Robot = Robot()
    camera: ReplayedCameraConfig = ReplayedCameraConfig()
    perception: PerceptionConfig = PerceptionConfig()
    decision: DecisionConfig = DecisionConfig()
    assume_mount: bool = Field(default=False, description="use robot.camera_mount where none is recorded")

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        check_own_parts(self.camera.own_parts, self.robot)
        _check_speeds(self.robot, self.perception)
        _check_range(self.perception, self.decision)
        return self


def hil_file(base: str) -> Path:
    """The YAML that ships of a mission with this emulated base."""
    return CONFIG_DIR / f"hil-{base}.yaml"


def load_replay(path: Path) -> ReplayConfig:
    """Read and check a replay's YAML, or that of a robot, which says more: it knows where its camera is.

    Raises ConfigError.
    """
    content = read_yaml(path)
    if isinstance(content, dict) and "chassis" in content:
        robot = load_app(path)
        return ReplayConfig(
            robot=robot.robot,
            camera=ReplayedCameraConfig(own_parts=robot.camera.own_parts),
            perception=robot.perception,
            decision=robot.decision,
            assume_mount=True,
        )
    return load(path, ReplayConfig)
