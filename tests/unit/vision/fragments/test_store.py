"""The history of the fragments: what is looked up later is what was committed then."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from vision.camera.lens import rotation_from_vector
from vision.fragments.candidates import NewFragments
from vision.fragments.store import HISTORY, FragmentStore

CAMERA = Intrinsics(640, 480, 500.0, 400.0, 320.0, 240.0)
FRAME_NS = 33_000_000


def pose_of(frame: int) -> Pose:
    return Pose(rotation_from_vector(np.array([0.0, 0.01 * frame, 0.0])), np.array([0.1 * frame, 0.0, 0.5]))


def add(store: FragmentStore, count: int) -> None:
    """Fragments whose place and depth tell their id. Pixels and rays to them are in single precision."""
    ids = np.arange(store._next_id, store._next_id + count, dtype=np.float32)
    ends = np.zeros((count, 2, 2), np.float32)
    ends[:, 0, 0], ends[:, 1, 0], ends[:, :, 1] = ids, ids + 0.5, 100.0
    depth = np.stack((1.0 + ids, 1.0 + ids), axis=1).astype(np.float32)
    store.add(NewFragments(ends, depth, depth + 0.25, np.ones((count, 2, 3), np.float32)))


def commit(store: FragmentStore, frame: int) -> None:
    store.commit(frame * FRAME_NS, pose_of(frame), CAMERA, np.zeros(2))


def points_of(store: FragmentStore, back_s: float, frame: int) -> tuple[FloatArray, NDArray[np.intp]]:
    """(2N, 3) where the ends were in the fixed frame at their anchors, and the lags."""
    anchor = store.anchors(frame * FRAME_NS, back_s)
    return (anchor.direction * anchor.depth_m + anchor.origin).T, anchor.lag_frames


def expected(ids: NDArray[np.int64], frames: NDArray[np.intp]) -> FloatArray:
    """The same from the ids alone."""
    result = []
    for identity, frame in zip(ids.tolist(), frames.tolist(), strict=True):
        pose = pose_of(frame)
        for u in (float(identity), identity + 0.5):
            ray = np.array([(u - CAMERA.cx) / CAMERA.fx, (100.0 - CAMERA.cy) / CAMERA.fy, 1.0])
            result.append(pose.rotation @ (ray * (1.0 + identity)) + pose.translation_m)
    return np.array(result)


def test_anchors_are_what_was_committed_whatever_came_and_went_since() -> None:
    store, rng = FragmentStore(), np.random.default_rng(1)
    add(store, 30)
    commit(store, 0)
    for frame in range(1, 3 * HISTORY):
        store.keep(rng.random(len(store)) < 0.9)
        points, lag = points_of(store, 5 * FRAME_NS * 1e-9 + 1e-4, frame)
        np.testing.assert_array_equal(lag, np.minimum(store.age_frames, 5))
        np.testing.assert_allclose(points, expected(store.ids, frame - lag), atol=1e-5)
        add(store, int(rng.integers(0, 12)))
        commit(store, frame)


def test_the_history_grows_with_the_fragments() -> None:
    store = FragmentStore()
    for frame in range(4):
        add(store, 70)
        commit(store, frame)
    points, lag = points_of(store, 10.0, 4)
    assert len(store) == 280
    assert lag.tolist() == np.repeat([4, 3, 2, 1], 70).tolist()
    np.testing.assert_allclose(points, expected(store.ids, 4 - lag), atol=1e-5)


def test_before_is_the_frame_before() -> None:
    store = FragmentStore()
    add(store, 3)
    for frame in range(6):
        commit(store, frame)
    last = store.last_entries(6 * FRAME_NS)
    np.testing.assert_array_equal(last.lag_frames, [1, 1, 1])
    np.testing.assert_allclose(last.lag_s, FRAME_NS * 1e-9)
    np.testing.assert_allclose(last.origin[0], 0.5)
    np.testing.assert_allclose(last.depth_m, [1.0, 1.0, 2.0, 2.0, 3.0, 3.0])
    np.testing.assert_allclose(last.far_m - last.depth_m, 0.25)


def test_history_before_a_break_is_not_used() -> None:
    store = FragmentStore()
    add(store, 2)
    for frame in range(5):
        commit(store, frame)
    store.break_history()
    commit(store, 5)
    assert points_of(store, 10.0, 6)[1].tolist() == [1, 1]
    commit(store, 6)
    assert points_of(store, 10.0, 7)[1].tolist() == [2, 2]


@pytest.mark.parametrize("count", [0, 5])
def test_cleared_it_begins_anew_with_new_ids(count: int) -> None:
    store = FragmentStore()
    add(store, 4)
    commit(store, 0)
    store.clear()
    add(store, count)
    assert store.ids.tolist() == list(range(4, 4 + count))


def test_a_body_only_fragment_stays_body_only() -> None:
    store = FragmentStore()
    add(store, 3)
    ends, depth = np.zeros((2, 2, 2), np.float32), np.ones((2, 2), np.float32)
    store.add(NewFragments(ends, depth, depth, np.ones((2, 2, 3), np.float32)), body_only=True)
    store.keep(np.array([False, True, True, False, True]))
    assert store.body_only.tolist() == [False, False, True]
    store.clear()
    assert len(store.body_only) == 0


def test_a_new_end_has_not_been_expected_anywhere_and_others_keep_their_error() -> None:
    store = FragmentStore()
    add(store, 2)
    assert np.isinf(store.error_px).all()
    store.error_px = np.array([[0.1, 0.2], [0.3, 0.4]], np.float32)
    add(store, 1)
    store.keep(np.array([False, True, True]))
    np.testing.assert_allclose(store.error_px, np.array([[0.3, 0.4], [np.inf, np.inf]], np.float32))
    store.break_history()
    assert np.isinf(store.error_px).all()
    store.clear()
    assert store.error_px.shape == (0, 2)
