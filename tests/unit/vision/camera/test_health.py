"""What a bad camera does to the scene: the condition, the sentence, and never a NaN in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import RgbdFrame
from tests.support.painted import FRAME_NS, MOUNT, QVGA, box, drive, floor, record, vector, wall
from vision.camera.health import _samples, worsened
from vision.perception import Perception
from vision.scene import CameraCondition, CameraHealth, Scene

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
GOOD, DEGRADED, UNTRUSTWORTHY = (
    CameraCondition.GOOD,
    CameraCondition.DEGRADED,
    CameraCondition.UNTRUSTWORTHY,
)
CRATE = box(vector(3.5, 0.0, 0.0), vector(0.4, 0.6, 1.2), 10)
FRAMES = tuple(record(floor() + wall() + CRATE, drive(), 8, QVGA).frames)


def scenes(frames: list[RgbdFrame]) -> list[Scene]:
    eyes = Perception(SMALL, MOUNT, 0.8, 0.05)
    result = [eyes.perceive(frame, None, None).scene for frame in frames]
    for scene in result:
        assert_no_nan(scene)
    return result


def assert_no_nan(scene: Scene) -> None:
    for one in scene.obstacles:
        for values in (one.bbox_px, one.position_m, one.extent_m, one.velocity_mps, one.velocity_cov):
            assert np.isfinite(values).all()
        assert np.isfinite([one.score, one.age_s, one.unseen_s]).all()
    space = scene.free_space
    assert np.isfinite(space.bearing_tan).all()
    assert np.isfinite(space.known_m).all()
    assert not np.isnan(space.nearest_m).any()
    assert np.isfinite(scene.ego_motion.motion.rotation).all()
    assert np.isfinite(scene.ego_motion.motion.translation_m).all()
    assert np.isfinite(scene.health.valid_depth_ratio)


def shown(frame: RgbdFrame, level: int) -> RgbdFrame:
    return replace(frame, colour=np.full_like(frame.colour, level))


def without_depth(frame: RgbdFrame, share: float) -> RgbdFrame:
    depth = frame.depth.copy()
    depth[:, : round(share * depth.shape[1])] = 0
    return replace(frame, depth=depth)


def at(frame: RgbdFrame, captured_ns: int) -> RgbdFrame:
    return replace(frame, captured_ns=captured_ns)


def later(gap_ns: int) -> list[RgbdFrame]:
    """The second half of the frames, the first of them gap_ns after the first half."""
    first_ns = FRAMES[3].captured_ns + gap_ns
    return [at(frame, first_ns + k * FRAME_NS) for k, frame in enumerate(FRAMES[4:])]


def test_good_frames_are_good_without_a_word() -> None:
    for scene in scenes(list(FRAMES)):
        assert scene.health.condition is GOOD
        assert scene.health.reason == ""
        # Floor and wall fill all but the strip above the wall: 2.5 m over the camera at 7 m, of 119.5 px.
        assert scene.health.valid_depth_ratio == pytest.approx(1.0 - (119.5 - 305 * 2.5 / 7) / 240, abs=0.02)


@pytest.mark.parametrize(("level", "sentence"), [(0, "black"), (5, "black"), (255, "saturated")])
def test_black_and_saturated_images(level: int, sentence: str) -> None:
    for k in (0, 4):  # also as the very first frame
        frames = [shown(frame, level) if j == k else frame for j, frame in enumerate(FRAMES[:5])]
        health = scenes(frames)[k].health
        assert health.condition is UNTRUSTWORTHY
        assert sentence in health.reason


def test_samples_are_black_white_or_neither_and_the_same_as_before_or_not() -> None:
    """One in 16 px each way, beginning at the eighth: six by three."""
    grey = np.full((56, 97), 13, np.uint8)
    grey[8, 8], grey[24, 8], grey[40, 88] = 12, 242, 243
    assert _samples(grey, grey.copy()) == (1 / 18, 1 / 18, True)
    for place in ((8, 8), (40, 88)):
        other = grey.copy()
        other[place] += 1
        assert not _samples(grey, other)[2]
    assert not _samples(grey, np.empty((0, 0), np.uint8))[2]
    assert not _samples(grey, np.full((97, 56), 13, np.uint8))[2]


def test_a_frozen_image_is_not_trusted_from_its_second_repetition_on() -> None:
    still = [replace(FRAMES[0], captured_ns=f.captured_ns, sequence=f.sequence) for f in FRAMES]
    found = scenes(still)
    assert [s.health.condition for s in found[2:]] == [UNTRUSTWORTHY] * 6
    assert "has not changed" in found[2].health.reason
    assert found[0].health.condition is GOOD
    thawed = scenes([*still[:4], *FRAMES[4:]])
    assert thawed[3].health.condition is UNTRUSTWORTHY
    assert thawed[-1].health.condition is GOOD


def test_no_depth_at_all() -> None:
    frames = [*FRAMES[:4], without_depth(FRAMES[4], 1.0), *FRAMES[5:]]
    found = scenes(frames)
    assert found[4].health.condition is UNTRUSTWORTHY
    assert "depth" in found[4].health.reason
    assert found[4].health.valid_depth_ratio == 0.0
    np.testing.assert_array_equal(found[4].free_space.known_m, 0.0)
    assert found[-1].health.condition is GOOD


def test_little_depth_degrades() -> None:
    frames = [*FRAMES[:4], without_depth(FRAMES[4], 0.85)]
    health = scenes(frames)[4].health
    assert health.condition is DEGRADED
    assert "14%" in health.reason
    assert health.valid_depth_ratio == pytest.approx(0.15, abs=0.02)


def test_depth_beyond_the_depth_mask_alone_is_not_to_be_trusted() -> None:
    far = replace(FRAMES[0], depth=np.full_like(FRAMES[0].depth, 12_000))
    health = scenes([far])[0].health
    assert health.condition is UNTRUSTWORTHY
    assert "only 0.0% of the depth image holds data nearer than 10 m" in health.reason
    assert health.valid_depth_ratio == 1.0


def test_depth_beyond_the_depth_mask_is_data() -> None:
    """As in a hall whose far wall fills most of the view."""
    depth = FRAMES[4].depth.copy()
    depth[:, : round(0.85 * depth.shape[1])] = 12_000
    health = scenes([*FRAMES[:4], replace(FRAMES[4], depth=depth)])[4].health
    assert health.condition is GOOD
    assert health.valid_depth_ratio > 0.95


def test_a_repeated_stamp() -> None:
    found = scenes([*FRAMES[:3], at(FRAMES[3], FRAMES[2].captured_ns), *FRAMES[4:]])
    assert found[3].health.condition is UNTRUSTWORTHY
    assert "repetition" in found[3].health.reason
    assert found[4].health.condition is GOOD


def test_a_stamp_that_goes_back() -> None:
    found = scenes([*FRAMES[:3], at(FRAMES[3], FRAMES[2].captured_ns - 50_000_000), *FRAMES[4:]])
    assert found[3].health.condition is UNTRUSTWORTHY
    assert "0.050 s older" in found[3].health.reason
    # Time did not go back with it: the next frame follows the last good one.
    assert found[4].health.condition is GOOD
    assert found[4].ego_motion.dt_s == pytest.approx(2 * FRAME_NS * 1e-9)


def test_frames_too_far_apart_cannot_be_compared() -> None:
    found = scenes([*FRAMES[:4], *later(700_000_000)])
    health, ego = found[4].health, found[4].ego_motion
    assert health.condition is DEGRADED
    assert "0.70 s without a frame" in health.reason
    assert ego.source == "none"
    assert np.isinf(ego.sigma_translation_m)
    assert found[5].ego_motion.source == "visual"
    assert found[5].health.condition is GOOD


def test_frames_half_a_second_apart_are_no_gap() -> None:
    later = [
        at(frame, FRAMES[3].captured_ns + 450_000_000 + k * FRAME_NS) for k, frame in enumerate(FRAMES[4:])
    ]
    found = scenes([*FRAMES[:4], *later])
    assert found[4].health.condition is GOOD
    assert found[4].ego_motion.dt_s == pytest.approx(0.45)


def test_several_findings_are_all_told_and_the_worst_decides() -> None:
    late = at(shown(FRAMES[4], 0), FRAMES[3].captured_ns + 700_000_000)
    health = scenes([*FRAMES[:4], late])[4].health
    assert health.condition is UNTRUSTWORTHY
    assert "without a frame" in health.reason
    assert "black" in health.reason


def test_losing_every_fragment_leaves_the_motion_unknown() -> None:
    """As before a plain grey wall: no fragment, no odometry."""
    found = scenes([*FRAMES[:4], *(shown(frame, 128) for frame in FRAMES[4:])])
    for scene in found[4:]:
        assert scene.ego_motion.source == "none"
        assert np.isnan(scene.ego_motion.inlier_ratio)
        assert not any(one.moving for one in scene.obstacles)
        assert scene.health.condition is UNTRUSTWORTHY


def test_worsened_keeps_the_worse_condition_and_both_sentences() -> None:
    poor = CameraHealth(DEGRADED, "little depth", 0.2)
    both = worsened(poor, UNTRUSTWORTHY, "no motion")
    assert (both.condition, both.valid_depth_ratio) == (UNTRUSTWORTHY, 0.2)
    assert both.reason == "little depth; no motion"
    assert worsened(both, DEGRADED, "late").condition is UNTRUSTWORTHY
    assert worsened(CameraHealth(GOOD, "", 0.9), DEGRADED, "late").reason == "late"
