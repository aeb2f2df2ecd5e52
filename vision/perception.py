"""The entry point of perception: detect and track, composed. The runners call it for each frame."""

from __future__ import annotations

from collections.abc import Sequence

from config.own_parts import OwnPart
from config.perception import PerceptionConfig
from hal.types import CameraMount, PlanarPose, Pose, RgbdFrame
from vision.detection import Detection
from vision.detector import Detector
from vision.percept import Percept
from vision.tracker import Tracker


class Perception:
    """Perception for one camera. detect and track are separate, so that a runner can time each of them."""

    def __init__(
        self,
        config: PerceptionConfig,
        mount: CameraMount | None,
        body_height_m: float,
        clearance_m: float,
        own_parts: Sequence[OwnPart] = (),
    ) -> None:
        """own_parts: parts of the robot in the camera's view. They need a mounting."""
        self._detector = Detector(config, mount, own_parts)
        self._tracker = Tracker(config, body_height_m, clearance_m)
        self._before: Percept | None = None

    def detect(self, frame: RgbdFrame, odometry: Pose | None) -> Detection:
        """RGB-D frame to fragments with their residuals.

        odometry: pose of the camera (optical frame) in the odometry frame at frame.captured_ns, by dead
        reckoning; None where not known.
        """
        return self._detector.step(frame, odometry, self._before)

    def track(self, detection: Detection, robot_pose: PlanarPose | None) -> Percept:
        """Fragments and depth to the scene. robot_pose is passed on to it."""
        percept = self._tracker.step(detection, robot_pose)
        self._before = percept
        return percept

    def perceive(self, frame: RgbdFrame, odometry: Pose | None, robot_pose: PlanarPose | None) -> Percept:
        """detect, then track."""
        return self.track(self.detect(frame, odometry), robot_pose)
