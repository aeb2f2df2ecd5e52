"""The simulated set: the sequences, and which of them the detector may be tuned on.

Seeds are fixed, so every run renders the same images. About a third is for tuning; figures are reported on
the others. The sequences were not chosen by what a detector finds hard or easy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from config.camera import SimulatedCameraConfig
from config.scenario import Scenario
from controller.evaluation.simulated_set.places import PlaceName
from controller.evaluation.simulated_set.scenes import Mover, build, side_by_side
from controller.evaluation.simulated_set.scripted_drive import SLIPPING, Knot, OdometryError, ScriptedDrive

Split = Literal["tuning", "reporting"]
Noise = Literal["realsense", "paper"]

_USUAL = OdometryError()
_MOVING_S = 4.0
_STATIC_S = 6.0


@dataclass(frozen=True, slots=True)
class Sequence:
    """One run of the robot through a scene.

    course: speed and yaw rate over time.
    noise: model of the depth noise.
    error: of the odometry.
    vibration_deg: amplitude in pitch.
    """

    name: str
    split: Split
    course: tuple[Knot, ...]
    movers: tuple[Mover, ...]
    place: PlaceName
    noise: Noise
    seed: int
    error: OdometryError = _USUAL
    vibration_deg: float = 0.0
    duration_s: float = _MOVING_S

    @property
    def static(self) -> bool:
        """Whether nothing but the camera moves."""
        return not self.movers

    def drive(self) -> ScriptedDrive:
        """The robot's motion."""
        return ScriptedDrive(self.course, self.duration_s, self.error)

    def scenario(self) -> Scenario:
        """The world."""
        return build(self.name, self.place, self.drive(), self.movers, self.duration_s, self.seed)

    def camera(self) -> SimulatedCameraConfig:
        """The camera: 640x480 at 30 frames per second."""
        return SimulatedCameraConfig(
            width=640,
            height=480,
            depth_noise=self.noise,
            vibration_deg=self.vibration_deg,
            vibration_hz=9.0,
        )


def straight(v_mps: float) -> tuple[Knot, ...]:
    """Straight ahead at a constant speed."""
    return (Knot(0.0, v_mps),)


def arc(v_mps: float, w_radps: float) -> tuple[Knot, ...]:
    """On a circle."""
    return (Knot(0.0, v_mps, w_radps),)


_STILL = straight(0.0)
_SPEEDING_UP = (Knot(0.0, 0.2), Knot(4.0, 1.4))  # 0.3 m/s^2, the paper's limit
_SLOWING_DOWN = (Knot(0.0, 1.5), Knot(3.0, 0.6), Knot(4.0, 0.3))
_INTO_BEND = (Knot(0.0, 1.0), Knot(1.5, 1.0), Knot(2.3, 0.8, 0.5), Knot(4.0, 0.8, 0.5))
_S_CURVE = (Knot(0.0, 0.8, 0.4), Knot(1.5, 0.8, 0.4), Knot(2.5, 0.8, -0.4), Knot(6.0, 0.8, -0.4))


def _crossing(
    ahead_m: float, to_left: bool = True, speed_mps: float = 1.2, stops_s: float | None = None
) -> Mover:
    return Mover("person", ahead_m, 0.0, 90.0 if to_left else -90.0, speed_mps, stops_s=stops_s)


