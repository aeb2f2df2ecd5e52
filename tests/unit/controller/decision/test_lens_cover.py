"""Somebody right before the lens: noticed by what is not seen there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.decision.lens_cover import LensCover
from vision.scene import FreeSpace

BEARING = np.linspace(-0.6, 0.6, 61)
HALF_M = 0.4


def free(known_m: float = 10.0, nearest_m: float = math.inf) -> FreeSpace:
    return FreeSpace(BEARING, 0.01, np.full(61, nearest_m), np.full(61, known_m))


def without(middle_tan: float, half_tan: float) -> FreeSpace:
    """Nothing at all is measured in some of the bands."""
    blank = np.abs(BEARING - middle_tan) <= half_tan
    return replace(free(), known_m=np.where(blank, 0.0, 10.0), blank=blank)


def covered_by(seen: FreeSpace, half_m: float = HALF_M, left_m: float = 0.0, before: bool = True) -> bool:
    lens = LensCover()
    for scene in [free()] * (5 if before else 0) + [seen] * 3:
        lens.look(scene, half_m, left_m)
    return lens.covered


@pytest.mark.parametrize(
    ("seen", "covered"),
    [
        (free(), False),
        (free(nearest_m=0.4, known_m=0.4), False),
        (without(0.0, 1.0), True),
        # 0.1 m in one piece, 0.3 m ahead: 18 degrees.
        (without(0.0, 0.165), True),
        (without(0.6, 0.345), True),
        (without(0.0, 0.155), False),
        (FreeSpace(np.zeros(0), 0.01, np.zeros(0), np.zeros(0)), True),
    ],
)
def test_a_part_of_the_way_that_shows_nothing_any_more_is_covered(seen: FreeSpace, covered: bool) -> None:
    assert covered_by(seen) == covered


def test_one_frame_does_not_brake_and_three_do() -> None:
    lens = LensCover()
    for seen, covered in (
        [(free(), False)] * 5 + [(without(0.0, 1.0), False)] * 2 + [(without(0.0, 1.0), True)]
    ):
        lens.look(seen, HALF_M, 0.0)
        assert lens.covered == covered
    for covered in (True, True, False):
        lens.look(free(), HALF_M, 0.0)
        assert lens.covered == covered


def test_holes_here_and_there_hide_nobody() -> None:
    scattered = np.arange(61) % 8 < 4
    assert not covered_by(replace(free(), known_m=np.where(scattered, 0.0, 10.0), blank=scattered))


def test_floor_that_gives_no_depth_is_no_cover_where_something_is_seen_above_it() -> None:
    """A mat or a puddle: nothing is known of the way there, but something is measured beyond."""
    mat = replace(free(known_m=0.0), blank=np.zeros(61, np.bool_))
    assert not covered_by(mat)
    # Whoever does not tell of that tells what the scan shows.
    assert covered_by(free(known_m=0.0))


def test_the_sides_of_an_image_that_is_wider_than_depth_hide_nobody() -> None:
    sides = np.abs(BEARING) > 0.4
    narrow = replace(free(), known_m=np.where(sides, 0.0, 10.0), blank=sides)
    assert not covered_by(narrow, before=False)
    # Who stands there from the beginning is noticed where most of the view shows nothing.
    assert covered_by(without(0.0, 0.35), before=False)
    assert not covered_by(without(0.0, 0.25), before=False)


@pytest.mark.parametrize(("half_m", "covered"), [(0.15, False), (0.2, True)])
def test_beside_a_narrow_way_nobody_is_hidden(half_m: float, covered: bool) -> None:
    """Of a robot 0.3 m wide, and on the wider way that it sweeps in a bend: 0.08 to 0.19 m aside."""
    assert covered_by(without(0.45, 0.17), half_m=half_m) == covered


@pytest.mark.parametrize(("left_m", "covered"), [(0.3, True), (-0.3, False)])
def test_the_camera_may_sit_to_one_side(left_m: float, covered: bool) -> None:
    """From 0.3 m left of the middle, the way lies from 0.1 m to the left to 0.7 m to the right."""
    assert covered_by(without(0.42, 0.185), half_m=0.4, left_m=left_m) == covered


@pytest.mark.parametrize(("scale", "covered"), [(2.0, False), (1.001, True)])
def test_lens_cover_judges_each_band_by_its_own_past(scale: float, covered: bool) -> None:
    """Bands elsewhere, as many as before; a camera that is levelled a little otherwise has the same ones."""
    bearing = scale * BEARING
    blank = np.abs(bearing) <= 0.2
    seen = FreeSpace(bearing, scale * 0.01, np.full(61, math.inf), np.where(blank, 0.0, 10.0), blank=blank)
    assert covered_by(seen) == covered
