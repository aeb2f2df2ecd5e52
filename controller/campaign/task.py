"""One mission with all its policies, as a worker process runs it."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Literal

from config.app import AppConfig, LockstepRunner
from config.camera import SimulatedCameraConfig
from config.scenario import Scenario
from controller.campaign import oracle
from controller.campaign.camera_mission import drive_camera
from controller.campaign.judge import JudgeReference, Row, judge
from controller.campaign.noise_mission import drive_noise
from controller.campaign.noise_model import NoiseModel
from controller.campaign.policies import build_policy
from controller.campaign.stage import Stage, sight_limited_speed_mps
from controller.campaign.view import PlanarCamera
from sim.families import Case, generate

Mode = Literal["noise", "camera"]


@dataclass(frozen=True, slots=True)
class Task:
    """A mission and the policies that drive it.

    keep: folder for recording and video of failed drives in camera mode; None: none are written.
    keep_all: write those of all drives.
    scenario: the world, where it is a user's own and no family's.
    """

    family: str
    seed: int
    policies: tuple[str, ...]
    mode: Mode
    config: AppConfig
    keep: FilePath | None = None
    keep_all: bool = False
    scenario: Scenario | None = None

    @property
    def case(self) -> Case:
        """What is driven."""
        if self.scenario is not None:
            return Case(self.family, self.seed, self.scenario)
        return generate(self.family, self.seed)


def run_task(task: Task) -> list[Row]:
    """A row for each policy, in their order. The same task gives the same rows on every machine."""
    stage = Stage(task.case, task.config.robot)
    reference = judge_reference(stage, task.config)
    return [_run(task, stage, policy, reference) for policy in task.policies]


def judge_reference(stage: Stage, config: AppConfig) -> JudgeReference:
    """The yardstick for drives of this mission."""
    assert isinstance(config.camera, SimulatedCameraConfig), "checked by controller/campaign/command.py"
    assert isinstance(config.runner, LockstepRunner), "checked by controller/campaign/command.py"
    best = oracle.solve(stage, sight_limited_speed_mps(config), stage.case.scenario.duration_s)
    reaction_s = (
        NoiseModel().sightings / config.camera.fps
        + config.runner.perception_latency_s
        + 1.0 / config.runner.control_rate_hz
        + config.decision.chassis_delay_s
    )
    robot = config.robot
    planar_camera = PlanarCamera(stage.world, config.camera, robot.camera_mount, robot.body.height_m)
    return JudgeReference(best, planar_camera, reaction_s)


def _run(task: Task, stage: Stage, policy: str, reference: JudgeReference) -> Row:
    config = task.config
    if task.mode == "noise":
        with _garbage_collector_off():
            log = drive_noise(stage, config, build_policy(policy, config, stage))
        return judge(stage, log, policy, task.mode, reference)
    keep = None if task.keep is None else task.keep / f"{task.family}-{task.seed}-{policy}"
    log = drive_camera(stage, config, policy, keep if task.keep_all else None)
    row = judge(stage, log, policy, task.mode, reference)
    if keep is not None and not task.keep_all and failed(row):
        # Repeat the drive and record it. Recording every drive would cost more.
        drive_camera(stage, config, policy, keep)
    return row


@contextmanager
def _garbage_collector_off() -> Iterator[None]:
    """Switch the garbage collector off: reference counting frees what a drive leaves behind, and the search
    for reference cycles would take 5 % of the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def failed(row: Row) -> bool:
    """Whether a drive failed: contact at fault, expected target missed, limits violated, or reversals."""
    missed = row.expected and not row.reached
    return bool(row.contacts_at_fault or missed or row.limit_violations or row.reversals)


def time_ratio(row: Row) -> float:
    """Time divided by the oracle's; NaN if not even the oracle arrives, or if the target should not be
    reached.

    Infinite if the drive did not arrive, and if it was at fault in a contact: driving through people must not
    count as fast.
    """
    if row.oracle_time_s is None or not row.expected:
        return math.nan
    if row.time_s is None or row.contacts_at_fault:
        return math.inf
    return row.time_s / row.oracle_time_s
