"""Where the rest of a body is expected that somebody nearer divides in the image."""

from __future__ import annotations

import numpy as np

from tests.support.grids import grid_of, nearest, plate
from tests.support.parts import Body, regions
from vision.bodies.grouping import ExpectedBodies, attach, detach, expected_in

NOWHERE = np.zeros((2, 1), np.bool_)  # no track is expected in either part


def test_a_part_in_which_its_mover_is_expected_stays_or_comes_however_far() -> None:
    parts = regions(Body(0.0), Body(0.9, cells=50))
    there = np.array([[False], [True]])
    winner, votes = np.array([1, 1], np.int32), np.array([90, 40])
    np.testing.assert_array_equal(detach(winner, parts, votes, there), [1, 1])
    np.testing.assert_array_equal(detach(winner, parts, votes, NOWHERE), [1, 0])
    new, mover = np.array([1, 0], np.int32), np.array([True])
    np.testing.assert_array_equal(attach(np.array([1]), parts, new, mover, there), [1, 1])
    np.testing.assert_array_equal(attach(np.array([1]), parts, new, mover, NOWHERE), [1, 0])


def behind(
    middle_m: float | None,
    part_x: float = 0.6,
    part_z: float = 4.0,
    width_m: float = 1.2,
    moves: bool = True,
) -> bool:
    """Whether a part at part_x is expected to be of a body width_m wide, 4 m away, that is seen from -0.6 to
    -0.2 m, with somebody 2 m away in front of its middle or nobody."""
    left, right = Body(-0.4), Body(part_x, z=part_z, width=0.2, cells=50)
    visible = [plate(b.z, (b.x - b.width / 2, b.x + b.width / 2), (-0.8, 0.8)) for b in (left, right)]
    if middle_m is not None:
        visible.append(plate(2.0, (middle_m - 0.1, middle_m + 0.1), (-0.8, 0.8)))
    body = ExpectedBodies(
        np.array([[-0.4, 0.0, 4.0]]),
        np.array([[0.4, 1.6, 0.2]]),
        np.array([[-width_m / 2, -0.8, width_m / 2, 0.8]]),
        np.array([0.1]),
    )
    winner, votes = np.array([1, 0], np.int32), np.array([90, 0])
    grid, mover = grid_of(nearest(*visible)), np.array([moves])
    expected = expected_in(grid, regions(left, right), winner, votes, body, mover)
    return bool(expected[1, 0])


def test_a_body_is_expected_on_the_other_side_of_what_hides_its_middle() -> None:
    assert behind(0.0)
    assert not behind(None)  # nothing divides the two: they are two
    assert not behind(
        0.0, width_m=0.8
    )  # there is no room for it: 0.6 + 0.25 m from the middle of what is seen
    assert not behind(0.0, part_z=4.5)  # nor is that at its depth
    assert not behind(0.0, moves=False)
