"""Ends on two surfaces, one behind the other, seen by a camera that moves sideways: of which they tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.perception import DepthNoise
from hal.types import FloatArray, Intrinsics, Pose
from vision.depth.depth_mask import UNSEEN_M
from vision.ego_motion.camera_motion import CameraEstimate
from vision.fragments.candidates import NewFragments
from vision.fragments.store import FragmentStore
from vision.motion.anchor_depths import depths_with_sigma
from vision.motion.residuals import residuals
from vision.motion.velocities import EndResiduals

CAMERA = Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0)
NOISE = DepthNoise(floor_m=0.005, quadratic_per_m=0.0075)
FRAME_NS = 33_333_333
STEP_M = 0.05
NEAR_M, FAR_M = 3.0, 8.0
FRAMES = 9
STILL = CameraEstimate(
    Pose(np.eye(3), np.zeros(3)), np.zeros(2), np.zeros(2), np.ones(2), 1e-12 * np.eye(8), 0.9, True
)
LEVEL = np.array([[300.0, 200.0], [340.0, 200.0]])
UPRIGHT = np.array([[320.0, 200.0], [320.0, 240.0]])


def seen(
    first_px: FloatArray, step_px: tuple[float, float], far_m: float, right: float, down: float
) -> EndResiduals:
    """Of a fragment whose ends (2, 2) go by step_px a frame, while the camera goes STEP_M times right, down;
    measured at NEAR_M, with far_m behind."""
    store = FragmentStore()
    motion = None
    for k in range(FRAMES):
        stamp_ns = (k + 1) * FRAME_NS
        pose = Pose(np.eye(3), np.array([right, down, 0.0]) * STEP_M * k)
        pixels = (first_px + np.array(step_px) * k).astype(np.float32)[None]
        near, far = np.full((1, 2), NEAR_M, np.float32), np.full((1, 2), far_m, np.float32)
        if k == 0:
            store.add(
                NewFragments(pixels, near, far, np.tile(np.array([0.02, 0.0, 0.02], np.float32), (1, 2, 1)))
            )
        else:
            store.ends_px, store.near_m, store.far_m = pixels, near, far
            anchor = store.anchors(stamp_ns, 0.25)
            now = replace(STILL, pose=pose)
            motion = residuals(store, anchor, depths_with_sigma(anchor, NOISE), now, CAMERA, NOISE, 1.0)
        store.commit(stamp_ns, pose, CAMERA, np.zeros(2))
    assert motion is not None
    return motion


def past_px(depth_m: float) -> float:
    """How far to the left in the image something that stands goes while the camera goes a step right."""
    return -STEP_M * CAMERA.fx / depth_m


@pytest.mark.parametrize("behind_m", [FAR_M, UNSEEN_M])
def test_end_that_moves_as_the_far_surface_is_not_usable(behind_m: float) -> None:
    """The texture of a wall beside an outline has the outline's depth."""
    step_px = (past_px(behind_m), 0.0)
    assert not seen(UPRIGHT, step_px, behind_m, 1.0, 0.0).usable.any()
    alone = seen(UPRIGHT, step_px, NEAR_M, 1.0, 0.0)
    assert alone.usable.all()
    assert (alone.static_chi2 > 20.0).all()


@pytest.mark.parametrize("behind_m", [FAR_M, UNSEEN_M])
def test_end_that_moves_as_neither_surface_contradicts_standing(behind_m: float) -> None:
    motion = seen(LEVEL, (past_px(NEAR_M), 3.0), behind_m, 1.0, 0.0)
    assert motion.usable.all()
    assert (motion.static_chi2 > 8.0).all()


def test_static_end_before_a_far_surface_is_static() -> None:
    motion = seen(UPRIGHT, (past_px(NEAR_M), 0.0), FAR_M, 1.0, 0.0)
    assert motion.usable.all()
    assert (motion.static_chi2 < 1.0).all()


def test_where_an_outline_crosses_a_line_behind_it_an_end_slides_along_the_outline() -> None:
    """The camera goes right and down: the level outline goes up as what is near, the crossing to the left as
    what is far. With nothing behind it, that would be a motion of its own."""
    crossing_px = (past_px(FAR_M), past_px(NEAR_M))
    assert (seen(LEVEL, crossing_px, FAR_M, 1.0, 1.0).static_chi2 < 6.0).all()
    assert (seen(LEVEL, crossing_px, NEAR_M, 1.0, 1.0).static_chi2 > 20.0).all()
