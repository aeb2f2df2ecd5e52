"""Where fragments are looked for, and that in time it is everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import RgbdFrame
from tests.support.painted import VGA
from vision.fragments.renewal import PART_PX, Renewal, _outside_of, _picked, _tile_counts, _wanted

TILES = FragmentSettings(tile_px=40, fragments_per_tile=2)


def picture() -> tuple[RgbdFrame, NDArray[np.uint8]]:
    """Black and white cells of 48 px, all 3 m away."""
    cells = np.random.default_rng(5).integers(0, 2, (10, 14), np.uint8) * np.uint8(180) + np.uint8(30)
    grey = np.repeat(np.repeat(cells, 48, axis=0), 48, axis=1)[:480, :640]
    colour = np.repeat(grey[:, :, None], 3, axis=2)
    depth = np.full(grey.shape, 3000, np.uint16)
    return RgbdFrame(colour, depth, 0.001, 0, 0.0, 0, VGA), grey


def present(count: int) -> NDArray[np.float32]:
    """So many fragments in the upper left corner."""
    ends = np.zeros((count, 2, 2), np.float32)
    ends[:, :, 0] = np.arange(2 * count).reshape(count, 2) % 30
    return ends


def parts_of(ends_px: NDArray[np.float32]) -> set[tuple[int, int]]:
    """Row and column of the parts that the middles of segments fall into."""
    middle = ends_px.mean(axis=1)[:, ::-1] // np.array(PART_PX)
    return {(int(row), int(column)) for row, column in middle.tolist()}


def test_at_first_it_looks_everywhere() -> None:
    frame, grey = picture()
    config = PerceptionConfig(fragments=FragmentSettings(max_fragments=400))
    new = Renewal(config).find(frame, grey, present(0), 0)
    assert parts_of(new.ends_px) == {(row, column) for row in range(2) for column in range(4)}


@pytest.mark.parametrize(("missing", "parts"), [(15, 1), (40, 2)])
def test_later_the_image_is_searched_part_by_part_and_a_whole_band_if_many_are_missing(
    missing: int, parts: int
) -> None:
    frame, grey = picture()
    config = PerceptionConfig(fragments=FragmentSettings(max_fragments=160))
    renewal, seen = Renewal(config), set[tuple[int, int]]()
    for visit in range(8 // parts):
        new = renewal.find(frame, grey, present(160 - missing), 0)
        assert len(new.ends_px) <= missing
        there = {(row, column) for row, column in parts_of(new.ends_px) if (row, column) not in seen}
        assert {column for _, column in there} <= {visit * parts // 2, visit * parts // 2 + 1}
        assert len(there) >= parts
        seen |= there
    assert seen >= {(row, column) for row in range(2) for column in range(4)}


@pytest.mark.parametrize(("missing", "turns", "parts"), [(15, 3, 3), (40, 2, 4), (40, 4, 8)])
def test_where_there_is_time_for_several_turns_as_many_parts_are_searched(
    missing: int, turns: int, parts: int
) -> None:
    frame, grey = picture()
    config = PerceptionConfig(fragments=FragmentSettings(max_fragments=160))
    searched, each = Renewal(config), Renewal(config)
    at_once = searched.find(frame, grey, present(160 - missing), 0, turns)
    one_by_one = [each.find(frame, grey, present(160 - missing), 0) for _ in range(turns)]
    found = set.union(*(parts_of(new.ends_px) for new in one_by_one))
    assert parts_of(at_once.ends_px) <= found
    assert len(found) >= parts
    # The next search goes on where this one ended.
    after = searched.find(frame, grey, present(160 - missing), 0)
    np.testing.assert_array_equal(after.ends_px, each.find(frame, grey, present(160 - missing), 0).ends_px)


def test_no_more_than_there_is_room_for() -> None:
    frame, grey = picture()
    config = PerceptionConfig(fragments=FragmentSettings(max_fragments=30))
    assert len(Renewal(config).find(frame, grey, present(0), 0).ends_px) == 30
    assert len(Renewal(config).find(frame, grey, present(30), 0).ends_px) == 0


@pytest.mark.parametrize(("missing", "searched"), [(9, False), (10, True)])
def test_while_few_are_missing_it_does_not_look(missing: int, searched: bool) -> None:
    """One in sixteen of 160 is ten."""
    frame, grey = picture()
    renewal = Renewal(PerceptionConfig(fragments=FragmentSettings(max_fragments=160)))
    new = renewal.find(frame, grey, present(160 - missing), 0)
    assert (len(new.ends_px) > 0) == searched
    assert new.near_m.shape == new.far_m.shape == (len(new.ends_px), 2)
    assert new.pixel_cov.shape == (len(new.ends_px), 2, 3)
    # A frame without a search is no visit: the next search begins at the first part.
    first = Renewal(PerceptionConfig(fragments=FragmentSettings(max_fragments=160)))
    if not searched:
        after = renewal.find(frame, grey, present(140), 0)
        np.testing.assert_array_equal(after.ends_px, first.find(frame, grey, present(140), 0).ends_px)


def test_nothing_is_searched_on_the_robot_itself() -> None:
    frame, grey = picture()
    near_own = np.zeros(grey.shape, np.uint8)
    near_own[:, 200:] = 255
    new = Renewal(PerceptionConfig()).find(frame, grey, present(0), 0, near_own=near_own)
    assert len(new.ends_px) > 5
    assert new.ends_px[..., 0].max() < 200 + 10  # an end is moved to a corner close by


def segments(*middles: tuple[float, float]) -> NDArray[np.float32]:
    """Level ones of 20 px around middles (u, v)."""
    ends = np.repeat(np.array(middles, np.float32).reshape(-1, 1, 2), 2, axis=1)
    ends[:, 0, 0] -= 10.0
    ends[:, 1, 0] += 10.0
    return ends


def test_where_there_is_no_room_the_newest_on_movers_in_a_crowded_tile_are_dropped() -> None:
    """A tile takes two."""
    renewal = Renewal(PerceptionConfig(fragments=FragmentSettings(max_fragments=20)))
    static, mover, scattered = (
        segments(*[(60.0, 50.0)] * 3),
        segments(*[(100.0, 50.0)] * 5, (639.0, 479.0)),
        segments(*[(100.0 + 40.0 * k, 300.0) for k in range(11)]),
    )
    ends, on_movers = np.concatenate((static, mover, scattered)), np.repeat([False, True], [3, 17])
    dropped = renewal.crowded(ends, on_movers, (480, 640))
    assert dropped.nonzero()[0].tolist() == [5, 6, 7]
    assert not renewal.crowded(ends, np.zeros(20, np.bool_), (480, 640)).any()
    assert not renewal.crowded(ends[:18], on_movers[:18], (480, 640)).any(), "there is room"


def test_ends_are_counted_by_tile_up_to_the_rim_of_the_image() -> None:
    """130x90 px are four columns and three rows of tiles of 40 px, the last ones cut."""
    ends = np.array([[[0.0, 0.0], [39.9, 39.9]], [[40.0, 39.0], [129.0, 89.0]]], np.float32)
    expected = np.zeros((3, 4), np.int64)
    expected[0, 0], expected[0, 1], expected[2, 3] = 2, 1, 1
    np.testing.assert_array_equal(_tile_counts(ends, 40, 90, 130), expected)
    assert not _tile_counts(present(0), 40, 90, 130).any()


@pytest.mark.parametrize(("top", "left"), [(0, 0), (72, 35), (40, 80), (79, 41)])
def test_nothing_is_searched_in_full_tiles(top: int, left: int) -> None:
    """Of a part that begins anywhere in the image."""
    full = np.random.default_rng(2).random((5, 6)) < 0.5
    edges = np.full((100, 130), 255, np.uint8)
    whole = np.repeat(np.repeat(full, 40, axis=0), 40, axis=1)
    searched = _outside_of(full, 40, edges, top, left)
    np.testing.assert_array_equal(searched == 0, whole[top : top + 100, left : left + 130])
    assert edges.all()


def test_a_tile_is_offered_the_first_few_segments_and_none_when_it_is_full() -> None:
    """Three tiles that hold none, one and two of the two fragments, that is ends twice as many."""
    counts = np.array([[0, 2, 4]])
    row = segments(*((20.0 + 40.0 * (k % 3), 1.0 + k) for k in range(18)))
    np.testing.assert_array_equal(_wanted(row, counts, TILES), row[[0, 1, 3, 4, 6, 7, 9, 10]])
    # A middle at the border of two tiles is in the second one.
    assert len(_wanted(segments((79.5, 5.0), (80.0, 5.0)), counts, TILES)) == 1


def picked(near_m: list[float], room: int = 9, far_room: int = 9, whole: bool = True) -> list[int]:
    """Of segments in turn in an empty tile and in one that lacks one fragment."""
    turns = segments(*((20.0 + 40.0 * (k % 2), 5.0) for k in range(len(near_m))))
    depth = np.repeat(np.array(near_m).reshape(-1, 1), 5, axis=1)
    good = ~np.isnan(depth[:, 0]) & whole
    result: list[int] = _picked(turns, depth, good, np.array([[0, 2]]), TILES, room, far_room).tolist()
    return result


def test_tiles_are_filled_up_in_turn_while_there_is_room() -> None:
    assert picked([3.0] * 8) == [0, 1, 2]
    assert picked([3.0] * 8, room=2) == [0, 1]
    assert picked([3.0] * 8, room=-1) == []
    assert picked([3.0] * 8, whole=False) == []
    assert picked([]) == []


def test_only_so_many_without_any_depth_and_these_take_a_place_as_well() -> None:
    nowhere = float("nan")
    assert picked([nowhere, 3.0, nowhere, nowhere, 3.0], far_room=1) == [0, 1, 4]
    assert picked([nowhere, 3.0, nowhere, nowhere, 3.0]) == [0, 1, 2]
    assert picked([nowhere] * 4, far_room=0) == []


def slope() -> tuple[RgbdFrame, NDArray[np.uint8]]:
    """An edge that falls by one pixel in 48, a little smoothed: every twelve pixels a stair, a quarter as
    high as the edge is strong."""
    v, u = np.mgrid[0:480, 0:640]
    below = np.clip(v - 240 - u / 48.0, -0.5, 0.5)
    grey = (120 + 30 * np.rint(4.0 * below)).astype(np.uint8)
    colour = np.repeat(grey[:, :, None], 3, axis=2)
    return RgbdFrame(colour, np.full(grey.shape, 3000, np.uint16), 0.001, 0, 0.0, 0, VGA), grey


def sigmas_px(frame: RgbdFrame, grey: NDArray[np.uint8]) -> NDArray[np.float64]:
    """(2N, 2) smaller and larger standard deviation of the new ends."""
    xx, xy, yy = Renewal(PerceptionConfig()).find(frame, grey, present(0), 0).pixel_cov.reshape(-1, 3).T
    matrices = np.array([[xx, xy], [xy, yy]], float).transpose(2, 0, 1)
    assert len(matrices) >= 8
    return np.sqrt(np.linalg.eigvalsh(matrices))


def test_the_stairs_of_an_edge_hold_no_end_along_it() -> None:
    across, along = sigmas_px(*slope()).T
    assert across.max() < 0.2
    assert np.median(along) > 1.0


def test_a_corner_holds_its_end_both_ways() -> None:
    _, wider = sigmas_px(*picture()).T
    assert np.median(wider) < 0.2
