"""Two tracks that may be one body (what is divided again: test_division.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.support.grids import grid_of, wall
from tests.support.parts import ARM, PERSON, Body, regions
from vision.bodies.merging import pairs_to_merge


def merged(
    *bodies: Body,
    velocity: list[tuple[float, float, float]] | None = None,
    sigma: float = 0.05,
    moving: list[bool] | None = None,
    mover: list[bool] | None = None,
    moving_s: float = 0.9,
    behind_m: float = 9.0,
) -> list[tuple[int, int]]:
    """All move alike, and all are known as moving, unless said otherwise. behind_m: of what is seen between
    them, 0 for nothing."""
    count = len(bodies)
    speeds = velocity or [(0.8, 0.0, 0.0)] * count
    known = moving or [True] * count
    return pairs_to_merge(
        grid_of(wall(behind_m)),
        regions(*bodies),
        np.array(speeds),
        np.full(count, sigma),
        np.array(mover or known),
        np.array(known),
        np.full(count, moving_s),
    )


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


def test_noise_does_not_excuse_who_has_long_moved_by_himself() -> None:
    """As somebody who passes a cart, 0.6 m/s slower than it."""
    speeds = [(0.8, 0.0, 0.0), (0.2, 0.0, 0.0)]
    assert merged(PERSON, ARM, velocity=speeds, sigma=0.2, moving_s=0.99) == [(1, 0)]
    assert merged(PERSON, ARM, velocity=speeds, sigma=0.2, moving_s=1.0) == []
    # With about the same velocity it is still a part.
    alike = [(0.8, 0.0, 0.0), (0.41, 0.0, 0.0)]
    assert merged(PERSON, ARM, velocity=alike, sigma=0.2, moving_s=5.0) == [(1, 0)]


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


def test_pieces_that_overlap_by_half_in_the_image_are_one_even_if_large_and_deeper() -> None:
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


def test_pairs_to_merge_begin_with_the_closest() -> None:
    front, back = Body(0.0, z=3.6, width=0.6, depth=0.6, cells=900), Body(0.0, z=4.1)
    shank = Body(0.3, y=0.5, z=4.15, width=0.15, height=0.5, cells=60)
    assert merged(front, back, shank) == [(2, 1), (1, 0), (2, 0)]  # gaps of 0.03, 0.1 and 0.15 m
    # Both touch it: the one at whose depth it is.
    deep = Body(0.0, z=3.8, width=0.6, depth=0.8, cells=900)
    assert merged(deep, Body(0.1, z=4.1, width=0.4), shank)[0] == (2, 1)


REAR = Body(-0.6, z=3.0, width=1.0, height=1.2, depth=0.1, cells=900)
WHEEL = Body(0.6, y=0.3, z=3.2, width=0.4, height=0.6, depth=0.1, cells=480)  # 0.51 m from the rear


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


def test_somebody_taller_beside_a_low_vehicle_is_no_piece_of_it() -> None:
    low = replace(REAR, y=0.3, height=0.6)
    assert merged(low, replace(WHEEL, y=0.3, z=3.0, height=0.6), behind_m=0.0) == [(1, 0)]
    assert merged(low, replace(WHEEL, y=0.3, z=3.0, height=0.62), behind_m=0.0) == []


VAN = Body(-1.0, z=3.1, width=1.15, height=1.5, depth=0.4, cells=3300)
FAR_END = Body(-0.4, z=5.0, width=0.4, height=1.0, depth=0.1, cells=50)  # 24 px wide, 1.65 m behind its side


def test_far_end_of_a_vehicle_beside_its_near_side_belongs_to_it() -> None:
    """Its side is seen aslant, and beyond its end stereo matching gives some background the end's depth."""
    assert merged(VAN, FAR_END, behind_m=4.0) == [(1, 0)]  # the side, seen aslant
    assert merged(VAN, FAR_END, behind_m=0.0, sigma=0.5) == [(1, 0)]  # nothing; and its velocity hardly known
    assert merged(VAN, FAR_END, behind_m=6.0) == []  # the way behind is seen between them
    assert merged(VAN, replace(FAR_END, width=0.6), behind_m=4.0) == []  # 36 px
    assert merged(VAN, replace(FAR_END, cells=330), behind_m=4.0) == [(1, 0)]
    assert merged(VAN, replace(FAR_END, cells=331), behind_m=4.0) == []  # somebody who comes out behind it
    assert merged(VAN, replace(FAR_END, y=0.9), behind_m=4.0) == []  # lower than the vehicle reaches
    assert merged(VAN, replace(FAR_END, y=-0.9), behind_m=4.0) == []
    assert merged(VAN, replace(FAR_END, z=5.5), behind_m=4.0) == []  # 2.15 m behind
    near = replace(FAR_END, x=-0.2, z=1.9, width=0.1, height=0.4)
    assert merged(VAN, near, behind_m=0.0) == []  # in front of it
    assert merged(replace(VAN, x=-0.8, width=0.8), FAR_END, behind_m=4.0) == []  # as narrow as a person
    assert merged(VAN, FAR_END, velocity=[(0.8, 0.0, 0.0), (-0.8, 0.0, 0.0)], behind_m=4.0) == []
    assert merged(VAN, FAR_END, velocity=[(0.29, 0.0, 0.0)] * 2, behind_m=4.0) == []  # as slow as what stands


