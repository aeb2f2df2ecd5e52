"""Free space as the decision reads it, from single painted frames of plain things."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.geometry import camera_in_floor
from hal.types import CameraMount, Intrinsics
from tests.support.painted import MOUNT, VGA, Quad, box, drive, floor, paint, record, vector, wall
from tests.support.painted_scans import (
    CENTRE,
    HERE,
    ROBOT_HEIGHT_M,
    bare,
    eyes_on,
    frame_of,
    inside,
    outside,
    space_of,
)
from vision.perception import Perception
from vision.scene import NEVER_M, Scene


def scene_after_a_while(quads: Sequence[Quad]) -> Scene:
    """The fourth frame: from the third on obstacles are listed."""
    eyes = eyes_on(MOUNT)
    for frame in record(quads, drive(), 4).frames:
        scene = eyes.perceive(frame, None, None).scene
    return scene


def test_levelled_bands_of_a_tipped_camera_lie_side_by_side() -> None:
    """Who looks up the band of a point counts in these widths, from the edge of the view."""
    tipped = CameraMount(0.0, 0.0, 1.0, 0.3)
    space = space_of(frame_of(floor(), tipped), tipped)
    np.testing.assert_allclose(np.diff(space.bearing_tan), 2.0 * space.half_width_tan, rtol=1e-4)


def test_bands_lie_side_by_side_across_the_view() -> None:
    space = space_of(frame_of(floor()))
    np.testing.assert_allclose(np.diff(space.bearing_tan), 2.0 * space.half_width_tan, rtol=1e-4)
    assert space.bearing_tan[0] - space.half_width_tan == pytest.approx(-319.5 / 610.0, abs=0.01)
    assert space.bearing_tan[-1] + space.half_width_tan == pytest.approx(319.5 / 610.0, abs=0.01)


@pytest.mark.parametrize("distance_m", [1.0, 2.5, 4.0, 8.0])
def test_a_plain_wall_is_seen_at_its_distance(distance_m: float) -> None:
    space = space_of(frame_of(floor() + wall(distance_m)))
    np.testing.assert_allclose(space.nearest_m, distance_m, rtol=0.02)
    # What the wall hides is not known.
    np.testing.assert_allclose(space.known_m, distance_m, rtol=0.06)


def test_a_wall_behind_real_depth_noise_is_not_much_nearer_nor_farther() -> None:
    space = space_of(frame_of(floor() + wall(4.0), noise=0.0075))
    assert space.nearest_m == pytest.approx(4.0, abs=0.4)


def test_the_floor_is_free_as_far_as_the_depth_mask() -> None:
    space = space_of(frame_of(floor()))
    assert np.isinf(space.nearest_m).all()
    assert (space.known_m > 9.0).all()
    assert (space.known_m <= 10.0).all()


def test_the_floor_stays_free_with_real_depth_noise() -> None:
    space = space_of(frame_of(floor(), noise=0.0075))
    assert np.isinf(space.nearest_m).all()
    assert (space.known_m > 4.0).all()


def test_without_any_depth_nothing_is_known() -> None:
    frame = frame_of(floor() + wall())
    space = space_of(replace(frame, depth=np.zeros_like(frame.depth)))
    assert np.isinf(space.nearest_m).all()
    np.testing.assert_array_equal(space.known_m, 0.0)


def test_a_corridor_without_depth_is_unknown_and_its_sides_are_not() -> None:
    frame = frame_of(floor())
    depth = frame.depth.copy()
    depth[:, CENTRE] = 0
    space = space_of(replace(frame, depth=depth))
    np.testing.assert_array_equal(space.known_m[inside(space)], 0.0)
    assert (space.known_m[outside(space)] > 9.0).all()
    assert np.count_nonzero(inside(space)) >= 20


def test_known_ends_where_a_glass_front_swallows_the_depth() -> None:
    frame = frame_of(floor())
    depth = frame.depth.copy()
    # The floor 3 m ahead is fy 0.5 / 3 below the horizon; above it nothing comes back.
    depth[: round(VGA.cy + VGA.fy * 0.5 / 3.0), CENTRE] = 0
    space = space_of(replace(frame, depth=depth))
    np.testing.assert_allclose(space.known_m[inside(space)], 3.0, atol=0.15)
    assert (space.known_m[outside(space)] > 9.0).all()


def test_known_ends_at_a_hole_in_the_floor_although_the_floor_goes_on_behind() -> None:
    frame = frame_of(floor())
    depth = frame.depth.copy()
    far, near = (round(VGA.cy + VGA.fy * 0.5 / z) for z in (3.0, 2.0))
    depth[far:near, CENTRE] = 0
    space = space_of(replace(frame, depth=depth))
    np.testing.assert_allclose(space.known_m[inside(space)], 2.0, atol=0.1)


def test_stairs_down_end_what_is_known() -> None:
    # The floor ends at 3 m; the next one is 1 m lower, so its depth is three times as great.
    near = replace(floor()[0], side_m=vector(0.0, -12.0, 0.0), down_m=vector(5.0, 0.0, 0.0))
    lower = replace(floor()[0], corner_m=vector(-2.0, 6.0, -1.0))
    space = space_of(frame_of([near, lower]))
    np.testing.assert_allclose(space.known_m, 3.0, atol=0.15)


def test_beam_above_the_robots_height_is_no_obstacle() -> None:
    beam = box(vector(3.0, 0.0, ROBOT_HEIGHT_M + 0.12), vector(0.3, 3.0, 0.4), 10)
    scene = scene_after_a_while(floor() + beam)
    assert np.isinf(scene.free_space.nearest_m).all()
    assert (scene.free_space.known_m > 9.0).all()
    assert scene.obstacles == ()


def test_beam_within_the_robots_height_is_an_obstacle() -> None:
    beam = box(vector(3.0, 0.0, ROBOT_HEIGHT_M - 0.2), vector(0.3, 1.0, 0.6), 10)
    scene = scene_after_a_while(floor() + beam)
    ahead = np.abs(scene.free_space.bearing_tan) < 0.12
    np.testing.assert_allclose(scene.free_space.nearest_m[ahead], 3.0, atol=0.06)
    assert len(scene.obstacles) == 1


@pytest.mark.parametrize("distance_m", [1.5, 3.0])
def test_an_empty_pallet_of_12_cm_is_seen(distance_m: float) -> None:
    pallet = box(vector(distance_m, 0.0, 0.0), vector(1.2, 0.8, 0.12), 10)
    scene = scene_after_a_while(floor() + pallet)
    ahead = np.abs(scene.free_space.bearing_tan) < 0.3 / distance_m
    np.testing.assert_allclose(scene.free_space.nearest_m[ahead], distance_m, atol=0.2)
    beside = np.abs(scene.free_space.bearing_tan) > 0.5 / distance_m
    assert np.isinf(scene.free_space.nearest_m[beside]).all()
    assert len(scene.obstacles) == 1


def test_a_thin_pole_is_seen() -> None:
    pole = box(vector(2.0, 0.0, 0.0), vector(0.04, 0.04, 1.2), 10)
    space = space_of(frame_of(floor() + wall() + pole))
    assert space.nearest_m.min() == pytest.approx(2.0, abs=0.06)


def test_single_noisy_pixels_are_no_obstacle() -> None:
    frame = frame_of(floor() + wall(6.0))
    depth = frame.depth.copy()
    rng = np.random.default_rng(5)
    rows = rng.integers(20, 460, 300)
    depth[rows, rng.integers(0, 640, 300)] = 1000
    space = space_of(replace(frame, depth=depth))
    np.testing.assert_allclose(space.nearest_m, 6.0, rtol=0.02)


def test_a_camera_that_looks_down_measures_along_the_floor() -> None:
    tipped = CameraMount(0.0, 0.0, 1.0, 0.3)
    space = space_of(frame_of(floor() + wall(3.0), tipped), tipped)
    np.testing.assert_allclose(space.nearest_m, 3.0, rtol=0.02)
    np.testing.assert_allclose(space.known_m, 3.0, rtol=0.06)


def test_nothing_is_known_beyond_the_upper_rim_of_a_steep_view() -> None:
    steep = CameraMount(0.0, 0.0, 1.0, math.radians(45.0))
    space = space_of(frame_of(floor(), steep), steep)
    reach_m = 1.0 / math.tan(math.radians(45.0) - math.atan(239.5 / 610.0))
    assert np.isinf(space.nearest_m).all()
    assert (space.known_m <= reach_m + 0.05).all()
    # The uppermost row sees as far, and less to the sides than the rows below it.
    farthest = 319.5 / 610.0 / (math.cos(math.radians(45.0)) * (1.0 + 239.5 / 610.0))
    within = np.abs(space.bearing_tan) <= farthest - space.half_width_tan
    assert np.count_nonzero(within) > 50
    assert (space.known_m[within] >= reach_m - 0.2).all()
    assert (space.known_m[np.abs(space.bearing_tan) >= farthest + 0.1] < reach_m - 0.2).all()


def test_bearings_of_a_tipped_camera_are_levelled() -> None:
    tipped = CameraMount(0.0, 0.0, 1.0, 0.2)
    crate = box(vector(4.0, -1.0, 0.0), vector(0.4, 0.6, 0.6), 10)
    space = space_of(frame_of(floor() + crate, tipped), tipped)
    hit = np.isfinite(space.nearest_m)
    # From y = -0.7 to -1.3 at x = 4, right is positive; the image's rows differ a little in their bearing.
    assert space.bearing_tan[hit].min() == pytest.approx(0.7 / 4.0, abs=0.03)
    assert space.bearing_tan[hit].max() == pytest.approx(1.3 / 4.0, abs=0.03)


@pytest.mark.parametrize("pitch_deg", [0.0, 4.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("foot_m", [0.0, 0.45])
def test_an_edge_beside_the_way_is_told_where_it_is(pitch_deg: float, foot_m: float) -> None:
    """Within a band, low and high in the image; columns of the image told its inner side at 0.44 m."""
    mount = CameraMount(0.0, 0.0, 1.2, math.radians(pitch_deg))
    post = box(vector(2.5, -0.45, foot_m), vector(0.1, 0.1, 0.3), 10)
    space = space_of(frame_of(floor() + post, mount), mount)
    hit = np.isfinite(space.nearest_m)
    inner = space.nearest_m[hit] * (space.bearing_tan[hit] - space.half_width_tan)
    outer = space.nearest_m[hit] * (space.bearing_tan[hit] + space.half_width_tan)
    assert 0.40 - 0.06 <= inner.min() <= 0.405
    assert 0.495 <= outer.max() <= 0.50 + 0.06


def test_cells_beside_the_bands_of_a_steep_view_count_in_the_outermost_band() -> None:
    steep = CameraMount(0.0, 0.0, 1.0, math.radians(30.0))
    # At 0.9 m the view is 0.76 m wide to the side; the bands end at 0.58 m.
    post = box(vector(0.92, -0.68, 0.0), vector(0.05, 0.06, 0.12), 10)
    space = space_of(frame_of(floor() + post, steep), steep)
    assert np.flatnonzero(np.isfinite(space.nearest_m)).tolist() == [len(space.nearest_m) - 1]
    assert space.nearest_m[-1] == pytest.approx(0.9, abs=0.03)


def test_floor_beside_the_view_of_the_upper_rows_is_unknown() -> None:
    steep = CameraMount(0.0, 0.0, 1.0, 0.45)
    space = space_of(frame_of(floor(), steep), steep)
    # The uppermost row goes 1.07 m along the floor for a metre of depth, that in the middle 0.90 m.
    outside = np.abs(space.bearing_tan) > 319.5 / 610.0 / 1.07 + 0.04
    assert np.count_nonzero(outside) >= 4
    assert (space.known_m[outside] < 6.0).all()
    assert (space.known_m[~outside][6:-6] > 9.0).all()


def test_the_whole_view_is_scanned_at_848_pixels_too() -> None:
    wide = Intrinsics(
        848, 480, 610.0, 610.0, 423.5, 239.5
    )  # 212 columns of cells do not divide into 80 bands
    frame = paint(bare(floor() + wall(3.0)), camera_in_floor(HERE, MOUNT), wide)
    space = eyes_on(MOUNT).perceive(frame, None, None).scene.free_space
    edge = (wide.width - 1 - wide.cx) / wide.fx
    assert space.bearing_tan[0] - space.half_width_tan <= -edge + 0.01
    assert space.bearing_tan[-1] + space.half_width_tan >= edge - 0.01
    np.testing.assert_allclose(space.nearest_m, 3.0, atol=0.1)


@pytest.mark.parametrize(("height_m", "pitch_deg"), [(0.6, 4.0), (1.1, 15.0), (0.3, 0.0)])
def test_distance_at_which_the_floor_comes_into_view_is_reported(height_m: float, pitch_deg: float) -> None:
    """By the middle of the lowest row of cells, somewhat above the image's edge."""
    mount = CameraMount(0.0, 0.0, height_m, math.radians(pitch_deg))
    down_rad = math.atan((VGA.height - 0.5 - VGA.cy) / VGA.fy) + mount.pitch_rad
    edge_m = height_m / math.tan(down_rad)
    assert edge_m < space_of(frame_of(floor(), mount), mount).floor_from_m < 1.05 * edge_m


