"""Rows that are read one after another: what bends is straightened, and how long they take is learned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hal.types import FloatArray, Intrinsics, Pose
from tests.support.point_motion import project
from vision.camera.lens import rays, rotation_from_vector, vector_from_rotation
from vision.ego_motion.camera_motion import CameraEstimate, estimate
from vision.ego_motion.motion_prior import MotionPrior, SweepPrior
from vision.ego_motion.reprojection import Anchors
from vision.ego_motion.rolling_shutter import ReadOut, straight_rays

CAMERA = Intrinsics(640, 480, 610.0, 600.0, 319.5, 239.5)
HERE = Pose(np.eye(3), np.zeros(3))
DT_S = 1.0 / 30.0
NOTHING_KNOWN = MotionPrior(HERE, np.full(6, 0.05), "none")


def bent(points_m: FloatArray, camera_pose: Pose, sweep_rad: FloatArray) -> FloatArray:
    """(N, 2) pixels of points (N, 3) seen by a camera that turns by sweep_rad, exactly, while it reads."""
    local = camera_pose.inverse().apply(points_m)
    pixels = project(local, CAMERA)
    for _ in range(4):  # which row a point falls on depends on when that row is read
        delays = pixels[:, 1] / CAMERA.height - 0.5
        turned = [
            rotation_from_vector(np.array([*(sweep_rad * delay), 0.0])).T @ point
            for point, delay in zip(local, delays, strict=True)
        ]
        pixels = project(np.array(turned), CAMERA)
    return pixels


def points(count: int = 160) -> FloatArray:
    """All over the view between 2 and 8 m."""
    rng = np.random.default_rng(3)
    pixels = rng.uniform((20.0, 20.0), (620.0, 460.0), (count, 2))
    return rays(pixels, CAMERA) * rng.uniform(2.0, 8.0, count)[:, None]


def test_the_last_row_by_hand() -> None:
    # Read half a sweep late: 0.002 rad about x, along the middle column y' = y - 0.002 (1 + y^2).
    y = (480.0 - 239.5) / 600.0
    found = straight_rays(np.array([[319.5, 480.0]], np.float32), CAMERA, np.array([0.004, 0.0]))
    np.testing.assert_allclose(found, [[0.0, y - 0.002 * (1.0 + y * y), 1.0]], rtol=1e-6)
    # About y the image goes the other way: x' = 0.002 (1 + 0).
    found = straight_rays(np.array([[319.5, 480.0]], np.float32), CAMERA, np.array([0.0, 0.004]))
    np.testing.assert_allclose(found, [[0.002, y, 1.0]], rtol=1e-6)


def test_without_a_sweep_nothing_changes() -> None:
    pixels = project(points(), CAMERA).astype(np.float32)
    np.testing.assert_array_equal(straight_rays(pixels, CAMERA, np.zeros(2)), rays(pixels, CAMERA))


@given(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01))
def test_bending_by_a_turn_is_corrected_to_a_hundredth_of_a_pixel(about_x: float, about_y: float) -> None:
    sweep_rad = np.array([about_x, about_y])
    off = straight_rays(bent(points(40), HERE, sweep_rad).astype(np.float32), CAMERA, sweep_rad) - rays(
        project(points(40), CAMERA), CAMERA
    )
    assert np.abs(off).max() * CAMERA.fx < 0.05


def found_from(
    sweep_rad: FloatArray, sigma_rad: float, max_rad: float | None = None
) -> tuple[CameraEstimate, Pose]:
    """What is estimated of a camera that pitches, yaws and goes on, with 0.1 px of noise; and the truth."""
    truth = Pose(rotation_from_vector(np.array([0.004, 0.01, -0.001])), np.array([0.001, -0.002, 0.03]))
    world = points()
    noise = 0.1 * np.random.default_rng(1).standard_normal((len(world), 2))
    static = Anchors(
        world,
        world / world[:, 2:],
        np.full(len(world), 0.02),
        np.tile([0.02, 0.0, 0.02], (len(world), 1)),
        np.ones(len(world), np.bool_),
        np.zeros(len(world), np.bool_),
    )
    pixels = bent(world, truth, sweep_rad) + noise
    sweep = SweepPrior(np.full(2, sigma_rad), np.full(2, max_rad or sigma_rad))
    return estimate(static, pixels, HERE, NOTHING_KNOWN, sweep, CAMERA), truth


def test_the_sweep_is_found_with_the_motion() -> None:
    sweep_rad = np.array([0.005, -0.003])
    found, _ = found_from(sweep_rad, 0.005)
    sigma = np.sqrt(np.diag(found.covariance)[6:])
    assert (sigma < 0.0005).all()
    np.testing.assert_array_less(np.abs(found.sweep_rad - sweep_rad), 4.0 * sigma)


def test_the_measured_sweep_does_not_depend_on_its_prior() -> None:
    """Or nobody would ever learn that the rows take longer than was thought."""
    sweep_rad = np.array([0.002, -0.001])
    free, bound = found_from(sweep_rad, 0.005)[0], found_from(sweep_rad, 1e-5)[0]
    sigma = np.sqrt(free.bend_variance)
    assert (sigma < 0.0005).all()
    np.testing.assert_array_less(np.abs(bound.sweep_rad), 1e-5)
    for found in (free, bound):
        np.testing.assert_array_less(np.abs(found.bend_rad - sweep_rad), 4.0 * sigma)
    # What is bent fits worse, and has less weight.
    assert (bound.bend_variance < 4.0 * free.bend_variance).all()


def test_a_bend_that_is_not_admitted_becomes_motion() -> None:
    """Why it is estimated at all: 1.5 px at the rims of the image pass for centimetres a frame."""
    sweep_rad = np.array([0.005, 0.0])

    def off_m(found: CameraEstimate, truth: Pose) -> float:
        return float(np.linalg.norm(found.pose.translation_m - truth.translation_m))

    rigid, bending = off_m(*found_from(sweep_rad, 1e-5)), off_m(*found_from(sweep_rad, 0.005))
    assert bending < 0.002
    assert rigid > 3.0 * bending


def test_a_clear_sweep_is_corrected_before_the_read_out_time_is_known() -> None:
    sweep_rad = np.array([0.005, -0.003])
    bound, open_minded = found_from(sweep_rad, 1e-9)[0], found_from(sweep_rad, 1e-9, 0.004)[0]
    assert np.abs(bound.sweep_rad).max() < 1e-8
    np.testing.assert_allclose(open_minded.sweep_rad, sweep_rad, atol=0.0005)
    assert open_minded.inlier_ratio > bound.inlier_ratio + 0.05


def test_a_wide_prior_of_the_sweep_bends_no_straight_image() -> None:
    assert np.abs(found_from(np.zeros(2), 1e-9, 0.004)[0].sweep_rad).max() < 1e-8


def test_a_straight_image_is_left_straight() -> None:
    found, truth = found_from(np.zeros(2), 0.005)
    assert np.abs(found.sweep_rad).max() < 0.0007
    turn = vector_from_rotation(truth.rotation.T @ found.pose.rotation)
    assert np.linalg.norm(turn) < 0.0005


NOISE_RAD = 0.0005


def shaken(
    read_out_s: float,
    frames: int = 60,
    amplitude_rad: float = 0.004,
    hz: float = 4.0,
    visual: bool = True,
    gaps: bool = False,
) -> ReadOut:
    """After frames of vibration in pitch, each bend seen with NOISE_RAD."""
    rng = np.random.default_rng(5)
    learned = ReadOut(0.25)
    for frame in range(1, frames):
        phase, before = (2.0 * math.pi * hz * DT_S * k for k in (frame, frame - 1))
        turn = amplitude_rad * (math.sin(phase) - math.sin(before))
        rate = amplitude_rad * 2.0 * math.pi * hz * math.cos(phase)
        bend_rad = np.array([read_out_s * rate + NOISE_RAD * rng.standard_normal(), 0.0])
        found = CameraEstimate(
            HERE, np.zeros(2), bend_rad, np.full(2, NOISE_RAD**2), 1e-8 * np.eye(8), 0.9, visual
        )
        learned.learn(found, np.array([turn, 0.0, 0.0]), DT_S)
        if gaps:
            learned.forget_last()
    return learned


@pytest.mark.parametrize("read_out_s", [0.008, 0.015, 0.025])
def test_the_read_out_is_learned_from_vibration(read_out_s: float) -> None:
    # One sigma below what is found: after 2 s that is 1 to 2 ms.
    assert read_out_s - 0.003 < shaken(read_out_s).seconds < 1.1 * read_out_s


def test_a_global_shutter_is_found_out() -> None:
    assert shaken(0.0).seconds < 0.001
    # One sigma of a sweep then is far below a pixel: 0.001 s of 0.1 rad/s and hardly more.
    assert shaken(0.0).sweep().sigma_rad[0] * CAMERA.fy < 0.1
    assert shaken(0.0).sweep().max_rad[0] < 0.1 * ReadOut(0.25).sweep().max_rad[0]


def test_before_anything_is_seen_nothing_is_bent() -> None:
    fresh = ReadOut(0.25)
    assert fresh.seconds == 0.0
    assert fresh.sweep().sigma_rad.max() < 1e-4
    # Possible it is: 15 ms of 0.25 rad/s.
    np.testing.assert_allclose(fresh.sweep().max_rad, 0.00375, rtol=1e-3)
    assert shaken(0.02, amplitude_rad=0.0).seconds == 0.0
    assert shaken(0.02, visual=False).seconds == 0.0


def test_the_faster_it_shakes_the_more_may_bend() -> None:
    hard, soft = shaken(0.02, amplitude_rad=0.008), shaken(0.02, amplitude_rad=0.004)
    assert hard.sweep().sigma_rad[0] == pytest.approx(2.0 * soft.sweep().sigma_rad[0], rel=0.15)
    # About the other axis it did not turn, and what was assumed at first is forgotten.
    assert hard.sweep().sigma_rad[1] < 0.01 * hard.sweep().sigma_rad[0]


def test_nothing_is_learned_across_a_gap() -> None:
    """A turn over a gap is no rate at the image before it."""
    assert shaken(0.02, gaps=True).seconds == 0.0
