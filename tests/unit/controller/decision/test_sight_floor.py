"""How far the floor of the corridor is known to be free."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig, SightConfig
from controller.decision.bodies import no_bodies
from controller.decision.corridor import Corridor
from controller.decision.sight import Sight
from controller.decision.surfaces import NO_SURFACES, surfaces_of
from tests.support.floor_bodies import arc_path
from tests.support.sight_watch import BEARING, BODY, FRAME_NS, MOUNT, Watch, free
from vision.scene import FreeSpace


def test_floor_is_known_as_far_as_it_was_seen() -> None:
    sight = Watch().look(free(known_m=6.0))
    # 6.4 m ahead of the turning centre; cells of 0.2 m count when all of them was seen.
    assert sight.known_s_m == pytest.approx(6.4, abs=0.21)
    assert sight.known_s_m <= 6.4 + 1e-9


def test_glass_ahead_leaves_only_what_the_robot_stands_before() -> None:
    sight = Watch().look(free(known_m=0.0), times=5)
    assert sight.known_s_m <= MOUNT.forward_m + 1.3 + 0.4


def test_floor_stays_known_for_a_while_when_depth_drops_out() -> None:
    watch = Watch()
    watch.look(free(known_m=8.0))
    assert watch.look(free(known_m=2.0), times=20).known_s_m > 8.0
    assert watch.look(free(known_m=2.0), times=20).known_s_m < 2.5


def test_memory_of_floor_can_be_switched_off() -> None:
    watch = Watch(DecisionConfig(sight=SightConfig(memory_s=0.0)))
    watch.look(free(known_m=8.0))
    assert watch.look(free(known_m=4.0)).known_s_m <= 4.4


def test_a_narrow_gap_in_depth_does_not_make_the_floor_unknown() -> None:
    """A fifth of the width unseen is tolerated (known_share 0.6), half of it is not."""
    thin = np.where(np.abs(BEARING) < 0.015, 0.0, 10.0)
    assert Watch().look(free(known_m=thin)).known_s_m > 9.0
    half = np.where(BEARING < 0.03, 0.0, 10.0)
    assert Watch().look(free(known_m=half)).known_s_m < 3.0


def test_behind_a_surface_in_the_corridor_the_surface_itself_is_the_limit() -> None:
    leader = np.where(np.abs(BEARING) < 0.2, 4.0, math.inf)
    known = np.where(np.abs(BEARING) < 0.2, 4.0, 10.0)
    assert Watch().look(free(leader, known)).known_s_m > 9.0


def test_behind_a_corner_beside_the_path_the_floor_is_unknown() -> None:
    """A left turn of 8 m radius; 3 m ahead a shelf stands on its inner side, outside the corridor."""
    path = arc_path(8.0, 70.0)
    sight = Sight(Corridor(path, BODY), MOUNT, DecisionConfig(), 0.0)
    shelf = np.where(BEARING < -0.5, 3.0, math.inf)
    blocked = np.where(BEARING < -0.5, 3.0, 10.0)
    seen = free(shelf, blocked)
    sight.look(seen, surfaces_of(seen, path.start, MOUNT), path.start, 0.0, FRAME_NS, no_bodies(0), False)
    hidden = sight.known_s_m
    sight = Sight(Corridor(path, BODY), MOUNT, DecisionConfig(), 0.0)
    sight.look(free(), NO_SURFACES, path.start, 0.0, FRAME_NS, no_bodies(0), False)
    assert hidden < sight.known_s_m - 0.3


def test_unknown_numbers_are_not_free() -> None:
    sight = Watch().look(free(math.nan, math.nan), times=5)
    assert sight.known_s_m < 2.2


def test_no_bands_at_all_are_not_free() -> None:
    empty = FreeSpace(np.zeros(0), 0.01, np.zeros(0), np.zeros(0))
    assert Watch().look(empty, times=5).known_s_m < 2.2


def test_floor_too_near_to_be_measured_was_not_seen_by_seeing_beyond_it() -> None:
    """Nor does it become so once the robot stands before it: what was a hole from afar is not free now."""
    beyond = replace(free(), blind_m=0.6)
    assert Watch().look(beyond, s_m=8.0, times=5).known_s_m < 8.0 + 0.4 + 0.6
    watch = Watch()
    for s_m in np.arange(0.0, 8.0, 0.1):
        watch.look(beyond, s_m=float(s_m))
    # Seen from farther away, it stays known.
    assert watch.look(beyond, s_m=8.0).known_s_m > 15.0


def test_floor_below_the_view_is_assumed_free_only_at_the_start() -> None:
    """1.9 m ahead of it the floor comes into view, and not 1.3 m."""
    high, blind = replace(free(), floor_from_m=1.9), replace(free(known_m=0.0), floor_from_m=1.9)
    assert Watch().look(replace(blind, floor_from_m=1.0)).known_s_m == pytest.approx(0.4 + 1.3 + 0.2, abs=0.2)
    watch = Watch()
    assert watch.look(blind, times=5).known_s_m == pytest.approx(0.4 + 1.9 + 0.2, abs=0.2)
    watch.look(high)
    # Seen free once, it stays so while it is too near to be seen again; what never was does not.
    assert watch.look(blind, s_m=1.0, times=60).known_s_m == pytest.approx(1.0 + 0.4 + 1.9 + 0.2, abs=0.2)
    assert Watch().look(blind, s_m=3.0).known_s_m < 3.1


def test_no_camera_is_so_high_that_much_of_the_way_is_free_unseen() -> None:
    """Though the scan reaches far beyond what is below the view."""
    assert Watch().look(replace(free(), floor_from_m=6.0)).known_s_m < 0.4 + 2.5 + 0.5
    for near_m in (1.2, 1.4, 2.4):
        assert Watch().look(replace(free(), floor_from_m=near_m)).known_s_m > 9.0
    watch = Watch()
    for s_m in np.arange(0.0, 8.0, 0.1):
        watch.look(replace(free(), floor_from_m=2.7), s_m=float(s_m))
    # What was seen from farther away a moment ago is known.
    assert watch.look(replace(free(), floor_from_m=2.7), s_m=8.0).known_s_m > 15.0
