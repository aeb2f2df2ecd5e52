"""Where things have just stood: all that was seen there, but for what belonged to a mover."""

from __future__ import annotations

import numpy as np

from controller.decision.known_places import _standing_places
from tests.support.floor_bodies import box

CRATE = box(4.0, 1.0, number=1)
# 0.4 m deep and 0.5 m wide; what is within 0.25 m around it is a part of it.
WALKER = box(3.0, 0.0, 0.0, 1.0, number=2)


def test_places_are_surfaces_and_bodies_that_stand() -> None:
    surfaces = np.array([[2.0, 2.0], [5.0, -1.0]])
    assert _standing_places(surfaces, CRATE).tolist() == [[2.0, 2.0], [5.0, -1.0], [4.0, 1.0]]


def test_what_is_seen_of_a_mover_or_right_beside_him_is_no_place() -> None:
    inside, beside, aside = [2.9, 0.2], [3.44, 0.0], [3.0, 0.51]
    surfaces = np.array([inside, beside, aside])
    assert _standing_places(surfaces, WALKER).tolist() == [aside]
    assert _standing_places(surfaces, WALKER.joined(CRATE)).tolist() == [aside, [4.0, 1.0]]


def test_a_body_that_stands_right_beside_a_mover_is_no_place() -> None:
    arm = box(3.0, 0.3, number=3)
    assert _standing_places(np.zeros((0, 2)), arm.joined(WALKER)).tolist() == []
