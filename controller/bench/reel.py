"""Frames to measure perception on, prepared beforehand: rendered along the path, or from a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from controller.path.path import Path
from hal.api import FrameSource
from hal.cameras.recording import Recording, frames_of
from hal.clocks import NS_PER_S
from hal.geometry import camera_in_floor
from hal.types import CameraMount, PlanarPose, Pose, RgbdFrame

Tick = Callable[[], None]

CRUISE_MPS = 1.0
_TIMEOUT_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Reel:
    """Frames in order, each with the camera's pose by dead reckoning at its time, if known."""

    frames: tuple[RgbdFrame, ...]
    odometry: tuple[Pose | None, ...]
    mount: CameraMount | None


def cruise(path: Path, stamp_ns: int) -> PlanarPose:
    """The robot's pose at stamp_ns on a drive along path at CRUISE_MPS; it stays at the end."""
    return path.pose(min(CRUISE_MPS * stamp_ns / NS_PER_S, path.length_m))


def render_reel(camera: FrameSource, path: Path, mount: CameraMount, frames: int, tick: Tick) -> Reel:
    """Frames of a simulated camera on a robot that drives along path from time zero of the camera's clock."""
    frames_read: list[RgbdFrame] = []
    with camera:
        for _ in range(frames):
            frames_read.append(camera.read(_TIMEOUT_S))
            tick()
    odometry = (camera_in_floor(cruise(path, frame.captured_ns), mount) for frame in frames_read)
    return Reel(tuple(frames_read), tuple(odometry), mount)


def recorded_reel(recording: Recording) -> Reel:
    """All frames of a recording, without odometry."""
    with recording:
        frames = tuple(frames_of(recording))
    return Reel(frames, (None,) * len(frames), recording.mount)
