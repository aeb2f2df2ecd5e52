"""The fragments as they live: kept from frame to frame, renewed where they thin out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import PlanarPose, RgbdFrame
from tests.support.painted import FRAME_NS, MOUNT, QVGA, Take, box, drive, floor, plain, record, vector, wall
from vision.fragments.attention import Attention
from vision.fragments.candidates import NOTHING_NEW, NewFragments
from vision.fragments.renewal import Renewal
from vision.perception import Perception
from vision.scene import Fragments

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
ROOM = floor() + wall() + box(vector(3.5, 0.5, 0.0), vector(0.4, 0.6, 1.2), 10)
COUNT = 20


@cache
def ahead() -> Take:
    return record(ROOM, drive(0.5), COUNT, QVGA)


def turning(time_s: float) -> PlanarPose:
    """0.6 rad/s: after half a second a third of the view is new."""
    return PlanarPose(0.0, 0.0, 0.6 * time_s)


def watch(take: Take, config: PerceptionConfig = SMALL) -> list[Fragments]:
    eyes = Perception(config, MOUNT, 0.8, 0.05)
    return [
        eyes.perceive(frame, camera, None).fragments
        for frame, camera in zip(take.frames, take.cameras, strict=True)
    ]


def test_most_fragments_live_on_from_frame_to_frame() -> None:
    seen = watch(ahead())
    for before, now in pairwise(seen[1:]):
        kept = np.isin(before.ids, now.ids)
        assert len(before.ids) >= 40
        assert kept.mean() >= 0.85
    assert len(set(seen[2].ids) & set(seen[12].ids)) >= 0.4 * len(seen[2].ids)


def test_ids_are_never_used_twice_and_ascend() -> None:
    gone: set[int] = set()
    before: set[int] = set()
    for fragments in watch(ahead()):
        now = set(fragments.ids.tolist())
        assert (np.diff(fragments.ids) > 0).all()
        assert not now & gone
        gone |= before - now
        before = now
    assert gone


def test_new_fragments_replace_those_that_leave_the_view() -> None:
    seen = watch(record(ROOM, turning, COUNT, QVGA))
    first, last = seen[2], seen[-1]
    assert len(last.ids) >= 0.8 * len(first.ids)
    assert np.count_nonzero(~np.isin(last.ids, first.ids)) >= 20
    # The robot turns left: what has come into view since then is at the left.
    fresh = last.ends_px[~np.isin(last.ids, first.ids)].mean(axis=1)
    assert np.count_nonzero(fresh[:, 0] < 100.0) >= 8


def test_no_more_fragments_than_the_configuration_allows() -> None:
    few = SMALL.fragments.model_copy(update={"max_fragments": 30, "closer_fragments": 2})
    seen = watch(ahead(), SMALL.model_copy(update={"fragments": few}))
    assert max(len(one.ids) for one in seen) <= 32
    assert len(seen[-1].ids) >= 25


def test_a_plain_floor_has_no_fragments() -> None:
    bare = [replace(one, texture=plain()) for one in floor()]
    for fragments in watch(record(bare, drive(0.5), 4, QVGA)):
        # At most the horizon, where the floor ends: it has no depth behind it.
        assert (fragments.ends_px[:, :, 1] < QVGA.cy + 40).all()


def test_fragments_lie_where_the_painted_surfaces_are() -> None:
    take = ahead()
    fragments = watch(take)[-1]
    known = np.isfinite(fragments.depth_m)
    assert known.mean() > 0.8
    middle = fragments.ends_px[known].mean(axis=1)
    position = fragments.position_m[known]
    np.testing.assert_allclose(position[:, 2], fragments.depth_m[known])
    u = position[:, 0] / position[:, 2] * QVGA.fx + QVGA.cx
    v = position[:, 1] / position[:, 2] * QVGA.fy + QVGA.cy
    np.testing.assert_allclose(np.stack((u, v), axis=1), middle, atol=1e-3)
    # Nothing lies under the floor (0.5 m below the camera) nor behind the wall.
    assert position[:, 1].max() < 0.5 + 0.06
    assert position[:, 2].max() < 7.0 - 0.5 * (COUNT - 1) * FRAME_NS * 1e-9 + 0.1


def test_velocity_of_a_fragment_is_unknown_before_it_is_measured() -> None:
    seen = watch(ahead())
    assert np.isnan(seen[0].velocity_mps).all()
    later = seen[-1].velocity_mps
    assert np.isfinite(later).all(axis=1).mean() > 0.8
    # Everything stands still.
    assert np.nanmedian(np.abs(later), axis=0) == pytest.approx([0.0] * 3, abs=0.15)
    sigma = seen[-1].velocity_sigma_mps
    np.testing.assert_array_equal(np.isnan(sigma), np.isnan(later))
    assert np.nanmin(sigma) > 0.0


@pytest.mark.parametrize(("looks", "renewals"), [(True, COUNT // 2), (False, COUNT)])
def test_look_at_a_body_takes_the_place_of_every_second_renewal(
    looks: bool, renewals: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where bodies wait for a look in every frame, the camera's motion needs new fragments all the same."""
    renewed: list[int] = []
    find = Renewal.find

    def noted(self: Renewal, frame: RgbdFrame, *rest: Any) -> NewFragments:
        renewed.append(frame.sequence)
        return find(self, frame, *rest)

    def looked(*_: object) -> NewFragments | None:
        return NOTHING_NEW if looks else None

    monkeypatch.setattr(Renewal, "find", noted)
    monkeypatch.setattr(Attention, "find", looked)
    watch(ahead())
    assert len(renewed) == pytest.approx(renewals, abs=1)
    assert looks == (max(np.diff(renewed)) == 2)


@pytest.mark.parametrize(("every", "turns"), [(1, 1), (3, 3), (4, 4)])
def test_at_a_lower_frame_rate_as_much_is_searched_in_the_same_time(
    every: int, turns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 10 Hz three bodies are looked at, and three times as many parts are searched, in every frame."""
    looked: list[int] = []
    renewed: list[int] = []
    find = Renewal.find

    def noted(self: Renewal, frame: RgbdFrame, *rest: Any) -> NewFragments:
        renewed.append(rest[3])
        return find(self, frame, *rest)

    def look(_self: Attention, frame: RgbdFrame, *_: object) -> NewFragments:
        looked.append(frame.sequence)
        return NOTHING_NEW

    monkeypatch.setattr(Renewal, "find", noted)
    monkeypatch.setattr(Attention, "find", look)
    take = ahead()
    watch(replace(take, frames=take.frames[::every], cameras=take.cameras[::every]))
    assert renewed[0] == 1  # the first frame is searched all over, whatever its turns
    assert set(renewed[1:]) == {turns}
    later = [frame.sequence for frame in take.frames[::every]][1:]
    assert looked == [sequence for sequence in later for _ in range(turns)]
    if turns > 1:
        assert len(renewed) == len(take.frames[::every])
