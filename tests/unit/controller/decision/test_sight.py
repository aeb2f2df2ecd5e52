"""Surfaces in the corridor that nobody tracks, also after they have left the view."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig
from controller.decision.bodies import no_bodies
from controller.decision.corridor import Corridor
from controller.decision.sight import Sight
from controller.decision.surfaces import surfaces_of
from hal.types import PlanarPose
from tests.support.floor_bodies import box, line_path
from tests.support.sight_watch import BEARING, BODY, FRAME_NS, MOUNT, Watch, free


def test_a_plain_wall_stands_in_the_corridor() -> None:
    """Seen 5 m ahead of a camera 0.4 m ahead of the turning centre."""
    sight = Watch().look(free(nearest_m=5.0), times=5)
    assert sight.surface_s_m == pytest.approx(5.4)


def test_a_surface_beside_the_corridor_does_not_count() -> None:
    """Corridor 0.4 m and margin 0.15 m to either side: at 3 m that is a bearing of 0.183."""
    beside = np.where(np.abs(BEARING) > 0.21, 3.0, math.inf)
    assert Watch().look(free(beside), times=5).surface_s_m == math.inf
    inside = np.where(np.abs(BEARING) > 0.17, 3.0, math.inf)
    sight = Watch().look(free(inside), times=5)
    assert sight.surface_s_m == pytest.approx(3.4)
    assert sight.surface_clearance_m == pytest.approx(0.1, abs=0.04)
    assert Watch().look(free(nearest_m=3.0), times=5).surface_clearance_m < 0.0


def test_a_surface_beside_or_behind_the_robot_does_not_count() -> None:
    """Seen 0.3 and 0.6 m ahead of a camera 0.5 m behind the turning centre."""
    mount = replace(MOUNT, forward_m=-0.5)
    found = []
    for nearest_m in (0.3, 0.6):
        sight, seen = Sight(Corridor(line_path(), BODY), mount, DecisionConfig(), 0.0), free(nearest_m)
        at = PlanarPose(0.0, 0.0, 0.0)
        for frame in range(5):
            sight.look(seen, surfaces_of(seen, at, mount), at, 0.0, frame * FRAME_NS, no_bodies(0), False)
        found.append(sight.surface_s_m)
    assert found == [math.inf, pytest.approx(0.1)]


def test_one_frame_does_not_brake_and_three_do() -> None:
    watch = Watch()
    watch.look(free(), times=5)
    assert watch.look(free(nearest_m=2.0)).surface_s_m == math.inf
    assert watch.look(free(nearest_m=2.0)).surface_s_m == math.inf
    assert watch.look(free(nearest_m=2.0)).surface_s_m == pytest.approx(2.4)


def test_surface_of_a_tracked_obstacle_is_not_counted_twice() -> None:
    person = np.where(np.abs(BEARING) < 0.1, 4.0, math.inf)
    assert Watch().look(free(person), times=5, explained=box(4.6, 0.0)).surface_s_m == math.inf
    assert Watch().look(free(person), times=5, explained=box(6.5, 0.0)).surface_s_m == pytest.approx(4.4)


@pytest.mark.parametrize(
    ("vx_mps", "top_m", "corner"),
    [(0.0, 1.7, True), (0.0, 0.6, True), (0.0, 0.15, False), (-1.0, 1.7, False)],
)
def test_only_what_stands_and_is_high_hides_whoever_steps_out_behind_it(
    vx_mps: float, top_m: float, corner: bool
) -> None:
    """A face from 1.8 to 3.8 m ahead, 0.4 m beside the swept width: a rack, pallets, or people in a row."""
    with np.errstate(divide="ignore"):
        at = -0.8 / BEARING
    face = np.where((at > 1.4) & (at < 3.4), at, math.inf)
    row = box(2.8, 0.9, vx_mps, half_view_m=1.0, half_across_m=0.2, top_m=top_m)
    sight = Watch().look(free(nearest_m=face), times=5, explained=row)
    assert (sight.corners.nearest(0.5) is not None) == corner


def test_a_surface_that_sinks_below_the_view_while_driving_is_still_there() -> None:
    watch = Watch()
    watch.look(free(nearest_m=1.2), s_m=3.0, times=5)
    assert watch.look(free(), s_m=3.2, times=5).surface_s_m == pytest.approx(4.6)
    # It is forgotten once it has been passed.
    assert watch.look(free(), s_m=4.7, times=5).surface_s_m == math.inf


def test_a_long_wall_within_the_margin_that_leaves_the_view_beside_it_is_still_there() -> None:
    """A wall from 3 m on, 0.1 m beside the swept width: its nearest visible point stays 0.83 m ahead."""
    watch = Watch()
    for step in range(60):
        s_m = 1.2 + 0.02 * step
        with np.errstate(divide="ignore"):
            ahead = 0.5 / BEARING
        wall = np.where((BEARING > 0.0) & (ahead > 2.6 - s_m), ahead, math.inf)
        watch.look(free(wall), s_m=s_m)
    assert watch.sight.surface_s_m == pytest.approx(3.0, abs=0.2)
    # Nor does it go because the robot comes to rest beside it.
    assert watch.look(free(wall), s_m=s_m, standing=True).surface_s_m == pytest.approx(3.0, abs=0.2)


def to_rest_before_a_sill() -> Watch:
    """A sill across the way, 3.4 m from the start: below the view from 0.9 m before the camera on."""
    watch = Watch()
    for step in range(130):
        ahead_m = 3.0 - 0.02 * step
        watch.look(free(ahead_m if ahead_m > 0.9 else math.inf), s_m=0.02 * step)
    return watch


def test_a_sill_that_sank_below_the_view_is_still_there_when_the_robot_stands() -> None:
    watch = to_rest_before_a_sill()
    assert watch.sight.surface_s_m == pytest.approx(3.4)
    assert watch.look(free(), s_m=2.6, times=100, standing=True).surface_s_m == pytest.approx(3.4)
    # Behind it something comes into the way and goes: the sill has not gone with it.
    watch.look(free(2.0), s_m=2.6, times=10, standing=True)
    assert watch.look(free(), s_m=2.6, times=100, standing=True).surface_s_m == pytest.approx(3.4)


def test_a_held_surface_that_is_seen_while_the_robot_stands_and_then_goes_has_gone() -> None:
    watch = to_rest_before_a_sill()
    seen = watch.look(free(0.4), s_m=2.6, times=5, standing=True)
    assert seen.surface_s_m == pytest.approx(3.4)
    assert watch.look(free(), s_m=2.6, times=5, standing=True).surface_s_m == math.inf


def test_a_sill_is_forgotten_once_the_robot_is_past_it() -> None:
    assert to_rest_before_a_sill().look(free(), s_m=3.5).surface_s_m == math.inf


def test_a_surface_that_goes_while_the_robot_stands_has_gone() -> None:
    watch = Watch()
    watch.look(free(nearest_m=1.2), s_m=3.0, times=5, standing=True)
    assert watch.look(free(), s_m=3.0, times=5, standing=True).surface_s_m == math.inf


def test_a_surface_that_sinks_below_the_view_of_a_high_camera_is_still_there() -> None:
    for floor_from_m, held in ((0.0, False), (1.9, True), (5.0, True)):
        watch = Watch()
        near = replace(free(1.6, 1.6), floor_from_m=floor_from_m)  # farther than 1.3 m
        assert watch.look(near, s_m=1.0, times=5).surface_s_m == pytest.approx(3.0, abs=0.1)
        after = watch.look(replace(free(), floor_from_m=floor_from_m), s_m=1.3, times=5)
        assert (after.surface_s_m < 4.0) == held


def test_a_surface_that_rises_above_the_view_of_a_low_camera_is_still_there() -> None:
    """The robot is 2.2 m high, its camera 0.6 m: 4 m ahead the view ends at its height, and 3 m at most
    where it does not rise at all."""
    for up_tan, ahead_m, held in (
        (math.inf, 1.6, False),
        (0.4, 3.8, True),
        (0.4, 4.3, False),
        (0.0, 2.9, True),
        (0.0, 3.3, False),
    ):
        tall = BODY.model_copy(update={"height_m": 2.2})
        watch = Watch()
        watch.sight = Sight(Corridor(line_path(), tall), MOUNT, DecisionConfig(), 0.0)
        near = replace(free(ahead_m, ahead_m), up_tan=up_tan)
        lost_s_m = 1.0 + 0.4 + ahead_m
        assert watch.look(near, s_m=1.0, times=5).surface_s_m == pytest.approx(lost_s_m, abs=0.1)
        after = watch.look(replace(free(), up_tan=up_tan), s_m=1.05, times=5)
        assert (after.surface_s_m < 6.0) == held


def test_flickering_far_surface_is_not_held_by_the_upper_edge_of_the_view() -> None:
    watch = Watch()
    assert watch.look(replace(free(5.0, 5.0), up_tan=-0.1), times=5).surface_s_m == pytest.approx(
        5.4, abs=0.1
    )
    assert math.isinf(watch.look(replace(free(), up_tan=-0.1), times=5).surface_s_m)
