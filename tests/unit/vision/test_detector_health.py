"""What the ego-motion says of the camera: when the fragments agree with no motion of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import Pose
from tests.support.painted import MOUNT, QVGA, Take, box, drive, floor, record, vector, wall
from vision import detector
from vision.detection import Detection
from vision.detector import Detector
from vision.ego_motion.camera_motion import CameraEstimate, estimate
from vision.ego_motion.motion_prior import MotionPrior
from vision.scene import CameraCondition

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))


@cache
def room() -> Take:
    return record(floor() + wall() + box(vector(3.5, 0.5, 0.0), vector(0.4, 0.6, 1.2), 10), drive(), 3, QVGA)


def agreeing(monkeypatch: pytest.MonkeyPatch, ratio: float, visual: bool = True) -> None:
    """As if this share of the fragments agreed with the motion found; visual: whether it was found."""

    def told(anchors: Any, pixels: Any, before: Pose, prior: MotionPrior, *rest: Any) -> CameraEstimate:
        found = estimate(anchors, pixels, before, prior, *rest)
        return replace(found, inlier_ratio=ratio, visual=visual)

    monkeypatch.setattr(detector, "estimate", told)


def last(odometry: bool) -> Detection:
    eyes, take = Detector(SMALL, MOUNT), room()
    pairs = zip(take.frames, take.cameras, strict=True)
    return [eyes.step(frame, camera if odometry else None) for frame, camera in pairs][-1]


def test_without_odometry_a_view_that_hardly_agrees_is_degraded_and_says_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    agreeing(monkeypatch, 0.39)
    seen = last(odometry=False)
    assert seen.health.condition is CameraCondition.DEGRADED
    assert seen.health.reason == (
        "only 39% of the fragments fit one motion of the camera: is depth aligned with colour, in place and"
        " in time?"
    )
    assert seen.ego_motion.source == "visual"
    assert not seen.motion_known  # nothing is called moving on such grounds


def test_a_little_less_than_half_that_agree_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    agreeing(monkeypatch, 0.46)
    seen = last(odometry=False)
    assert seen.health.condition is CameraCondition.GOOD
    assert seen.motion_known
    assert not seen.reckoned


def test_few_fragments_that_agree_with_the_odometry_are_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    agreeing(monkeypatch, 0.2)
    seen = last(odometry=True)
    assert seen.health.condition is CameraCondition.GOOD
    assert seen.motion_known
    assert seen.reckoned


def test_on_odometry_alone_the_camera_is_degraded(monkeypatch: pytest.MonkeyPatch) -> None:
    agreeing(monkeypatch, 0.1, visual=False)
    seen = last(odometry=True)
    assert seen.health.condition is CameraCondition.DEGRADED
    assert "rests on the odometry alone" in seen.health.reason
    assert seen.ego_motion.source == "odometry"
    assert seen.motion_known


def test_without_either_the_camera_is_not_to_be_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    agreeing(monkeypatch, 0.1, visual=False)
    seen = last(odometry=False)
    assert seen.health.condition is CameraCondition.UNTRUSTWORTHY
    assert "is not known" in seen.health.reason
    assert seen.ego_motion.source == "none"
    assert not seen.motion_known
