"""The log of one drive of a campaign, the same for every mode and policy: one entry per control step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from controller.decision.decision import Action, Decision
from controller.record.tally import SetpointTally
from hal.types import FloatArray, PlanarPose


@dataclass
class DriveLog:
    """The log of a drive. Poses, s_m and v_mps are the true ones.

    reached_s: when the robot came to rest on the target; None: never.
    """

    setpoints: SetpointTally
    times_s: list[float] = field(default_factory=list)
    poses: list[tuple[float, float, float]] = field(default_factory=list)
    s_m: list[float] = field(default_factory=list)
    v_mps: list[float] = field(default_factory=list)
    actions: list[Action] = field(default_factory=list)
    rules: list[str] = field(default_factory=list)
    sentences: list[str] = field(default_factory=list)
    reached_s: float | None = None

    def add(self, t_s: float, pose: PlanarPose, s_m: float, v_mps: float, decision: Decision) -> None:
        """Append one control step."""
        self.times_s.append(t_s)
        self.poses.append((pose.x_m, pose.y_m, pose.heading_rad))
        self.s_m.append(s_m)
        self.v_mps.append(v_mps)
        self.actions.append(decision.action)
        self.rules.append(decision.reason.rule)
        self.sentences.append(decision.reason.sentence)

    def pose_array(self) -> FloatArray:
        """The poses as (T, 3): x, y, heading."""
        return np.array(self.poses).reshape(-1, 3)