_SEQUENCES = (
    Sequence("still-crossing", "tuning", _STILL, (_crossing(4.5),), "hall", "realsense", 11),
    Sequence("still-group", "reporting", _STILL,
             side_by_side(Mover("person", 5.0, 0.4, -90.0, 1.1), 3, stagger_m=0.45), "hall", "paper", 12),
    Sequence("still-two-cross", "reporting", _STILL,
             (_crossing(4.0, speed_mps=1.1), Mover("person", 6.0, 0.3, -90.0, 1.3, texture="coarse")),
             "workshop", "realsense", 13),
    Sequence("slow-oncoming", "tuning", straight(0.5), (Mover("person", 5.0, 0.3, 180.0, 1.0),),
             "aisle", "realsense", 21),
    Sequence("slow-crossing", "reporting", straight(0.5), (_crossing(3.5, False),), "aisle", "realsense", 22),
    Sequence("slow-robot", "reporting", straight(0.5), (Mover("robot", 4.5, 0.0, 90.0, 0.8),),
             "workshop", "paper", 23),
    Sequence("slow-cart", "reporting", straight(0.5), (Mover("cart", 4.0, 0.2, -70.0, 0.7),),
             "hall", "realsense", 24),
    Sequence("walk-crossing", "tuning", straight(1.0), (_crossing(4.5, False),), "hall", "realsense", 31),
    Sequence("walk-oncoming", "reporting", straight(1.0),
             (Mover("person", 6.0, -0.4, 180.0, 1.2), Mover("person", 6.8, 1.2, 175.0, 0.9)),
             "hall", "realsense", 32),
    Sequence("walk-receding", "reporting", straight(1.0), (Mover("person", 4.0, 0.3, 0.0, 1.4),),
             "aisle", "paper", 33),
    Sequence("walk-stopping", "tuning", straight(1.0), (_crossing(5.0, stops_s=2.4),), "workshop",
             "paper", 34),
    Sequence("walk-starting", "reporting", straight(1.0),
             (Mover("person", 5.0, -0.5, 90.0, 1.2, at_s=2.6, starts_s=1.0),), "hall", "realsense", 35),
    Sequence("walk-stopping-robot", "reporting", straight(1.0),
             (Mover("robot", 5.5, 0.2, -90.0, 0.9, stops_s=2.6),), "aisle", "realsense", 36),
    Sequence("walk-group", "reporting", straight(1.0),
             side_by_side(Mover("person", 5.5, -0.2, 165.0, 1.0), 2, 0.9), "hall", "realsense", 37),
    Sequence("walk-plain", "reporting", straight(1.0),
             (Mover("person", 4.5, 0.0, 90.0, 1.2, texture="plain"),), "workshop", "realsense", 38),
    Sequence("fast-crossing", "tuning", straight(1.5), (_crossing(5.0),), "hall", "paper", 41),
    Sequence("fast-oncoming-robot", "reporting", straight(1.5),
             (Mover("robot", 5.0, -0.9, 180.0, 1.0, at_s=1.5),),
             "hall", "realsense", 42),
    Sequence("fast-receding", "reporting", straight(1.5),
             (Mover("person", 4.5, -0.5, 10.0, 1.1), Mover("robot", 6.0, 0.9, 0.0, 0.8)), "hall",
             "realsense", 43),
    Sequence("fast-two", "reporting", straight(1.5),
             (_crossing(5.0, False, 1.3), Mover("person", 7.0, 0.0, 90.0, 1.0, texture="coarse")),
             "aisle", "paper", 44),
    Sequence("accelerating-crossing", "reporting", _SPEEDING_UP, (_crossing(4.5),), "workshop",
             "realsense", 51),
    Sequence("accelerating-robot", "tuning", _SPEEDING_UP, (Mover("robot", 4.5, 0.0, -90.0, 1.0),),
             "hall", "paper", 52),
    Sequence("braking-crossing", "reporting", _SLOWING_DOWN, (_crossing(4.5, False, 1.4),), "hall",
             "realsense", 53),
    Sequence("braking-oncoming", "reporting", _SLOWING_DOWN,
             (Mover("person", 5.8, 0.5, 180.0, 1.1, at_s=1.8),),
             "aisle", "realsense", 54),
    Sequence("arc-left-crossing", "tuning", arc(0.8, 0.3), (_crossing(4.0),), "hall", "realsense", 61),
    Sequence("arc-right-oncoming", "reporting", arc(1.0, -0.25), (Mover("person", 5.5, 0.0, 180.0, 1.0),),
             "hall", "realsense", 62),
    Sequence("arc-tight-crossing", "reporting", arc(0.8, 0.5), (_crossing(4.0, True, 1.0),),
             "workshop", "realsense", 63, SLIPPING),
    Sequence("arc-tight-robot", "reporting", arc(0.8, -0.5), (Mover("robot", 4.0, 0.0, -60.0, 0.9),),
             "hall", "paper", 64, SLIPPING),
    Sequence("bend-group", "reporting", _INTO_BEND,
             side_by_side(Mover("person", 4.5, 0.0, 120.0, 1.0, at_s=2.5), 2),
             "hall", "realsense", 65, SLIPPING),
    Sequence("s-curve-crossing", "tuning", _S_CURVE, (_crossing(4.0, True, 1.1),), "hall", "realsense", 66,
             SLIPPING),
    Sequence("vibration-crossing", "tuning", straight(1.0), (_crossing(4.5),), "hall", "realsense", 71,
             vibration_deg=0.3),
    Sequence("vibration-oncoming", "reporting", straight(1.2),
             (Mover("person", 7.2, 0.5, 180.0, 1.1, at_s=1.5),),
             "workshop", "realsense", 72, vibration_deg=0.4),
    Sequence("vibration-robot", "reporting", arc(0.8, 0.2), (Mover("robot", 4.5, 0.0, 100.0, 0.9),),
             "hall", "paper", 73, SLIPPING, vibration_deg=0.3),
    Sequence("static-straight", "reporting", straight(1.0), (), "hall", "realsense", 81,
             duration_s=_STATIC_S),
    Sequence("static-fast-aisle", "tuning", straight(1.5), (), "aisle", "realsense", 82,
             duration_s=_STATIC_S),
    Sequence("static-arc", "reporting", arc(0.8, 0.5), (), "hall", "realsense", 83, SLIPPING,
             duration_s=_STATIC_S),
    Sequence("static-s-curve", "reporting", _S_CURVE, (), "workshop", "paper", 84, SLIPPING,
             duration_s=_STATIC_S),
    Sequence("static-vibration", "reporting", straight(1.0), (), "workshop", "realsense", 85,
             vibration_deg=0.4, duration_s=_STATIC_S),
    Sequence("static-still", "reporting", _STILL, (), "aisle", "realsense", 86, duration_s=_STATIC_S),
)  # fmt: skip


def sequences() -> tuple[Sequence, ...]:
    """All of them, in a fixed order."""
    return _SEQUENCES