def test_without_floor_in_view_floor_from_is_never_and_without_a_mounting_it_is_0() -> None:
    up = CameraMount(0.0, 0.0, 0.6, math.radians(-40.0))
    assert space_of(frame_of(floor()), up).floor_from_m == NEVER_M
    # Beyond the depth mask, too: the lower edge looks down by 3.5 degrees.
    hardly = CameraMount(0.0, 0.0, 1.2, math.radians(3.5) - math.atan((VGA.height - 2.5 - VGA.cy) / VGA.fy))
    assert 19.0 < space_of(frame_of(floor()), hardly).floor_from_m < 21.0
    unknown = Perception(PerceptionConfig(), None, ROBOT_HEIGHT_M, clearance_m=0.05)
    assert unknown.perceive(frame_of(floor()), None, None).scene.free_space.floor_from_m == 0.0


@pytest.mark.parametrize("pitch_deg", [-5.0, 4.0, 30.0])
def test_how_the_upper_edge_of_the_view_rises_is_told(pitch_deg: float) -> None:
    mount = CameraMount(0.0, 0.0, 0.6, math.radians(pitch_deg))
    up_rad = math.atan((VGA.cy + 0.5) / VGA.fy) - mount.pitch_rad
    found = space_of(frame_of(floor(), mount), mount).up_tan
    assert math.tan(up_rad - 0.03) < found < math.tan(up_rad)
    unknown = Perception(PerceptionConfig(), None, ROBOT_HEIGHT_M, clearance_m=0.05)
    assert math.isinf(unknown.perceive(frame_of(floor()), None, None).scene.free_space.up_tan)
