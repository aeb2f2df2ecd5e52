"""What the two processes of the real-time runner tell each other, over controller/realtime/channel.py."""

from __future__ import annotations

from dataclasses import dataclass

from controller.control import ControlStep
from hal.types import PlanarPose
from vision.scene import Scene

# Reason of the farewell at the end of a recording that stands in for the camera.
STREAM_ENDED = "the camera's stream has ended"


@dataclass(frozen=True, slots=True, eq=False)
class SceneMessage:
    """Perception to control: a scene, and the processing time of its stages."""

    scene: Scene
    timing_ms: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class StepMessage:
    """Control to perception: a control step.

    true_pose: the robot's true pose in a simulated world, for a simulated camera; None without a world.
    """

    control: ControlStep
    true_pose: PlanarPose | None


@dataclass(frozen=True, slots=True)
class Farewell:
    """Perception to control: the last message before the process ends, with the reason."""

    reason: str


@dataclass(frozen=True, slots=True)
class CutOff:
    """Perception to control: an output of the drive has ended, with the reason. Perception goes on."""

    reason: str
