"""Parts to bodies: what is merged, attached and detached (what is divided: test_division.py;
where the rest of somebody hidden is expected: test_expected.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.grids import grid_of, labelled, plate, wall
from tests.support.parts import Body, regions
from vision.grouping import Boxes, attach, boxes, detach, gaps_m, merges
from vision.regions import measure

ALL = np.array
NOWHERE = np.zeros((4, 2), np.bool_)  # no track is expected in any of four parts


def merged(
    *bodies: Body,
    velocity: list[tuple[float, float, float]] | None = None,
    sigma: float = 0.05,
    moving: list[bool] | None = None,
    mover: list[bool] | None = None,
    behind_m: float = 9.0,
) -> list[tuple[int, int]]:
    """All move alike, and all are known as moving, unless said otherwise. behind_m: of what is seen between
    them, 0 for nothing."""
    count = len(bodies)
    speeds = velocity or [(0.8, 0.0, 0.0)] * count
    known = moving or [True] * count
    return merges(
        grid_of(wall(behind_m)),
        regions(*bodies),
        np.array(speeds),
        np.full(count, sigma),
        np.array(mover or known),
        np.array(known),
    )


PERSON = Body(0.0)
ARM = Body(0.45, y=-0.3, width=0.3, height=0.3, cells=90)  # 0.1 m from the person's box


def test_gaps_between_boxes_by_hand() -> None:
    box = boxes(regions(Body(0.0), Body(0.7), Body(0.7, z=4.5), Body(0.1)))
    first, second = ALL([0, 0, 0]), ALL([1, 2, 3])
    # 0.7 - 0.4 across; then 0.5 - 0.2 in depth with it; overlapping boxes touch.
    np.testing.assert_allclose(gaps_m(box, first, box, second), [0.3, np.hypot(0.3, 0.3), 0.0], atol=1e-12)
    other = Boxes(ALL([[1.2, 0.0, 4.0]]), ALL([[1.4, 0.1, 4.1]]))
    assert gaps_m(box, ALL([0]), other, ALL([0]))[0] == pytest.approx(1.0)


def test_a_small_part_beside_a_mover_that_goes_alike_is_part_of_it() -> None:
    assert merged(PERSON, ARM) == [(1, 0)]
    assert merged(ARM, PERSON) == [(0, 1)]


def test_small_is_half_of_the_mover_at_most() -> None:
    assert merged(PERSON, Body(0.6, width=0.6, cells=100)) == [(1, 0)]  # 0.1 m away, 1.1 m wide together
    assert merged(PERSON, Body(0.6, width=0.6, cells=101)) == []


def test_a_part_too_far_away_is_not() -> None:
    assert merged(PERSON, Body(0.75, y=-0.3, width=0.3, height=0.3, cells=40)) == []  # 0.4 m


def test_a_part_with_another_velocity_is_not() -> None:
    speeds = [(0.8, 0.0, 0.0), (0.2, 0.0, 0.0)]
    assert merged(PERSON, ARM, velocity=speeds) == []
    # Two sigmas of the difference explain the rest of it: 0.6 <= 0.4 + 2 * 0.071 * sqrt(2).
    assert merged(PERSON, ARM, velocity=speeds, sigma=0.069) == []
    assert merged(PERSON, ARM, velocity=speeds, sigma=0.072) == [(1, 0)]


def test_only_a_mover_takes_and_only_a_suspect_is_taken() -> None:
    assert merged(PERSON, ARM, moving=[True, False], mover=[True, True]) == [(1, 0)]
    assert merged(PERSON, ARM, moving=[False, True], mover=[True, True]) == []  # the larger does not move
    assert merged(PERSON, ARM, moving=[True, False], mover=[True, False]) == []
    assert merged(PERSON, ARM, moving=[False, False], mover=[True, True]) == []


def test_people_side_by_side_stay_two() -> None:
    assert merged(PERSON, Body(0.6, cells=180)) == []  # 0.2 m apart, 1 m wide together


def test_halves_of_one_persons_width_are_one() -> None:
    left, right = Body(-0.15, width=0.25, cells=100), Body(0.15, width=0.25, cells=90)
    assert merged(left, right) == [(1, 0)]
    # 0.84 m is one person's width, 0.87 m is not.
    assert merged(Body(-0.215, width=0.41), Body(0.215, width=0.41, cells=190)) == [(1, 0)]
    assert merged(Body(-0.23, width=0.41), Body(0.23, width=0.41, cells=190)) == []


def test_what_overlaps_in_the_image_by_half_is_one_even_when_large_and_somewhat_deeper() -> None:
    wide = Body(0.0, width=1.0, cells=300)
    assert merged(wide, Body(0.3, z=4.45, width=0.9, cells=250)) == [(1, 0)]  # 0.25 m behind
    assert merged(wide, Body(0.3, z=4.58, width=0.9, cells=250)) == [(1, 0)]  # 0.38
    assert merged(wide, Body(0.3, z=4.75, width=0.9, cells=250)) == []  # 0.55
    # 0.47 m of 0.9 m, and 0.43 m of it.
    assert merged(wide, Body(0.48, width=0.9, cells=250)) == [(1, 0)]
    assert merged(wide, Body(0.52, width=0.9, cells=250)) == []


def test_without_overlap_a_part_must_be_within_a_quarter_of_a_metre() -> None:
    below = Body(0.0, y=0.8 + 0.25 + 0.28, height=0.5, cells=50)
    assert merged(PERSON, below) == []
    assert merged(PERSON, Body(0.0, y=0.8 + 0.25 + 0.22, height=0.5, cells=50)) == [(1, 0)]


def test_two_alike_are_merged_once_and_not_into_each_other() -> None:
    same = Body(0.0, cells=100)
    assert len(merged(same, Body(0.05, cells=100))) == 1


def test_of_two_that_a_part_may_belong_to_the_closer_one_comes_first() -> None:
    front, back = Body(0.0, z=3.6, width=0.6, deep=0.6, cells=900), Body(0.0, z=4.1)
    shank = Body(0.3, y=0.5, z=4.15, width=0.15, height=0.5, cells=60)
    assert merged(front, back, shank) == [(2, 1), (1, 0), (2, 0)]  # gaps of 0.03, 0.1 and 0.15 m
    # Both touch it: the one at whose depth it is.
    deep = Body(0.0, z=3.8, width=0.6, deep=0.8, cells=900)
    assert merged(deep, Body(0.1, z=4.1, width=0.4), shank)[0] == (2, 1)


CART = Body(0.0, y=0.2, z=1.0, width=0.6, height=0.4, cells=900)
MAST = Body(0.0, y=-0.3, z=1.7, width=0.2, height=0.6, deep=0.1, cells=100)  # 0.55 m behind the cart's front


def test_what_stands_on_a_mover_in_the_image_and_goes_exactly_as_it_does_is_carried_by_it() -> None:
    assert merged(CART, MAST) == [(1, 0)]
    assert merged(CART, replace(MAST, y=-0.4)) == []  # it ends above the cart
    assert merged(CART, replace(MAST, x=0.5, width=0.4)) == []  # and this beside it
    assert merged(CART, replace(MAST, z=2.1)) == []  # 0.95 m behind it
    assert merged(CART, MAST, velocity=[(0.8, 0.0, 0.0), (0.5, 0.0, 0.0)]) == []
    assert merged(CART, MAST, sigma=0.4) == []  # not known well enough


FAR_WHEEL = Body(0.1, y=0.5, z=2.0, width=0.2, height=0.4, deep=0.1, cells=40)  # 0.85 m behind the front


def test_what_is_seen_through_a_mover_and_goes_much_as_it_does_is_its_own() -> None:
    assert merged(CART, FAR_WHEEL) == [(1, 0)]
    assert merged(CART, FAR_WHEEL, velocity=[(0.8, 0.0, 0.0), (0.41, 0.0, 0.0)]) == [(1, 0)]
    assert merged(CART, replace(FAR_WHEEL, x=0.8)) == []  # beside it
    assert merged(CART, replace(FAR_WHEEL, z=2.9, y=0.6)) == []  # 1.75 m behind it
    assert merged(CART, FAR_WHEEL, velocity=[(0.8, 0.0, 0.0), (0.39, 0.0, 0.0)]) == []
    assert merged(CART, FAR_WHEEL, sigma=0.4) == []


def test_what_is_low_beside_a_mover_and_goes_much_as_it_does_is_what_it_pushes() -> None:
    pusher = Body(0.0, y=0.1, width=0.4, height=1.6, cells=500)
    trolley = Body(-0.78, y=0.45, width=1.0, height=0.9, cells=400)  # 0.08 m before him, 0.56 of his height
    assert merged(pusher, trolley) == [(1, 0)]
    assert merged(pusher, replace(trolley, y=0.4, height=1.0)) == []  # 0.62 of it
    assert merged(pusher, replace(trolley, x=-0.82)) == []  # 0.12 m before him, as a child may walk
    assert merged(pusher, trolley, velocity=[(0.8, 0.0, 0.0), (0.39, 0.0, 0.0)]) == []
    assert merged(pusher, trolley, sigma=0.4) == []  # not known well enough


def test_what_is_seen_through_a_mover_stays_with_it_while_most_of_it_was_there_before() -> None:
    winner, nowhere = np.array([1, 1], np.int32), NOWHERE[:2, :1]
    for wheel, votes, stays in (
        (FAR_WHEEL, 28, 1),
        (FAR_WHEEL, 27, 0),
        (replace(FAR_WHEEL, x=0.8), 40, 0),
        (replace(FAR_WHEEL, z=2.9, y=0.6), 40, 0),
    ):
        parts = regions(CART, wheel)
        np.testing.assert_array_equal(detach(winner, parts, np.array([800, votes]), nowhere), [1, stays])


def test_what_a_mover_carries_stays_with_it_while_most_of_it_was_there_before() -> None:
    parts, winner = regions(CART, MAST), np.array([1, 1], np.int32)
    nowhere = NOWHERE[:2, :1]
    np.testing.assert_array_equal(detach(winner, parts, np.array([800, 70]), nowhere), [1, 1])
    np.testing.assert_array_equal(detach(winner, parts, np.array([800, 69]), nowhere), [1, 0])
    above = regions(CART, replace(MAST, y=-0.4))
    np.testing.assert_array_equal(detach(winner, above, np.array([800, 100]), nowhere), [1, 0])


REAR = Body(-0.6, z=3.0, width=1.0, height=1.2, deep=0.1, cells=900)
WHEEL = Body(0.6, y=0.3, z=3.2, width=0.4, height=0.6, deep=0.1, cells=480)  # 0.51 m from the rear


def test_pieces_of_something_wide_with_nothing_seen_between_them_are_one() -> None:
    assert merged(REAR, WHEEL, behind_m=0.0) == [(1, 0)]
    assert merged(REAR, WHEEL, behind_m=3.1) == [(1, 0)]  # its own side
    assert merged(REAR, WHEEL, behind_m=5.0) == []  # the way behind is seen
    assert merged(REAR, WHEEL, behind_m=14.0) == []  # even beyond the depth mask
    assert merged(REAR, replace(WHEEL, x=0.95), behind_m=0.0) == []  # 0.86 m away
    narrow = replace(REAR, x=-0.4, width=0.6)
    assert merged(narrow, WHEEL, behind_m=0.0) == []  # two people walk like that
    assert merged(REAR, WHEEL, behind_m=0.0, sigma=0.4) == []
    assert merged(REAR, WHEEL, behind_m=0.0, velocity=[(0.8, 0.0, 0.0), (0.5, 0.0, 0.0)]) == []
    # Hardly anything moves so slowly that it would not go like what stands.
    assert merged(REAR, WHEEL, behind_m=0.0, velocity=[(0.29, 0.0, 0.0)] * 2) == []


def test_tracks_that_are_not_seen_take_no_part() -> None:
    assert merged(PERSON, Body(0.45, y=-0.3, width=0.3, height=0.3, cells=0)) == []


def test_a_small_part_that_nobody_claims_goes_to_the_mover_beside_it() -> None:
    parts = regions(PERSON, ARM, Body(3.0, cells=30), Body(-0.45, cells=101))
    winner = np.array([2, 0, 0, 0], np.int32)
    mover = np.array([False, True])
    given = attach(np.array([1, 2, 3]), parts, winner, mover, NOWHERE)
    # The arm; not the part 2.5 m away; not the one that is more than half as large as the mover.
    np.testing.assert_array_equal(given, [2, 2, 0, 0])
    np.testing.assert_array_equal(
        attach(np.array([1]), parts, winner, np.array([True, False]), NOWHERE), winner
    )


def test_the_nearest_mover_gets_the_part() -> None:
    parts = regions(Body(-0.5), Body(0.55), Body(0.2, width=0.2, height=0.2, cells=20))
    winner = np.array([1, 2, 0], np.int32)
    given = attach(np.array([2]), parts, winner, np.array([True, True]), NOWHERE[:3])
    np.testing.assert_array_equal(given, [1, 2, 2])  # 0.05 m away, the other one 0.2 m


def test_parts_far_from_a_tracks_main_one_are_taken_from_it() -> None:
    parts = regions(Body(0.0), Body(0.7, cells=50), Body(0.9, cells=50), Body(2.0))
    winner = np.array([1, 1, 1, 2], np.int32)
    # 0.3 m stays, 0.5 m goes; the other track's only part is its main one.
    np.testing.assert_array_equal(detach(winner, parts, np.array([90, 40, 40, 5]), NOWHERE), [1, 1, 0, 2])
    # The main one is what most cells spoke for.
    np.testing.assert_array_equal(detach(winner, parts, np.array([40, 40, 90, 5]), NOWHERE), [0, 1, 1, 2])
    nobody = np.zeros(4, np.int32)
    np.testing.assert_array_equal(detach(nobody, parts, np.zeros(4, np.intp), NOWHERE), nobody)


def test_what_is_measured_of_a_grid_agrees_with_its_boxes() -> None:
    depth_m = plate(3.0, (-0.5, 0.1), (-0.4, 0.6))
    box = boxes(measure(grid_of(depth_m), labelled(depth_m > 0.0), 1))
    np.testing.assert_allclose(box.low_m[0], [-0.5, -0.4, 3.0], atol=0.06)
    np.testing.assert_allclose(box.high_m[0], [0.1, 0.6, 3.0], atol=0.06)
