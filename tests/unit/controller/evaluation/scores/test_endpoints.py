"""Endpoint errors against a camera that is known to have moved."""

from __future__ import annotations

import numpy as np
import pytest

from controller.evaluation.scores.endpoint_error import EndpointErrors, endpoint_errors
from hal.types import FloatArray, Pose
from tests.support.evaluation_cases import CAMERA
from vision.scene import Fragments


def fragments(ids: list[int], ends_px: list[list[list[float]]]) -> Fragments:
    count = len(ids)
    unknown: FloatArray = np.full((count, 3), np.nan)
    return Fragments(
        np.array(ids, np.int64), np.array(ends_px, np.float32).reshape(count, 2, 2), np.full(count, np.nan),
        unknown, unknown, unknown, np.zeros(count, np.bool_), np.full(count, -1, np.int64),
    )  # fmt: skip


DEPTH = np.full((480, 640), 4.0, np.float32)
# The camera goes 0.04 m to the right: what is 4 m away goes 6 px to the left.
MOTION = Pose(np.eye(3), np.array([-0.04, 0.0, 0.0]))


def test_error_is_what_is_left_of_the_true_flow() -> None:
    before = fragments([1, 2], [[[100, 100], [200, 100]], [[300, 50], [300, 90]]])
    now = fragments([2, 3], [[[294, 50], [294.3, 90.4]], [[1, 1], [2, 2]]])
    errors = endpoint_errors(before, now, DEPTH, MOTION, CAMERA)
    assert errors.error_px == pytest.approx([0.0, 0.5], abs=1e-5)
    assert errors.flow_px == pytest.approx([6.0, 6.0])
    assert errors.distance_m == pytest.approx([4.0, 4.0])


def test_an_outline_belongs_to_the_nearer_side() -> None:
    depth = DEPTH.copy()
    depth[:, :100] = 2.0
    before = fragments([1], [[[100, 60], [100, 120]]])
    now = fragments([1], [[[88, 60], [88, 120]]])
    errors = endpoint_errors(before, now, depth, MOTION, CAMERA)
    assert errors.distance_m == pytest.approx([2.0, 2.0])
    assert errors.error_px == pytest.approx([0.0, 0.0], abs=1e-5)


def test_fragment_without_depth_has_no_endpoint_error() -> None:
    nothing = np.zeros((480, 640), np.float32)
    one = fragments([1], [[[100, 60], [100, 120]]])
    assert len(endpoint_errors(one, one, nothing, MOTION, CAMERA).error_px) == 0
    assert len((EndpointErrors.none() + EndpointErrors.none()).error_px) == 0
