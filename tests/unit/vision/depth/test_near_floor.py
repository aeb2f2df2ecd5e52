"""A camera whose lowest rows see floor that is too near to be measured: what is known ahead of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.geometry import camera_in_floor
from hal.types import CameraMount, FloatArray, PlanarPose, RgbdFrame
from tests.support.painted import FRAME_NS, VGA, Quad, floor, paint, plain, record, vector
from vision.depth.depth_grid import make_grid
from vision.depth.near_floor import NearFloor
from vision.perception import Perception
from vision.scene import FreeSpace

LOW = CameraMount(0.45, 0.0, 0.15, 0.0)  # its lowest row meets the floor at 0.15 / 239.5 * 610 = 0.38 m
CENTRE = slice(220, 420)  # image columns that are tampered with
CONFIG = PerceptionConfig()


@cache
def seen_by(mount: CameraMount, *quads: Quad) -> RgbdFrame:
    here = camera_in_floor(PlanarPose(0.0, 0.0, 0.0), mount)
    return paint([replace(one, texture=plain()) for one in quads or floor()], here, VGA)


def measured_from(least_m: float, frame: RgbdFrame | None = None) -> RgbdFrame:
    """By a camera with that least depth; the floor, if nothing else."""
    one = frame or seen_by(LOW)
    return replace(one, depth=np.where(one.depth < 1000.0 * least_m, 0, one.depth).astype(np.uint16))


def without(frame: RgbdFrame, near_m: float, far_m: float) -> RgbdFrame:
    """No depth of the floor between, in the middle of the view."""
    depth = frame.depth.copy()
    far, near = (round(VGA.cy + VGA.fy * LOW.height_m / z) for z in (far_m, near_m))
    depth[far:near, CENTRE] = 0
    return replace(frame, depth=depth)


def spaces(*frames: RgbdFrame) -> list[FreeSpace]:
    eyes = Perception(CONFIG, LOW, body_height_m=0.8, clearance_m=0.05)
    timed = [replace(one, captured_ns=(k + 1) * FRAME_NS) for k, one in enumerate(frames)]
    return [eyes.perceive(one, None, None).scene.free_space for one in timed]


def ahead(space: FreeSpace) -> FloatArray:
    """What is known in the middle of the view."""
    middle: NDArray[np.bool_] = np.abs(space.bearing_tan) < 0.14
    return space.known_m[middle]


@pytest.mark.parametrize("least_m", [0.25, 0.42, 0.52])
def test_floor_too_near_to_be_measured_hides_nothing_of_what_is_ahead(least_m: float) -> None:
    for space in spaces(*[measured_from(least_m)] * 3):
        assert (space.known_m > 7.0).all()


def test_and_a_camera_in_motion_behind_real_noise_neither() -> None:
    eyes = Perception(CONFIG, LOW, body_height_m=0.8, clearance_m=0.05)
    take = record(floor(), lambda t: PlanarPose(0.3 * t, 0.0, 0.0), 12, mount=LOW, depth_sigma_per_m=0.004)
    for frame in take.frames:
        space = eyes.perceive(measured_from(0.45, frame), None, None).scene.free_space
        assert np.median(space.known_m) > 4.0
        assert np.count_nonzero(space.known_m == 0.0) <= 2


def test_a_camera_that_says_its_least_depth_is_believed() -> None:
    far_sighted = PerceptionConfig(min_depth_m=0.8)
    eyes = Perception(far_sighted, LOW, body_height_m=0.8, clearance_m=0.05)
    assert (eyes.perceive(seen_by(LOW), None, None).scene.free_space.known_m > 7.0).all()


def test_no_data_farther_away_than_any_least_depth_is_a_hole() -> None:
    (space,) = spaces(measured_from(0.9))
    np.testing.assert_array_equal(space.known_m, 0.0)


def test_a_hole_that_begins_where_the_camera_measures_is_one() -> None:
    (space,) = spaces(without(measured_from(0.45), 0.3, 0.8))
    np.testing.assert_array_equal(ahead(space), 0.0)
    assert (space.known_m[np.abs(space.bearing_tan) > 0.4] > 7.0).all()


def test_missing_near_floor_that_was_seen_before_is_a_hole() -> None:
    whole = seen_by(LOW)
    for gone in (without(whole, 0.3, 0.5), measured_from(0.5)):
        space = spaces(*[whole] * 5, gone)[-1]
        np.testing.assert_array_equal(ahead(space), 0.0)


def test_a_drop_close_ahead_is_a_hole() -> None:
    """The floor begins 0.2 m lower 0.4 m before the camera: that is measured, only not where it should."""
    lower = replace(floor()[0], corner_m=vector(-2.0, 6.0, -0.2))
    space = spaces(measured_from(0.45, seen_by(LOW, lower)))[0]
    np.testing.assert_array_equal(space.known_m, 0.0)


def test_a_bump_teaches_no_least_depth() -> None:
    """For some frames the camera looks up, and its lowest rows see floor that is far enough."""
    learner = NearFloor(CONFIG.min_depth_m)

    def told(frame: RgbdFrame, times: int, trusted: bool = True) -> float:
        grid = make_grid(frame, CONFIG, LOW)
        return [learner.measurable_from_m(grid, trusted) for _ in range(times)][-1]

    level, up = measured_from(0.45), measured_from(0.39)
    at_first = told(level, 100)
    assert 0.45 < at_first < 0.55
    assert told(up, 6) == at_first
    assert told(level, 1) == at_first
    # What is not to be trusted teaches nothing, however long.
    assert told(measured_from(0.1), 200, trusted=False) == at_first
    # A camera that does see so near is known to in the end.
    assert told(measured_from(0.1), 200) == 0.0


def test_near_floor_is_measurable_if_the_lowest_row_shows_floor() -> None:
    learner = NearFloor(CONFIG.min_depth_m)
    assert learner.measurable_from_m(make_grid(seen_by(LOW), CONFIG, LOW), True) == 0.0
    high = CameraMount(0.45, 0.0, 0.6, 0.07)
    assert learner.measurable_from_m(make_grid(seen_by(high), CONFIG, high), True) == 0.0
    assert learner.measurable_from_m(make_grid(seen_by(high), CONFIG, None), True) == 0.0


def test_how_near_the_floor_was_too_near_is_told() -> None:
    """0.42 m of least depth and a little more, and nothing for a camera that measures all that it sees."""
    (*_, space) = spaces(*[measured_from(0.42)] * 5)
    assert 0.42 <= space.blind_m <= 0.6
    (*_, whole) = spaces(*[measured_from(0.25)] * 5)
    assert whole.blind_m == 0.0


def test_hours_before_a_pallet_are_not_counted_against_the_floor_behind_it() -> None:
    grid = make_grid(seen_by(LOW), CONFIG, LOW)
    nothing = make_grid(measured_from(0.9), CONFIG, LOW)
    near = NearFloor(CONFIG.min_depth_m)
    for _ in range(20_000):
        near.measurable_from_m(nothing, trusted=True)
    assert near.measurable_from_m(nothing, trusted=True) == 0.6
    told = [near.measurable_from_m(grid, trusted=True) for _ in range(120)]
    assert told[-1] == 0.0
