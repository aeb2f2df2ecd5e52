"""Surfaces that may be a part of something that moves are not held once they are out of view."""

from __future__ import annotations

import math

import pytest

from tests.support.floor_bodies import box
from tests.support.sight_watch import Watch, free


def before_a_truck(half_across_m: float) -> Watch:
    """Its flank, 1.6 m ahead of the camera, is first on no body and then on one of this width; it drives off
    while the robot still rolls."""
    watch = Watch()
    for step in range(45):
        s_m = 2.0 + 0.01 * step
        flank = box(4.2, 0.0, vy_mps=1.5, half_across_m=half_across_m) if step >= 30 else None
        watch.look(free(4.0 - s_m - 0.4 if step < 40 else math.inf), s_m=s_m, explained=flank)
    return watch


def test_a_flank_that_belongs_to_a_body_when_it_leaves_is_not_held() -> None:
    watch = before_a_truck(half_across_m=0.8)
    assert watch.look(free(), s_m=2.45, times=30, standing=True).surface_s_m == math.inf


def test_a_body_that_covers_only_a_part_of_a_surface_does_not_explain_it() -> None:
    """Somebody walks by before a sill that sinks below the view."""
    watch = before_a_truck(half_across_m=0.1)
    assert watch.look(free(), s_m=2.45, times=30, standing=True).surface_s_m == pytest.approx(4.0, abs=0.05)


def past_somebody(beside_m: float) -> Watch:
    """A surface 1.6 m ahead of the camera sinks below the view; somebody walks past beside it."""
    watch = Watch()
    for step in range(45):
        s_m = 2.0 + 0.01 * step
        walker = box(4.2, beside_m, vx_mps=1.0, half_across_m=0.2)
        watch.look(free(4.0 - s_m - 0.4 if step < 40 else math.inf), s_m=s_m, explained=walker)
    return watch


@pytest.mark.parametrize(("beside_m", "held"), [(1.2, False), (2.2, True)])
def test_a_surface_beside_somebody_who_walks_may_be_a_part_of_him(beside_m: float, held: bool) -> None:
    seen_m = past_somebody(beside_m).look(free(), s_m=2.45, times=30, standing=True).surface_s_m
    assert seen_m == (pytest.approx(4.0, abs=0.05) if held else math.inf)
