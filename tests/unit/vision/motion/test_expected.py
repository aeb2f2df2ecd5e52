"""Where ends are expected in the next image, by hand."""

from __future__ import annotations

import numpy as np

from hal.types import FloatArray, Intrinsics, Pose
from vision.fragments.candidates import NewFragments
from vision.fragments.store import FragmentStore
from vision.motion.expected import expected_px, known_motion
from vision.scene import Fragments

CAMERA = Intrinsics(640, 480, 600.0, 500.0, 320.0, 240.0)
STILL = Pose(np.eye(3), np.zeros(3))
NAN = float("nan")


def one_fragment(near_m: tuple[float, float] = (4.0, 2.0)) -> FragmentStore:
    """From the middle of the image to the right."""
    store = FragmentStore()
    ends_px = np.array([[[320.0, 240.0], [380.0, 190.0]]], np.float32)
    depth = np.array([near_m], np.float32)
    store.add(NewFragments(ends_px, depth, depth, np.ones((1, 2, 3), np.float32)))
    return store


def expected(store: FragmentStore, velocity: list[float], motion: Pose = STILL) -> FloatArray:
    result: FloatArray = expected_px(store, np.array([velocity]), motion, 0.1, CAMERA).astype(float)
    return result


def test_static_fragment_is_expected_where_it_was_if_the_camera_stands() -> None:
    np.testing.assert_allclose(expected(one_fragment(), [0.0] * 3), [[320.0, 240.0], [380.0, 190.0]])


def test_a_step_of_the_camera_or_of_the_fragment() -> None:
    """The camera goes 0.2 m to the right: 0.2 m are 30 px at 4 m and 60 px at 2 m."""
    right = Pose(np.eye(3), np.array([0.2, 0.0, 0.0]))
    np.testing.assert_allclose(
        expected(one_fragment(), [0.0] * 3, right), [[290.0, 240.0], [320.0, 190.0]], atol=1e-4
    )
    # With it at 2 m/s, and up at 1 m/s: 12.5 px at 4 m, 25 px at 2 m.
    np.testing.assert_allclose(
        expected(one_fragment(), [2.0, -1.0, 0.0], right), [[320.0, 227.5], [380.0, 165.0]], atol=1e-4
    )


def test_a_turn_of_the_camera() -> None:
    """A quarter turn about its axis: what was to the right is above."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    # The second end lies at (0.1, -0.1) on the plane z = 1, then at (-0.1, -0.1).
    turned = expected(one_fragment(), [0.0] * 3, Pose(quarter, np.zeros(3)))
    np.testing.assert_allclose(turned, [[320.0, 240.0], [260.0, 190.0]], atol=1e-4)


def test_unknown_depth_is_five_metres_and_what_the_camera_passed_stays_finite() -> None:
    right = Pose(np.eye(3), np.array([0.5, 0.0, 0.0]))
    np.testing.assert_allclose(
        expected(one_fragment((NAN, 5.0)), [0.0] * 3, right), [[260.0, 240.0], [320.0, 190.0]], atol=1e-4
    )
    past = Pose(np.eye(3), np.array([0.0, 0.0, 3.0]))
    # 1 m behind the camera and 0.2 m to the right counts as 0.1 m before it.
    np.testing.assert_allclose(
        expected(one_fragment(), [0.0] * 3, past)[1, 0], 320.0 + 600.0 * 2.0, rtol=1e-5
    )


def test_no_fragments_give_no_expected_positions() -> None:
    assert expected_px(FragmentStore(), np.empty((0, 3)), STILL, 0.1, CAMERA).shape == (0, 2)


def told(ids: list[int], moving: list[bool], velocity: list[list[float]]) -> Fragments:
    count = len(ids)
    return Fragments(
        ids=np.array(ids, np.int64),
        ends_px=np.zeros((count, 2, 2), np.float32),
        depth_m=np.zeros(count),
        position_m=np.zeros((count, 3)),
        velocity_mps=np.array(velocity).reshape(-1, 3),
        velocity_sigma_mps=np.zeros((count, 3)),
        moving=np.array(moving, np.bool_),
        obstacle_id=np.zeros(count, np.int64),
    )


def test_known_motion_is_looked_up_by_fragment_id() -> None:
    """Of 4 nothing is known that moves, 2 and 9 are unknown, and of 7 one axis has not been measured."""
    before = told([1, 4, 7], [True, False, True], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, NAN, 9.0]])
    moving, velocity = known_motion(np.array([1, 2, 4, 7, 9], np.int64), before)
    assert moving.tolist() == [True, False, False, True, False]
    np.testing.assert_array_equal(velocity[[0, 3]], [[1.0, 2.0, 3.0], [7.0, 0.0, 9.0]])
    assert not velocity[[1, 2, 4]].any()


def test_motion_is_unknown_before_the_first_frame_and_without_an_obstacle() -> None:
    ids = np.array([3, 5], np.int64)
    for before in (None, told([], [], [])):
        moving, velocity = known_motion(ids, before)
        assert not moving.any()
        assert not velocity.any()
    moving, velocity = known_motion(ids[:0], told([3], [True], [[1.0, 1.0, 1.0]]))
    assert moving.shape == (0,)
    assert velocity.shape == (0, 3)
