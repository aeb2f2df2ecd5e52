"""Two people who are one connected part of the depth image are divided; one body never is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.grids import LEVEL_UP, X, grid_of, labelled, nearest, people, plate
from vision.bodies import division
from vision.bodies.merging import merge_labels
from vision.depth.depth_grid import BoolGrid, DepthGrid


def second_of(
    grid: DepthGrid, labels: NDArray[np.int32], track: int, stayed: BoolGrid | None = None, way_m: float = 1.0
) -> NDArray[np.intp] | None:
    """Nothing has stayed where it was, unless said otherwise."""
    return division.second_body(grid, labels, track, nothing(labels) if stayed is None else stayed, way_m)


def nothing(labels: NDArray[np.int32]) -> BoolGrid:
    return np.zeros(labels.shape, np.bool_)


def two_people(gap_m: float, bridge: bool = True) -> tuple[DepthGrid, NDArray[np.int32]]:
    """Two upright plates 0.45 m wide, gap_m apart, joined at the hands: one connected part."""
    half = gap_m / 2
    left = plate(3.0, (-half - 0.45, -half), (-0.7, 0.9))
    right = plate(3.0, (half, half + 0.45), (-0.7, 0.9))
    hands = plate(3.0, (-half, half), (0.2, 0.32)) if bridge else np.zeros_like(left)
    depth_m = nearest(left, right, hands)
    return grid_of(depth_m, LEVEL_UP, 1.0), labelled(depth_m > 0.0)


def test_two_people_hand_in_hand_are_divided_between_them() -> None:
    grid, labels = two_people(0.4)
    second = second_of(grid, labels, 0)
    assert second is not None
    columns = second % labels.shape[1]
    side = np.sign(X[columns])
    assert (side == side[0]).mean() > 0.97  # all on one side of the middle
    of_side = np.count_nonzero((labels > 0) & (np.sign(X) == side[0])[None, :])
    assert len(second) >= 0.8 * of_side
    assert 2 * len(second) <= np.count_nonzero(labels) + 1  # the smaller one


def test_only_the_tracks_asked_that_hold_two_bodies_are_divided() -> None:
    grid, labels = two_people(0.4)
    pair, child = labels, np.where(X > 0.0, labels, 0).astype(np.int32)
    none, far_m = nothing(labels), np.ones(2)
    (found,) = division.second_bodies(grid, pair, np.array([0, 1]), none, far_m)
    second = second_of(grid, labels, 0)
    assert second is not None
    assert found[0] == 0
    assert np.array_equal(found[1], second)
    assert division.second_bodies(grid, pair, np.array([1]), none, far_m) == []
    assert division.second_bodies(grid, child, np.array([0]), none, far_m) == []


@pytest.mark.parametrize(("share", "divided"), [(0.3, True), (0.42, False)])
def test_a_valley_is_lower_than_a_third_of_both_sides(share: float, divided: bool) -> None:
    left, right = plate(3.0, (-0.7, -0.25), (-0.7, 0.9)), plate(3.0, (0.25, 0.7), (-0.7, 0.9))
    depth_m = nearest(left, right, plate(3.0, (-0.25, 0.25), (0.9 - 1.6 * share, 0.9)))
    assert (second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0) is not None) == divided


def test_a_part_that_would_be_divided_from_one_goes_to_the_next() -> None:
    grid, labels = two_people(0.4)
    labels = np.where(labels == 0, 0, np.where(X < 0.0, 1, 2)[None, :]).astype(np.int32)
    labels[-labels.shape[0] // 2 :][labels[-labels.shape[0] // 2 :] == 2] = 3  # the right one's legs
    joined, gone = merge_labels(grid, labels, [(1, 0), (2, 1)], labels > 0, np.ones(3))
    assert gone == [2]
    np.testing.assert_array_equal(joined, np.where(labels == 3, 2, labels))
    # Nothing goes where nothing is left.
    assert merge_labels(grid, labels, [(2, 1), (2, 0), (1, 2)], labels > 0, np.ones(3))[1] == [2]


def test_only_the_cells_of_that_track_are_divided() -> None:
    grid, labels = two_people(0.4)
    both = np.where(labels == 1, np.int32(2), np.int32(0)).astype(np.int32)
    assert second_of(grid, both, 0) is None
    assert second_of(grid, both, 1) is not None


@pytest.mark.parametrize(
    ("barrel_stays", "walker_stays", "barrel_begins_anew"),
    [(True, False, True), (False, False, False), (True, True, False), (False, True, False)],
)
def test_the_track_goes_with_the_one_that_moves_also_if_the_other_is_larger(
    barrel_stays: bool, walker_stays: bool, barrel_begins_anew: bool
) -> None:
    barrel, walker = plate(3.0, (-0.8, -0.25), (-0.7, 0.9)), plate(3.0, (0.25, 0.65), (-0.7, 0.9))
    depth_m = nearest(barrel, walker, plate(3.0, (-0.25, 0.25), (0.2, 0.32)))
    stayed = (barrel_stays & (barrel > 0.0)) | (walker_stays & (walker > 0.0))
    second = second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0, stayed)
    assert second is not None
    assert ((barrel > 0.0).ravel()[second].mean() > 0.5) == barrel_begins_anew


@pytest.mark.parametrize("width_m", [0.6, 1.4, 2.0])
def test_a_crate_is_one_however_wide(width_m: float) -> None:
    depth_m = plate(3.0, (-width_m / 2, width_m / 2), (-0.4, 0.6))
    assert second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0) is None


def test_one_person_with_arms_stretched_out_is_one() -> None:
    body, arms = plate(3.0, (-0.2, 0.2), (-0.7, 0.9)), plate(3.0, (-0.55, 0.55), (-0.4, -0.25))
    depth_m = nearest(body, arms)
    assert second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0) is None


def test_a_few_cells_are_not_divided() -> None:
    grid, labels = two_people(0.4)
    sparse = np.zeros_like(labels)
    chosen = np.flatnonzero(labels)[::40]
    assert len(chosen) < 48
    sparse.ravel()[chosen] = 1
    assert second_of(grid, sparse, 0) is None


def test_part_seen_through_a_body_is_not_divided_from_it() -> None:
    """The far wheels of a cart, 1.2 m behind its front, under it; and not under it."""
    front = nearest(plate(2.0, (-0.4, 0.4), (-0.6, 0.3)), plate(2.0, (-0.4, -0.3), (0.3, 0.7)))
    wheel = plate(3.2, (-0.1, 0.3), (0.6, 1.0))
    beside = plate(3.2, (0.9, 1.3), (0.6, 1.0))
    for far, one in ((wheel, True), (beside, False)):
        depth_m = nearest(front, far)
        assert (second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0, depth_m > 0.0) is None) == one


@pytest.mark.parametrize(
    ("low_m", "stayed_m", "way_m", "divided"),
    [
        (0.9, 0.0, 1.0, False),
        (1.05, 0.0, 1.0, True),
        (0.9, 0.45, 1.0, True),
        (0.9, 0.45, 0.3, False),  # much of its bed is where its bed was before
        (0.9, 0.6, 0.3, True),
    ],
)
def test_low_part_beside_a_body_is_divided_from_it_if_it_stands(
    low_m: float, stayed_m: float, way_m: float, divided: bool
) -> None:
    """A trolley before who pushes it, 1.6 m tall, joined by its handle; 0.6 m long."""
    person, trolley = plate(3.0, (0.3, 0.7), (-0.7, 0.9)), plate(3.0, (-0.7, -0.1), (0.9 - low_m, 0.9))
    depth_m = nearest(person, trolley, plate(3.0, (-0.1, 0.3), (0.2, 0.35)))
    stayed = plate(3.0, (-0.7, -0.7 + stayed_m), (-0.7, 0.9)) > 0.0
    assert (second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0, stayed, way_m) is not None) == divided


def test_one_body_behind_somebody_is_not_divided() -> None:
    """1.3 m wide; what hides its middle, and leaves a foot's breadth of it, makes no two of it."""
    whole, foot = plate(4.0, (-0.65, 0.65), (-0.6, 0.8)), plate(4.0, (-0.3, 0.3), (0.7, 0.8))
    somebody = plate(2.0, (-0.15, 0.15), (-0.5, 0.35))
    two = nearest(plate(4.0, (-0.65, -0.3), (-0.6, 0.8)), plate(4.0, (0.3, 0.65), (-0.6, 0.8)), foot)
    hidden = nearest(whole, somebody)
    assert second_of(grid_of(two), labelled(two > 0.0), 0) is not None
    assert second_of(grid_of(hidden), labelled(hidden == 4.0), 0) is None


