"""Everything that one picture of the video shows."""

from __future__ import annotations

from dataclasses import dataclass

from config.own_parts import OwnPart
from config.robot import Body
from controller.decision.decision import Decision
from hal.types import CameraMount, FloatArray, RgbdFrame
from vision.scene import Fragments, Scene


@dataclass(frozen=True, slots=True, eq=False)
class VideoMoment:
    """A frame, what was seen in it, what was decided and how fast the robot went.

    decision: None if there is none (a recording that is only viewed).
    commanded_mps: speed of the setpoint that was sent; None or NaN: unknown.
    measured_mps: speed from the chassis' feedback; None or NaN: unknown.
    mount: None draws the top view relative to the camera, which is taken as level.
    body: None draws no robot.
    path_ahead_m: (N, 2) points of the planned path in the body frame, nearest first.
    corridor_half_width_m: how far to either side of the path the robot sweeps.
    ending: how the drive ended, for the frames that came after the last decision; empty: it goes on.
    own_parts: parts of the robot that its camera sees; they need a mount.
    """

    frame: RgbdFrame
    scene: Scene
    fragments: Fragments
    decision: Decision | None = None
    commanded_mps: float | None = None
    measured_mps: float | None = None
    mount: CameraMount | None = None
    body: Body | None = None
    path_ahead_m: FloatArray | None = None
    corridor_half_width_m: float | None = None
    ending: str = ""
    own_parts: tuple[OwnPart, ...] = ()
