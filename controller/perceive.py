"""Perception of one frame: detect, then track, with the odometry of its time, each stage timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hal.api import OdometrySource
from hal.clocks import NS_PER_MS
from hal.types import PlanarPose, Pose, RgbdFrame
from vision.perception import Perception
from vision.scene import Fragments, Scene


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A frame and what was seen in it.

    timing_ms: how long each stage took. camera_pose: by odometry at the time of the frame; None if there is
    none.
    """

    frame: RgbdFrame
    scene: Scene
    fragments: Fragments
    timing_ms: dict[str, float]
    camera_pose: Pose | None = None


class Perceiver:
    """Feeds perception; measures the time of the stages, since they have no clock.

    body_pose: pose of the robot at a time, for the scene. stopwatch_ns: clock for the durations.
    """

    def __init__(
        self,
        perception: Perception,
        odometry: OdometrySource | None,
        body_pose: Callable[[int], PlanarPose | None],
        stopwatch_ns: Callable[[], int],
    ) -> None:
        self._perception = perception
        self._odometry = odometry
        self._body_pose = body_pose
        self._stopwatch_ns = stopwatch_ns

    def look(self, frame: RgbdFrame) -> Look:
        """Detect, then track."""
        camera_pose = None if self._odometry is None else self._odometry.camera_pose(frame.captured_ns)
        started_ns = self._stopwatch_ns()
        detection = self._perception.detect(frame, camera_pose)
        detected_ns = self._stopwatch_ns()
        percept = self._perception.track(detection, self._body_pose(frame.captured_ns))
        tracked_ns = self._stopwatch_ns()
        timing_ms = {
            "detect": (detected_ns - started_ns) / NS_PER_MS,
            "track": (tracked_ns - detected_ns) / NS_PER_MS,
        }
        return Look(frame, percept.scene, percept.fragments, timing_ms, camera_pose)
