"""Bodies as arrays: which points they cover, selected and joined."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from controller.decision.bodies import no_bodies
from tests.support.floor_bodies import box


def test_body_covers_points_within_its_box_and_the_reach() -> None:
    body = replace(box(2.0, 6.0, half_view_m=0.25, half_across_m=0.3), view_rad=np.array([math.pi / 2]))
    points = np.array([[2.0, 6.0], [2.35, 6.0], [2.45, 6.0], [2.0, 5.6], [2.0, 5.5]])
    reach = np.full(len(points), 0.2)
    assert body.covers(points, reach, side_m=0.1)[:, 0].tolist() == [True, True, False, True, False]


def test_selected_bodies_keep_their_order_and_joined_ones_follow() -> None:
    bodies = box(1.0, 0.0, number=1).joined(box(2.0, 0.0, number=2)).joined(box(3.0, 0.0, number=3))
    some = bodies.select(np.array([True, False, True]))
    assert some.ids.tolist() == [1, 3]
    assert some.joined(bodies.select(np.array([False, True, False]))).ids.tolist() == [1, 3, 2]
    nobody = replace(bodies, captured_ns=7).select(np.zeros(3, np.bool_))
    assert (len(nobody), nobody.captured_ns) == (0, 7)
    assert nobody.joined(some).ids.tolist() == [1, 3]
    assert nobody.joined(some).captured_ns == 7
    assert len(no_bodies(3)) == 0
