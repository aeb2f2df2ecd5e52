"""The input of one decision (controller/decision/decide.py)."""

from __future__ import annotations

from controller.path.path import OnPath, Path
from hal.records import record
from hal.types import PlanarPose
from vision.scene import Scene


class SceneError(Exception):
    """A scene contains impossible values: which obstacle, and which values."""


@record(frozen=True, slots=True, eq=False)
class Situation:
    """All that is known when a control step decides. path, pose and scene.robot_pose are in one frame.

    scene: the newest one, repeated until a newer one comes; None before the first.
    path: the planned path.
    pose, on_path: where the robot is, and the same in path coordinates.
    v_mps, a_mps2: commanded speed (or the measured one, if greater) and commanded acceleration.
    now_ns: time of this step.
    """

    scene: Scene | None
    path: Path
    pose: PlanarPose
    on_path: OnPath
    v_mps: float
    a_mps2: float
    now_ns: int