@pytest.mark.parametrize(
    ("wide_m", "behind_m", "divided"),
    [(1.0, 0.0, False), (1.0, 6.0, True), (1.0, 14.0, True), (0.5, 0.0, True)],
)
def test_between_a_piece_wider_than_anybody_and_another_something_has_to_be_seen(
    wide_m: float, behind_m: float, divided: bool
) -> None:
    """The rim of a vehicle's side, of which depth shows nothing else."""
    left, right = plate(3.0, (-0.3 - wide_m, -0.3), (-0.7, 0.9)), plate(3.0, (0.3, 0.8), (-0.7, 0.9))
    body = nearest(left, right, plate(3.0, (-0.3, 0.3), (-0.7, -0.6)))
    depth_m = np.where(body > 0.0, body, behind_m)
    assert (second_of(grid_of(depth_m), labelled(body > 0.0), 0) is not None) == divided


@pytest.mark.parametrize(
    ("apart_m", "tall_m", "head_m", "divided"),
    [
        (0.5, (1.7, 1.7), 0.2, True),
        (0.4, (1.7, 1.7), 0.2, True),  # shoulder before shoulder: together 0.85 m wide
        (0.7, (1.7, 1.5), 0.2, True),
        (0.9, (1.7, 1.7), 0.2, False),  # whose arms do not touch leaves a valley
        (0.5, (1.7, 1.7), 0.45, False),  # two loads, not two heads
        (0.6, (1.7, 0.95), 0.2, False),  # low beside him: what he pushes, and its handle
    ],
)
def test_two_heads_are_two_people_however_close_they_walk(
    apart_m: float, tall_m: tuple[float, float], head_m: float, divided: bool
) -> None:
    depth_m = people(apart_m, tall_m, head_m)
    second = second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0)
    assert (second is not None) == divided
    if second is not None:
        columns = second % depth_m.shape[1]
        side = np.sign(X[columns[0]])
        assert (np.sign(X[columns]) == side).all()
        assert len(second) >= 0.8 * np.count_nonzero((depth_m > 0.0) & (np.sign(X) == side)[None, :])


def test_an_arm_raised_is_no_second_head() -> None:
    body, head = plate(3.0, (-0.225, 0.225), (-0.5, 0.9)), plate(3.0, (-0.1, 0.1), (-0.8, -0.5))
    arms = plate(3.0, (0.225, 0.7), (-0.5, -0.4))
    for hand in (plate(3.0, (0.6, 0.7), (-0.6, -0.4)), plate(3.0, (0.55, 0.7), (-0.8, -0.4))):
        depth_m = nearest(body, head, arms, hand)
        assert second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0) is None


@pytest.mark.parametrize("post_m", [0.04, 0.10, 0.15])
@pytest.mark.parametrize("tall_m", [0.45, 0.7])
def test_two_posts_on_a_cart_are_no_heads(post_m: float, tall_m: float) -> None:
    """As wide as a head, some of them, but without shoulders."""
    cart = plate(3.0, (-0.5, 0.5), (0.0, 0.9))
    posts = [plate(3.0, (x_m - post_m / 2, x_m + post_m / 2), (-tall_m, 0.0)) for x_m in (-0.3, 0.3)]
    depth_m = nearest(cart, *posts)
    assert second_of(grid_of(depth_m), labelled(depth_m > 0.0), 0) is None
