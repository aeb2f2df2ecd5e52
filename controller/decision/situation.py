"""What one decision is asked about."""

from __future__ import annotations

from controller.path.path import OnPath, Path
from hal.records import record
from hal.types import PlanarPose
from vision.scene import Scene


@record(frozen=True, slots=True, eq=False)
class Situation:
    """All that is known when a control step decides. path, pose and scene.robot_pose are in one frame.

    scene: the newest there is, in every step until a newer one comes; None before the first. on_path: where
    the pose is along the path. v_mps, a_mps2: commanded (or measured, if more).
    """

    scene: Scene | None
    path: Path
    pose: PlanarPose
    on_path: OnPath
    v_mps: float
    a_mps2: float
    now_ns: int