LOAD = Body(-0.8, width=1.0, height=1.2, cells=900)
CAB = Body(1.1, z=4.2, width=0.8, height=1.5, cells=800)  # 1.0 m from the load
NEARLY = [(0.8, 0.0, 0.0), (0.8, 0.0, 0.45)]


def test_halves_of_a_vehicle_on_both_sides_of_a_pillar_are_one() -> None:
    """First seen so, nothing but the pillar between them, and their velocities hardly known yet."""
    assert merged(LOAD, CAB, velocity=NEARLY, behind_m=2.0) == [(1, 0)]
    assert merged(LOAD, CAB, velocity=NEARLY, behind_m=4.1) == []  # no pillar: their own depth
    assert merged(LOAD, CAB, velocity=NEARLY, behind_m=0.0) == []
    assert merged(LOAD, CAB, velocity=NEARLY, behind_m=6.0) == []  # two vehicles
    assert merged(replace(LOAD, x=-0.7, width=0.8), CAB, velocity=NEARLY, behind_m=2.0) == []  # two people
    assert merged(LOAD, replace(CAB, x=1.35), velocity=NEARLY, behind_m=2.0) == [(1, 0)]
    assert merged(LOAD, replace(CAB, x=1.45), velocity=NEARLY, behind_m=2.0) == []  # 1.35 m
    assert merged(LOAD, replace(CAB, z=4.45), velocity=NEARLY, behind_m=2.0) == []
    assert merged(LOAD, replace(CAB, y=1.0), velocity=NEARLY, behind_m=2.0) == []  # hardly beside it
    towards = [(0.4, 0.0, 0.0), (0.3, 0.0, -0.3)]  # 0.32 m/s, of somebody who goes 0.42
    assert merged(LOAD, CAB, velocity=towards, sigma=0.2, behind_m=2.0) == []
    faster = [(1.2, 0.0, 0.0), (1.2, 0.0, 0.65)]
    assert merged(LOAD, CAB, velocity=faster, sigma=0.2, behind_m=2.0) == []
    assert merged(LOAD, CAB, velocity=[(0.8, 0.0, 0.0), (0.25, 0.0, 0.0)], sigma=0.2, behind_m=2.0) == []


def test_tracks_that_are_not_seen_take_no_part() -> None:
    assert merged(PERSON, Body(0.45, y=-0.3, width=0.3, height=0.3, cells=0)) == []
