"""Moments for the video's tests: a hall with a person crossing and a crate, made of known numbers."""

from __future__ import annotations

import numpy as np

from config.robot import Body
from controller.decision.decision import Action, Decision, Reason
from controller.record.recorder import VideoSettings
from controller.video.moment import VideoMoment
from hal.geometry import camera_in_body
from hal.types import CameraMount, FloatArray, Intrinsics, Pose, RgbdFrame
from vision.scene import (
    CameraCondition,
    CameraHealth,
    EgoMotion,
    Fragments,
    FreeSpace,
    Obstacle,
    Scene,
)

INTRINSICS = Intrinsics(640, 480, 610.0, 610.0, 319.5, 239.5)
MOUNT = CameraMount(forward_m=0.45, left_m=0.0, height_m=0.60, pitch_rad=0.07)
BODY = Body()
AROUND = VideoSettings(MOUNT, BODY, 0.54, 30.0, 1.5, 10.0)
STILL = Pose(np.eye(3), np.zeros(3))


def frame(sequence: int = 0, captured_ns: int = 0, intrinsics: Intrinsics = INTRINSICS) -> RgbdFrame:
    """A grey floor and a lighter wall; depth of the floor plane, a hole at the left."""
    height, width = intrinsics.height, intrinsics.width
    colour = np.full((height, width, 3), 150, np.uint8)
    colour[height // 2 :] = 90
    rows = np.arange(height, dtype=np.float64)[:, np.newaxis]
    drop = np.maximum((rows - intrinsics.cy) / intrinsics.fy + 0.07, 1e-3)
    depth_m = np.broadcast_to(np.minimum(0.6 / drop, 9.0), (height, width)).copy()
    depth_m[:, : width // 10] = 0.0
    return RgbdFrame(
        colour=colour,
        depth=np.rint(depth_m * 1000.0).astype(np.uint16),
        depth_scale_m=0.001,
        captured_ns=captured_ns,
        device_s=captured_ns * 1e-9,
        sequence=sequence,
        intrinsics=intrinsics,
    )


def obstacle(
    number: int,
    forward_m: float,
    left_m: float,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
    moving: bool = False,
    size_m: tuple[float, float] = (0.5, 1.7),
    unseen_s: float = 0.0,
    sigma_mps: float = 0.15,
) -> Obstacle:
    """A box that stands on the floor, given in the body frame; its image box is its true projection."""
    width_m, height_m = size_m
    to_camera = camera_in_body(MOUNT).inverse()
    centre = to_camera.apply(np.array([[forward_m, left_m, 0.5 * height_m]]))[0]
    corners = to_camera.apply(
        np.array(
            [[forward_m, left_m + y, z] for y in (-0.5 * width_m, 0.5 * width_m) for z in (0.0, height_m)]
        )
    )
    u = INTRINSICS.fx * corners[:, 0] / corners[:, 2] + INTRINSICS.cx
    v = INTRINSICS.fy * corners[:, 1] / corners[:, 2] + INTRINSICS.cy
    return Obstacle(
        id=number,
        bbox_px=(
            float(np.clip(u.min(), 0, 639)),
            float(np.clip(v.min(), 0, 479)),
            float(np.clip(u.max(), 0, 639)),
            float(np.clip(v.max(), 0, 479)),
        ),
        position_m=centre,
        extent_m=np.array([width_m, height_m, 0.3]),
        velocity_mps=to_camera.rotation @ np.array([*velocity_mps, 0.0]),
        velocity_cov=np.diag([sigma_mps, sigma_mps, 2.0 * sigma_mps]) ** 2,
        moving=moving,
        score=0.9,
        fragments=8,
        age_s=1.0,
        unseen_s=unseen_s,
    )


def fragments(ends_px: FloatArray, moving: list[bool], measured: list[bool]) -> Fragments:
    """Line segments at known places; those not measured have no velocity."""
    count = len(moving)
    velocity = np.where(np.array(measured, bool).reshape(count, 1), 0.1, np.nan) * np.ones((count, 3))
    return Fragments(
        ids=np.arange(count, dtype=np.int64),
        ends_px=np.asarray(ends_px, np.float32).reshape(count, 2, 2),
        depth_m=np.full(count, 3.0),
        position_m=np.ones((count, 3)),
        velocity_mps=velocity,
        velocity_sigma_mps=np.full((count, 3), 0.1),
        moving=np.array(moving, bool),
        obstacle_id=np.full(count, -1, np.int64),
    )


NO_FRAGMENTS = fragments(np.zeros((0, 2, 2)), [], [])


def free_space(nearest_m: float = np.inf, known_m: float = 8.0, bands: int = 32) -> FreeSpace:
    """Alike in all directions."""
    half = 0.52 / bands
    return FreeSpace(
        bearing_tan=np.linspace(-0.52 + half, 0.52 - half, bands),
        half_width_tan=half,
        nearest_m=np.full(bands, nearest_m),
        known_m=np.full(bands, known_m),
    )


def scene(
    obstacles: tuple[Obstacle, ...] = (),
    free: FreeSpace | None = None,
    condition: CameraCondition = CameraCondition.GOOD,
    reason: str = "",
) -> Scene:
    """What perception would say."""
    return Scene(
        captured_ns=0,
        sequence=0,
        obstacles=obstacles,
        free_space=free_space() if free is None else free,
        ego_motion=EgoMotion(STILL, 1 / 30, "none", np.nan, np.nan, np.nan),
        health=CameraHealth(condition, reason, 0.9),
        robot_pose=None,
    )


def decision(
    action: Action = Action.KEEP, target_mps: float = 1.0, obstacle_id: int | None = None
) -> Decision:
    """A decision with a sentence of usual length."""
    sentence = "the way is free for 8.0 m"
    if obstacle_id is not None:
        sentence = f"obstacle {obstacle_id} comes to 2.4 m ahead on the path: gap for 0.62 m/s"
    return Decision(action, target_mps, Reason("free", sentence, obstacle_id))


def straight_path(length_m: float = 12.0) -> FloatArray:
    """Two points straight ahead."""
    return np.array([[0.0, 0.0], [length_m, 0.0]])


def moment(
    obstacles: tuple[Obstacle, ...] = (),
    seen_fragments: Fragments = NO_FRAGMENTS,
    decided: Decision | None = None,
    captured_ns: int = 0,
    speeds_mps: tuple[float | None, float | None] = (0.95, 0.93),
    path_m: FloatArray | None = None,
    **scene_parts: object,
) -> VideoMoment:
    """A whole moment with the robot and the camera above."""
    commanded_mps, measured_mps = speeds_mps
    return VideoMoment(
        frame=frame(captured_ns=captured_ns),
        scene=scene(obstacles, **scene_parts),  # type: ignore[arg-type]  # parts by name
        fragments=seen_fragments,
        decision=decided,
        commanded_mps=commanded_mps,
        measured_mps=measured_mps,
        mount=MOUNT,
        body=BODY,
        path_ahead_m=path_m,
        corridor_half_width_m=0.5,
    )
