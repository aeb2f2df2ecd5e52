"""A closer look at bodies of which too few fragments tell: whose turn it is, and what counts as theirs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import RgbdFrame
from tests.support.painted import MOUNT, QVGA, Quad, box, drive, plain, record, vector
from tests.support.painted_room import SMALL, room
from vision import detector
from vision.ego_motion.camera_motion import CameraEstimate, estimate
from vision.ego_motion.reprojection import Anchors
from vision.fragments.attention import Attention, NeedsFragments
from vision.fragments.candidates import NewFragments
from vision.perception import Perception

CONFIG = PerceptionConfig()
NO_ENDS = np.empty((0, 2, 2), np.float32)
BODY_M = vector(0.3, 0.5, 0.9)  # 76 px by 137 px at 4 m
FRONT_M = 4.0
FRAME_S = 1.0 / 30.0
NOBODY = NeedsFragments(
    np.empty(0, np.int64), np.empty((0, 4)), np.empty(0), np.empty(0), np.empty(0, np.bool_)
)


def one_body(depth_m: float = FRONT_M, number: int = 7, urgent: bool = True) -> NeedsFragments:
    """A box in the image around what stands 4 m ahead on the floor."""
    return NeedsFragments(
        np.array([number]),
        np.array([[281.0, 178.0, 358.0, 316.0]]),
        np.array([depth_m]),
        np.array([0.5]),
        np.array([urgent]),
    )


@pytest.fixture(scope="module")
def frame() -> RgbdFrame:
    return record(room() + box(vector(FRONT_M, 0.0, 0.0), BODY_M, 10), drive(), 1).frames[0]


def grey_of(frame: RgbdFrame) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(frame.colour, cv2.COLOR_BGR2GRAY), np.uint8)


def look(
    frame: RgbdFrame, body: NeedsFragments, attention: Attention | None = None, after_s: float = 0.0
) -> int:
    """How many fragments are found after_s later."""
    later = replace(frame, captured_ns=frame.captured_ns + round(after_s * 1e9))
    new = (attention or awake(frame)).find(later, grey_of(frame), NO_ENDS, body)
    return 0 if new is None else len(new.ends_px)


def awake(frame: RgbdFrame, config: PerceptionConfig = CONFIG) -> Attention:
    """One that began a second before this frame, when there was nobody."""
    attention, earlier = Attention(config), replace(frame, captured_ns=frame.captured_ns - 10**9)
    attention.find(earlier, grey_of(frame), NO_ENDS, NOBODY)
    return attention


def find(
    frame: RgbdFrame, present_px: NDArray[np.float32] = NO_ENDS, config: PerceptionConfig = CONFIG
) -> NewFragments:
    new = awake(frame, config).find(frame, grey_of(frame), present_px, one_body())
    assert new is not None, "it is the turn of this body"
    return new


def test_a_body_gets_fragments_of_its_own(frame: RgbdFrame) -> None:
    found = find(frame)
    assert 2 <= len(found.ends_px) <= 4
    np.testing.assert_allclose(found.near_m, one_body().depth_m[0], atol=0.2)
    lengths = np.linalg.norm(found.ends_px[:, 0] - found.ends_px[:, 1], axis=1)
    assert (lengths >= 8.0).all()


def test_fragment_at_another_depth_is_not_on_the_body(frame: RgbdFrame) -> None:
    assert look(frame, one_body(depth_m=1.5)) == 0


def test_no_second_fragment_is_found_where_one_exists(frame: RgbdFrame) -> None:
    present = find(frame).ends_px
    assert len(present)
    more = find(frame, present).ends_px
    gap = np.abs(more.reshape(-1, 1, 2) - present.reshape(1, -1, 2)).max(axis=2)
    assert (gap > 0.0).all()


def test_an_end_beside_what_has_no_depth_is_nobodys_witness(frame: RgbdFrame) -> None:
    depth = frame.depth.copy()
    depth[:, ::2] = 0  # three columns of five in every neighbourhood are left, at most
    assert look(replace(frame, depth=depth), one_body()) == 0


def test_an_end_between_two_surfaces_is_nobodys_witness(frame: RgbdFrame) -> None:
    found = find(frame)
    assert (found.far_m - found.near_m <= 0.25).all()
    # All of it is an outline, as far as depth tells.
    depth = frame.depth.copy()
    depth[:, ::3] = 9000
    assert look(replace(frame, depth=depth), one_body()) == 0


def test_a_plain_body_without_edges_gets_none() -> None:
    bare = [replace(one, texture=plain()) for one in room()]
    assert look(record(bare, drive(), 1).frames[0], one_body()) == 0


def test_edges_without_corners_give_no_fragment() -> None:
    """Along level stripes an end is held by noise alone; chequers in the same place are as good as any."""
    row, column = np.indices((9, 5))
    for bright, found in ((row % 2 == 0, False), ((row + column) % 2 == 0, True)):
        seen = record([*room(), upright(bright)], drive(), 1).frames[0]
        assert (look(seen, one_body()) > 0) == found


def upright(bright: NDArray[np.bool_]) -> Quad:
    """A plate of bright and dark cells of 10 cm where the body stands."""
    texture = np.kron(np.where(bright, 180, 70), np.ones((32, 32))).astype(np.uint8)
    return replace(box(vector(FRONT_M, 0.0, 0.0), BODY_M, 10)[0], texture=texture)


def test_no_more_than_there_is_room_for(frame: RgbdFrame) -> None:
    taken = np.zeros((20, 2, 2), np.float32)
    for spare, most in ((1, 1), (9, 4)):
        settings = FragmentSettings(max_fragments=20, closer_fragments=spare)
        assert 0 < len(find(frame, taken, PerceptionConfig(fragments=settings)).ends_px) <= most
    full = awake(frame, PerceptionConfig(fragments=FragmentSettings(max_fragments=20, closer_fragments=0)))
    assert full.find(frame, grey_of(frame), taken, one_body()) is None


@pytest.mark.parametrize(("urgent", "pause_s"), [(True, 0.1), (False, 0.5)])
def test_everybody_is_looked_at_only_now_and_then(frame: RgbdFrame, urgent: bool, pause_s: float) -> None:
    attention, body = awake(frame), one_body(urgent=urgent)
    assert look(frame, body, attention) > 0
    assert look(frame, body, attention, pause_s - FRAME_S) == 0
    assert look(frame, body, attention, pause_s) > 0


@pytest.mark.parametrize(("urgent", "pause_s"), [(True, 0.1), (False, 0.5)])
def test_at_the_very_beginning_everybody_waits_as_long(
    frame: RgbdFrame, urgent: bool, pause_s: float
) -> None:
    attention, body = Attention(CONFIG), one_body(urgent=urgent)
    assert look(frame, body, attention) == 0
    assert look(frame, body, attention, pause_s - FRAME_S) == 0
    assert look(frame, body, attention, pause_s) > 0


def both(first: NeedsFragments, second: NeedsFragments, urgent: tuple[bool, bool]) -> NeedsFragments:
    parts = zip(*((one.ids, one.box_px, one.depth_m, one.gate_m) for one in (first, second)), strict=True)
    ids, box_px, depth_m, gate_m = (np.concatenate(part) for part in parts)
    return NeedsFragments(ids, box_px, depth_m, gate_m, np.array(urgent))


def test_the_urgent_one_comes_first_then_who_has_waited_for_longest(frame: RgbdFrame) -> None:
    """Only one of them stands where something is to be found: it is seen when its turn comes."""
    here, away = one_body(number=7), one_body(number=9, depth_m=1.5)
    assert look(frame, both(away, here, (False, True))) > 0
    assert look(frame, both(away, here, (True, False))) == 0
    attention, equal = awake(frame), both(away, here, (True, True))
    assert look(frame, equal, attention) == 0
    assert look(frame, equal, attention, FRAME_S) > 0
    assert look(frame, equal, attention, 2.0 * FRAME_S) == 0  # neither has waited for long


def test_larger_of_two_equally_waiting_bodies_comes_first(frame: RgbdFrame) -> None:
    """Whichever comes first in the list; the small one is nowhere near a fragment."""
    large = one_body(number=7)
    small = replace(one_body(number=9, depth_m=1.5), box_px=np.array([[281.0, 178.0, 301.0, 220.0]]))
    assert look(frame, both(small, large, (True, True))) > 0
    assert look(frame, both(large, small, (True, True))) > 0


def crowded_view() -> list[Quad]:
    """So much texture that the fragments do not suffice for what is small."""
    return room() + box(vector(3.5, 0.4, 0.0), vector(0.4, 0.7, 1.2), 10)


def witnesses(config: PerceptionConfig, monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """For each frame: how many ends are witnesses of a body, and how many of these find the camera."""
    eyes = Perception(config, MOUNT, body_height_m=0.8, clearance_m=0.05)
    found: list[tuple[int, int]] = []

    def noted(anchors: Anchors, *rest: Any) -> CameraEstimate:
        body_only = eyes._detector._store.body_only.repeat(2)
        found.append((int(body_only.sum()), int((anchors.usable & body_only).sum())))
        return estimate(anchors, *rest)

    monkeypatch.setattr(detector, "estimate", noted)
    for frame in record(crowded_view(), drive(0.5), 16, QVGA).frames:
        eyes.perceive(frame, None, None)
    return found


def test_the_cameras_motion_does_not_rest_on_witnesses(monkeypatch: pytest.MonkeyPatch) -> None:
    few = SMALL.fragments.model_copy(update={"max_fragments": 16})
    found = witnesses(SMALL.model_copy(update={"fragments": few}), monkeypatch)
    assert max(present for present, _ in found) >= 4
    assert max(asked for _, asked in found) == 0


def test_a_body_without_straight_edges_gets_fragments_between_its_corners(frame: RgbdFrame) -> None:
    plain_body = frame.colour.copy()
    plain_body[170:330, 270:370] = 90
    assert look(replace(frame, colour=plain_body), one_body()) == 0
    dotted = plain_body.copy()
    for u, v in ((300, 200), (330, 215), (310, 240), (335, 265), (305, 290)):
        cv2.circle(dotted, (u, v), 2, (230, 230, 230), -1)
    found = find(replace(frame, colour=dotted))
    assert len(found.ends_px) == 2
    lower = found.ends_px[:, 1, 1] > found.ends_px[:, 0, 1]
    assert lower.all()
    np.testing.assert_allclose(found.near_m, FRONT_M, atol=0.2)


def test_corners_close_to_the_outline_are_not_moved_onto_it(frame: RgbdFrame) -> None:
    """The outline is a stronger corner everywhere, but it belongs to the background as well."""
    dotted = frame.colour.copy()
    dotted[178:316, 281:358] = 90
    marks = np.array([(287, 200), (288, 215), (287, 240), (288, 265)])
    for u, v in marks.tolist():
        dotted[v - 1 : v + 2, u - 1 : u + 2] = 150
    found = find(replace(frame, colour=dotted))
    assert len(found.ends_px) == 2
    np.testing.assert_allclose(found.ends_px.reshape(-1, 2), marks, atol=2.0)
