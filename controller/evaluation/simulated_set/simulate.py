"""Simulates a sequence: the camera's frames and the odometry, with the truth of each frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from controller.evaluation.simulated_set.scripted_drive import MOUNT
from controller.evaluation.simulated_set.sequences import Sequence
from controller.evaluation.simulated_set.truth import FrameTruthBuilder, TrueImages
from controller.evaluation.types import FrameTruth
from hal.clocks import NS_PER_S, SimulatedClock
from hal.types import Pose, RgbdFrame
from sim.rendering.camera import SimulatedCamera
from sim.world import BodyState, World


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedFrame:
    """One frame, the odometry, and the truth.

    odometry: the camera's pose by dead reckoning.
    camera: its true pose in the floor frame.
    truth: about the bodies that move.
    images: true images of instances and depth.
    bodies: all bodies, moving or not.
    """

    frame: RgbdFrame
    odometry: Pose
    camera: Pose
    truth: FrameTruth
    images: TrueImages
    bodies: tuple[BodyState, ...]


def build_world(sequence: Sequence) -> World:
    """The sequence's world with its seed."""
    return World(sequence.scenario(), sequence.seed)


def simulate(sequence: Sequence, truth_builder: FrameTruthBuilder, world: World) -> Iterator[SimulatedFrame]:
    """The sequence's frames in order. Every run yields the same bytes."""
    drive = sequence.drive()
    config = sequence.camera()
    camera = SimulatedCamera(
        world, config, MOUNT, SimulatedClock(), lambda stamp_ns: drive.pose(stamp_ns / NS_PER_S)
    )
    with camera:
        for _ in range(round(sequence.duration_s * config.fps)):
            frame = camera.read(timeout_s=1.0)
            picture = camera.last_picture
            assert picture is not None, "a frame that was read has a picture behind it"
            yield SimulatedFrame(
                frame,
                drive.odometry_camera(frame.captured_ns),
                picture.camera,
                truth_builder.frame(picture),
                truth_builder.images(picture),
                world.bodies(picture.t_s),
            )
