"""The input of one decision (controller/decision/decide.py)."""

from __future__ import annotations

import math

from controller.path.path import OnPath, Path
from hal.records import record
from hal.types import PlanarPose
from vision.scene import Scene

BACKWARDS_MPS = -0.05  # a smaller backward speed is noise of the odometry


class SceneError(Exception):
    """A scene contains impossible values: which obstacle, and which values."""


@record(frozen=True, slots=True, eq=False)
class Situation:
    """All that is known when a control step decides. path, pose and scene.robot_pose are in one frame.

    scene: the newest one, repeated until a newer one comes; None before the first.
    path: the planned path.
    pose, on_path: where the robot is, and the same in path coordinates.
    v_mps, a_mps2: speed (speed_to_decide_by) and commanded acceleration.
    now_ns: time of this step.
    """

    scene: Scene | None
    path: Path
    pose: PlanarPose
    on_path: OnPath
    v_mps: float
    a_mps2: float
    now_ns: int


def speed_to_decide_by(commanded_mps: float, measured_mps: float) -> float:
    """The greater of commanded and measured speed: braking for speed that is not there does less harm.

    If the base moves backwards, the measured speed, because the decision has to know. measured_mps: not
    finite if not known.
    """
    if not math.isfinite(measured_mps):
        return commanded_mps
    return measured_mps if measured_mps < BACKWARDS_MPS else max(commanded_mps, measured_mps)
