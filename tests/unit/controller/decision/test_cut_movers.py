"""A mover that comes in over the edge of the view may extend nearer to the robot than what is seen of it."""

from __future__ import annotations

import math

import pytest

from controller.decision.bodies import Bodies
from controller.decision.cut_movers import hidden_m
from controller.decision.nearer_boxes import extended_nearer
from controller.decision.view_edges import view_from
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import box

MOUNT = CameraMount(0.5, 0.0, 0.6, 0.0)
VIEW = view_from(PlanarPose(0.0, 0.0, 0.0), MOUNT, edge_tan=0.7, near_m=1.3, up_tan=math.inf)
FRONT_M = 0.6


def extended(body: Bodies) -> Bodies:
    return extended_nearer(body, hidden_m(body, VIEW), VIEW, FRONT_M)


def near_side_m(body: Bodies) -> float:
    seen = extended(body)
    return float(seen.xy_m[0, 0] - seen.half_view_m[0])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_truck_whose_far_corner_is_seen_may_begin_a_metre_nearer(side: float) -> None:
    """The near corner of what is seen, 5 m ahead of the camera and 3.5 m aside, is on the view's edge."""
    truck = box(6.0, side * 4.0, 0.0, -side * 1.4, half_view_m=0.5, half_across_m=0.5)
    assert near_side_m(truck) == pytest.approx(4.5)
    far_side = extended(truck)
    assert float(far_side.xy_m[0, 0] + far_side.half_view_m[0]) == pytest.approx(6.5)


@pytest.mark.parametrize(
    ("y_m", "vx_mps", "vy_mps"),
    [
        (3.0, 0.0, -1.4),  # its near corner is in view
        (4.0, 0.0, 1.4),  # leaves the view
        (4.0, -1.4, -0.3),  # comes towards the robot in its lane
        (4.0, 0.0, 0.0),  # stands
    ],
)
def test_other_bodies_are_as_they_are_seen(y_m: float, vx_mps: float, vy_mps: float) -> None:
    assert near_side_m(box(6.0, y_m, vx_mps, vy_mps, half_view_m=0.5, half_across_m=0.5)) == 5.5


def test_it_does_not_reach_back_to_what_the_front_has_passed() -> None:
    """The conflict with a body that begins behind the robot's front is dropped: its front is past it."""
    person = box(1.6, 1.0, 0.0, -1.4, half_view_m=0.2, half_across_m=0.2)
    assert near_side_m(person) == pytest.approx(FRONT_M + 0.3)


def test_what_is_seen_nearer_than_that_stays_as_it_is_seen() -> None:
    person = box(1.0, 0.6, 0.0, -1.4, half_view_m=0.2, half_across_m=0.2)
    assert near_side_m(person) == pytest.approx(0.8)
