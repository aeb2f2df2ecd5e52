"""Parts to bodies: what is attached and detached (where the rest of somebody hidden is expected:
test_expected.py; which tracks are one: test_merging.py; what is divided: test_division.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.support.parts import ARM, CART, FAR_WHEEL, MAST, PERSON, Body, regions
from vision.bodies.grouping import attach, detach

NOWHERE = np.zeros((4, 2), np.bool_)  # no track is expected in any of four parts


def test_a_part_seen_through_a_mover_stays_with_it_if_most_of_it_was_there_before() -> None:
    winner, nowhere = np.array([1, 1], np.int32), NOWHERE[:2, :1]
    for wheel, votes, stays in (
        (FAR_WHEEL, 28, 1),
        (FAR_WHEEL, 27, 0),
        (replace(FAR_WHEEL, x=0.8), 40, 0),
        (replace(FAR_WHEEL, z=2.9, y=0.6), 40, 0),
    ):
        parts = regions(CART, wheel)
        np.testing.assert_array_equal(detach(winner, parts, np.array([800, votes]), nowhere), [1, stays])


def test_part_stays_with_its_mover_while_most_of_it_was_there_before() -> None:
    parts, winner = regions(CART, MAST), np.array([1, 1], np.int32)
    nowhere = NOWHERE[:2, :1]
    np.testing.assert_array_equal(detach(winner, parts, np.array([800, 70]), nowhere), [1, 1])
    np.testing.assert_array_equal(detach(winner, parts, np.array([800, 69]), nowhere), [1, 0])
    above = regions(CART, replace(MAST, y=-0.4))
    np.testing.assert_array_equal(detach(winner, above, np.array([800, 100]), nowhere), [1, 0])


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
