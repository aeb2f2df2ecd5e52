"""A picture moves on a screen, but its surface stays: no mover. A body that goes takes its surface along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray
from tests.support.detections import AT_ORIGIN
from tests.support.grids import grid_of, labelled, nearest, plate, wall
from tests.support.painted import QVGA, drive, floor, quad, record, vector
from tests.support.painted import wall as painted_wall
from tests.support.painted_room import SIDEWAYS, look
from vision.bodies.arrivals import ViewMemory
from vision.bodies.stays_put import stays_put
from vision.bodies.tracks import Tracks

CONFIG = PerceptionConfig()
NOW_NS = 2_000_000_000
ACROSS = (0.8, 0.0, 0.0)  # 0.48 m in 0.6 s


def screen(distance_m: float = 4.0, left_m: float = -0.5, wall_m: float = 0.1) -> FloatArray:
    """One metre wide, wall_m in front of a wall."""
    board = plate(distance_m, (left_m, left_m + 1.0), (-0.6, 0.6))
    return nearest(board, wall(distance_m + wall_m))


def stays(
    velocity_mps: tuple[float, float, float] = ACROSS,
    now_m: FloatArray | None = None,
    then_m: FloatArray | None = None,
    ago_s: float = 0.6,
    distance_m: float = 4.0,
    mask: NDArray[np.bool_] | None = None,
    evidence: float = 1.0,
) -> bool:
    """Whether the track on the plate at distance_m stays put, if then_m was seen ago_s ago."""
    here_m = screen(distance_m) if now_m is None else now_m
    memory, grid = ViewMemory(CONFIG.depth_noise), grid_of(here_m)
    memory.remember(grid_of(here_m if then_m is None else then_m), AT_ORIGIN, NOW_NS - int(ago_s * 1e9))
    tracks, labels = Tracks(), labelled(here_m == distance_m)
    tracks.start(np.array([[0.0, 0.0, distance_m]]), 0.2, 1.5, evidence, 0)
    tracks.state[0, 3:], tracks.extent_m[0] = velocity_mps, (1.0, 1.2, 0.1)
    above_floor = here_m > 0 if mask is None else mask
    return bool(stays_put(tracks, grid, above_floor, labels, memory, AT_ORIGIN, NOW_NS)[0])


def test_a_surface_that_is_where_it_was_stays_put_whatever_its_fragments_say() -> None:
    assert stays()
    assert not stays(then_m=wall(4.5))  # nothing was there
    assert not stays(then_m=screen(left_m=-0.98, wall_m=0.3))  # it has gone on
    assert stays(
        then_m=screen(left_m=-0.98, wall_m=0.2)
    )  # a panel that slides so close along a wall is not told
    assert not stays(ago_s=1.0)  # no view of that time
    assert not stays(evidence=0.0)  # nothing speaks for motion: not asked


def test_motion_must_have_taken_it_a_good_part_of_its_width_across_the_line_of_sight() -> None:
    assert stays((0.17, 0.0, 0.0))  # 0.102 m
    assert not stays((0.16, 0.0, 0.0))
    assert not stays((0.0, 0.0, -0.8))  # towards the camera


def test_only_where_depth_tells_a_body_from_the_wall_it_goes_along() -> None:
    # 0.1 m + 3.5 * 0.55 * sqrt(2) * 0.0075 z^2 is 0.8 m at 5.86 m.
    assert stays(distance_m=5.8)
    assert not stays(distance_m=5.9)


@pytest.mark.parametrize(
    ("speed_mps", "gone_m", "ago_s", "put"),
    [
        (0.8, 0.08, 0.6, True),  # 0.93 of it has stayed
        (0.8, 0.12, 0.6, False),  # 0.88
        (0.3, 0.08, 0.6, True),  # half of 0.18 m of way are 0.09
        (0.3, 0.08, 0.4, False),  # of 0.12 m 0.06
        (0.2, 0.04, 0.6, True),  # 0.99
        (0.2, 0.08, 0.6, False),
    ],
)
def test_nearly_all_of_it_must_have_stayed(speed_mps: float, gone_m: float, ago_s: float, put: bool) -> None:
    then_m = nearest(plate(4.0, (-0.5 + gone_m, 0.5), (-0.6, 0.6)), wall(6.0))
    assert stays((speed_mps, 0.0, 0.0), then_m=then_m, ago_s=ago_s) == put


def test_floor_below_a_mover_does_not_count_as_its_surface() -> None:
    screen_m = screen()
    above_floor = screen_m > 0
    assert stays(mask=above_floor)
    above_floor[30:] = False
    assert not stays(mask=above_floor)


def test_what_is_not_seen_does_not_stay_either() -> None:
    assert not stays(distance_m=4.0, now_m=wall(5.0))


@pytest.mark.parametrize("odometry", [True, False])
def test_a_picture_that_runs_over_a_wall_is_no_mover_and_a_board_before_it_is(odometry: bool) -> None:
    def movers(before_wall_m: float) -> int:
        board = quad(vector(4.0 - before_wall_m, 1.3, 1.3), vector(0, -0.6, 0), vector(0, 0, -0.6), 7, 0.1)
        world = [*floor(), *painted_wall(4.0), replace(board, velocity_mps=SIDEWAYS)]
        percepts = look(record(world, drive(0.3, 0.0), 45, QVGA), odometry)
        return sum(one.moving for percept in percepts[25:] for one in percept.scene.obstacles)

    assert (movers(0.002), movers(0.5)) == (0, 20)
