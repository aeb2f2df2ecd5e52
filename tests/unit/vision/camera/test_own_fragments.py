"""Fragments on the robot itself would move with the camera: there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.box_view import box_view
from tests.support.own_bumper import BUMPER, eyes, frames_of
from tests.support.painted import MOUNT, VGA, floor, plain, wall
from vision.fragments.candidates import NewFragments
from vision.fragments.renewal import Renewal

ROOM = floor() + wall()


def test_no_fragment_lies_on_it() -> None:
    over = box_view(BUMPER, MOUNT, VGA).seen
    counts = []
    for own_parts in ((), (BUMPER,)):
        seeing, count = eyes(*own_parts), 0
        for frame in frames_of(ROOM, 6, speed_mps=0.5):
            ends = np.rint(seeing.perceive(frame, None, None).fragments.ends_px).astype(int)
            count += int(over[ends[..., 1].clip(0, 479), ends[..., 0].clip(0, 639)].sum())
        counts.append(count)
    assert counts[0] > 20
    assert counts[1] == 0


def test_a_fragment_that_a_part_comes_to_hide_is_dropped() -> None:
    """A gripper closes: from the fourth frame on depth is that of the part. Colour is left as it was."""
    take, over = frames_of(ROOM, 6), box_view(BUMPER, MOUNT, VGA)
    seeing, seen = eyes(BUMPER), []
    for number, frame in enumerate(take):
        depth = frame.depth.copy()
        depth[over.seen] = 2000 if number < 3 else 450
        fragments = seeing.perceive(replace(frame, depth=depth), None, None).fragments
        ends = np.rint(fragments.ends_px).astype(int)
        seen.append(int(over.seen[ends[..., 1].clip(0, 479), ends[..., 0].clip(0, 639)].sum()))
    assert min(seen[:3]) > 5
    assert seen[3:] == [0, 0, 0]


def test_a_new_fragment_that_ends_at_a_part_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its ends were moved to a corner, which is one of the part."""
    ends = np.array([[[320, 450], [360, 450]], [[320, 100], [360, 100]]], np.float32)
    depth = np.full((2, 2), 3.0, np.float32)
    new = NewFragments(ends, depth, depth, np.ones((2, 2, 3), np.float32))
    monkeypatch.setattr(Renewal, "find", lambda *_: new)
    fragments = eyes(BUMPER).perceive(frames_of(ROOM, 1)[0], None, None).fragments
    np.testing.assert_array_equal(fragments.ends_px, ends[1:])


def test_the_cameras_motion_is_that_of_the_robot_although_half_of_what_has_marks_is_its_own() -> None:
    """Before a wall without marks, and with a bumper full of them."""
    bare_wall = [replace(quad, texture=plain()) for quad in wall(4.0)]
    seeing = eyes(BUMPER)
    for frame in frames_of(floor() + bare_wall, 12, speed_mps=0.6):
        ego = seeing.perceive(frame, None, None).scene.ego_motion
    assert ego.source == "visual"
    assert ego.motion.translation_m[2] / ego.dt_s == pytest.approx(0.6, abs=0.05)
