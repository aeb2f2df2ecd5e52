"""A robot that sees itself: what is its own is cut out, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from config.own_parts import OwnPart
from config.perception import PerceptionConfig
from hal.box_view import box_view
from hal.types import RgbdFrame
from tests.support.own_bumper import BUMPER, HIDDEN_M, bumper, eyes, frames_of
from tests.support.painted import FRAME_NS, MOUNT, VGA, Quad, box, floor, vector, wall
from tests.support.painted_scans import CENTRE, frame_of, inside, outside
from vision.camera.own_parts import OwnParts
from vision.depth.depth_grid import make_grid
from vision.scene import CameraCondition, FreeSpace, Scene

CONFIG = PerceptionConfig()
ROOM = floor() + wall()
HALL = floor()  # without a wall, the scan is known as far as the floor is seen without a hole


def scan(quads: list[Quad], *own_parts: OwnPart, noise: float = 0.0) -> FreeSpace:
    return scan_of(frame_of(quads + bumper(), noise=noise), *own_parts)


def scan_of(frame: RgbdFrame, *own_parts: OwnPart) -> FreeSpace:
    return eyes(*own_parts).perceive(frame, None, None).scene.free_space


def last_scene(quads: list[Quad], count: int, *own_parts: OwnPart) -> Scene:
    seeing = eyes(*own_parts)
    for frame in frames_of(quads, count):
        scene = seeing.perceive(frame, None, None).scene
    return scene


def test_unless_it_is_given_the_bumper_is_an_obstacle() -> None:
    space = scan(ROOM)
    assert (space.nearest_m[inside(space)] < 0.6).all()
    assert any(obstacle.position_m[2] < 0.6 for obstacle in last_scene(ROOM, 4).obstacles)


@pytest.mark.parametrize("noise", [0.0, 0.0075])
def test_a_bumper_that_is_given_is_neither_a_surface_nor_a_hole(noise: float) -> None:
    space = scan(ROOM, BUMPER, noise=noise)
    np.testing.assert_allclose(space.nearest_m, 7.0, rtol=0.3)
    assert (scan(HALL, BUMPER, noise=noise).known_m > 4.0).all()
    # Not given, and not there: it is a hole, or a surface.
    assert (scan(HALL).known_m < 0.6).all()


def test_a_bumper_that_is_given_is_no_obstacle() -> None:
    assert all(obstacle.position_m[2] > 2.0 for obstacle in last_scene(ROOM, 4, BUMPER).obstacles)


def test_floor_that_it_hides_is_as_floor_below_the_view() -> None:
    space = scan(ROOM, BUMPER)
    assert space.floor_from_m == pytest.approx(HIDDEN_M, abs=0.2)
    assert space.floor_from_m > HIDDEN_M
    assert space.blind_m == space.floor_from_m
    free = eyes().perceive(frame_of(ROOM), None, None).scene.free_space
    assert free.floor_from_m == pytest.approx(1.27, abs=0.02)
    assert free.blind_m == 0.0


@pytest.mark.parametrize("distance_m", [0.9, 1.5, 4.0])
def test_what_stands_behind_it_is_seen_over_it(distance_m: float) -> None:
    person = box(vector(distance_m, 0.0, 0.0), vector(0.3, 0.5, 1.7), 20)
    space = scan(ROOM + person, BUMPER)
    middle = np.abs(space.bearing_tan) < 0.2 / distance_m
    np.testing.assert_allclose(space.nearest_m[middle], distance_m, rtol=0.02)
    obstacles = last_scene(ROOM + person, 4, BUMPER).obstacles
    assert min(obstacle.position_m[2] for obstacle in obstacles) == pytest.approx(distance_m, abs=0.15)


def test_what_stands_against_it_is_seen() -> None:
    """5 cm behind its far side, higher than the bumper; the mask ends a few centimetres behind it."""
    crate = box(vector(0.62, 0.0, 0.0), vector(0.3, 0.4, 0.6), 20)
    space = scan(ROOM + crate, BUMPER)
    np.testing.assert_allclose(space.nearest_m[np.abs(space.bearing_tan) < 0.2], 0.62, rtol=0.02)


def test_what_it_hides_entirely_is_not_seen_free() -> None:
    """A pallet 14 cm high, 1.2 m ahead: the floor that the scan vouches for begins behind it."""
    pallet = box(vector(1.2, 0.0, 0.0), vector(0.3, 0.6, 0.14), 20)
    space = scan(ROOM + pallet, BUMPER)
    assert (space.nearest_m > 5.0).all()
    assert space.blind_m > 1.5


def test_a_hole_in_the_floor_beyond_it_is_a_hole() -> None:
    frame = frame_of(HALL + bumper())
    depth = frame.depth.copy()
    far, near = (round(VGA.cy + VGA.fy * 0.5 / z) for z in (4.0, 3.0))
    depth[far:near, CENTRE] = 0
    space = scan_of(replace(frame, depth=depth), BUMPER)
    np.testing.assert_allclose(space.known_m[inside(space)], 3.0, atol=0.15)
    assert (space.known_m[outside(space)] > 6.0).all()


def test_without_depth_over_it_nothing_is_known() -> None:
    """Not even what would be known if the bumper hid it: it might be a hand before the lens."""
    frame = frame_of(HALL + bumper())
    depth = frame.depth.copy()
    depth[:, CENTRE] = 0
    space = scan_of(replace(frame, depth=depth), BUMPER)
    np.testing.assert_array_equal(space.known_m[inside(space)], 0.0)


def test_behind_a_mast_nothing_is_known() -> None:
    """It hides the floor up to the horizon, so no floor there may count as below the view."""
    mast = OwnPart(name="mast", from_m=(0.40, -0.03, 0.0), to_m=(0.46, 0.03, 1.0))
    frame = frame_of(HALL + box(vector(0.40, 0.0, 0.0), vector(0.06, 0.06, 1.0), 60))
    space = scan_of(frame, mast)
    behind = np.abs(space.bearing_tan) < 0.03 / 0.40
    assert (space.known_m[behind] == 0.0).all()
    assert np.isinf(space.nearest_m[behind]).all()
    assert (space.known_m[np.abs(space.bearing_tan) > 0.3] > 6.0).all()
    assert space.floor_from_m == pytest.approx(1.27, abs=0.02)


def test_under_a_raised_bar_the_floor_is_seen_on_both_sides_of_it() -> None:
    """Floor is in view below the bar, which hides some, and above it."""
    bar = OwnPart(name="bar", from_m=(0.48, -0.30, 0.36), to_m=(0.51, 0.30, 0.39))
    frame = frame_of(HALL + box(vector(0.48, 0.0, 0.36), vector(0.03, 0.6, 0.03), 60))
    space = scan_of(frame, bar)
    assert (space.known_m > 6.0).all()
    # 0.51 m ahead and 0.11 m below the camera: floor is hidden up to 2.3 m.
    assert space.blind_m == pytest.approx(2.4, abs=0.1)


def test_floor_that_is_hidden_farther_away_ends_what_is_known() -> None:
    """A bar that hides the floor from 2.4 to 5.1 m: nobody consents to that much, so it is not skipped."""
    bar = OwnPart(name="bar", from_m=(0.48, -0.30, 0.40), to_m=(0.51, 0.30, 0.45))
    space = scan_of(frame_of(HALL + box(vector(0.48, 0.0, 0.40), vector(0.03, 0.6, 0.05), 60)), bar)
    assert (space.known_m[np.abs(space.bearing_tan) < 0.4] < 2.6).all()
    assert (space.known_m[np.abs(space.bearing_tan) < 0.4] > 2.0).all()
    assert space.floor_from_m == pytest.approx(1.27, abs=0.02)


def test_beside_it_a_stereo_camera_measures_nothing_and_that_is_no_hole() -> None:
    post = OwnPart(name="post", from_m=(0.40, 0.05, 0.20), to_m=(0.46, 0.10, 0.38))
    frame = frame_of(HALL + box(vector(0.40, 0.075, 0.20), vector(0.06, 0.05, 0.18), 60))
    depth = frame.depth.copy()
    rows, columns = box_view(post, MOUNT, VGA).seen.nonzero()
    depth[rows.min() :, columns.min() - 50 : columns.min()] = 0
    space = scan_of(replace(frame, depth=depth), post)
    assert (space.known_m > 6.0).all()


def test_depth_mixed_of_the_part_and_its_background_goes_with_the_part() -> None:
    """In three rows above its upper edge, as real cameras have it: it would stand right before the robot."""
    frame = frame_of(ROOM + bumper())
    depth = frame.depth.copy()
    seen = box_view(BUMPER, MOUNT, VGA).seen
    top = seen.nonzero()[0].min()
    for row, mixed in ((top - 3, 1500), (top - 2, 1100), (top - 1, 700)):
        depth[row] = np.where(seen[top], mixed, depth[row])
    cut = OwnParts((BUMPER,), MOUNT, CONFIG).without(replace(frame, depth=depth))
    assert cut.depth[cut.depth > 0].min() > 2000


def test_depth_of_own_parts_is_no_fault_of_the_camera() -> None:
    """A bumper close to the lens, of which nothing can be measured, in nearly half of the image."""
    frame = frame_of(ROOM + bumper())
    low = OwnPart(name="deck", from_m=(0.10, -0.30, 0.38), to_m=(0.51, 0.30, 0.46))
    depth = np.zeros_like(frame.depth)
    depth[60:100] = frame.depth[60:100]
    hidden = box_view(low, MOUNT, VGA).seen
    depth[hidden] = 0
    check = eyes(low).perceive(replace(frame, depth=depth), None, None).scene.health
    assert check.valid_depth_ratio == pytest.approx(40 / 480 / (1.0 - hidden.mean()), rel=0.12)


def test_a_body_that_ends_at_an_own_part_is_hidden_there() -> None:
    """Its cells count as nearer than all that is seen beside them."""
    frame = frame_of(ROOM + box(vector(1.0, 0.0, 0.0), vector(0.3, 0.5, 1.0), 20) + bumper())
    own = OwnParts((BUMPER,), MOUNT, CONFIG)
    cut = own.without(frame)
    grid = own.mark(make_grid(cut, CONFIG, MOUNT))
    assert grid.own.any()
    assert not (grid.own & grid.valid).any()
    beside = np.isfinite(grid.inverse_depth) & grid.valid
    assert grid.inverse_depth[grid.own & (grid.inverse_depth > 0.0)].min() > grid.inverse_depth[beside].max()
    # The frame that came in is kept as it was: it is recorded.
    assert cut.depth is not frame.depth
    assert frame.depth[400, 320] > 0
    assert cut.depth[400, 320] == 0


def test_depth_behind_the_far_side_stays_but_for_a_rim() -> None:
    frame = frame_of(ROOM + bumper())
    cut = OwnParts((BUMPER,), MOUNT, CONFIG).without(frame)
    far_m = BUMPER.to_m[0] + 0.02 + 3.0 * (0.005 + 0.0075 * BUMPER.to_m[0] ** 2)
    kept, own = cut.depth > 0, frame.depth * 0.001 <= far_m
    np.testing.assert_array_equal(cut.depth[kept], frame.depth[kept])
    assert not kept[own].any()
    rim = cv2.dilate(own.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    assert kept[~rim].all()


def test_a_part_that_turns_out_to_be_out_of_view_changes_nothing() -> None:
    """A camera may tell its own view only once it runs."""
    behind = OwnPart(name="tail", from_m=(-0.5, -0.3, 0.2), to_m=(-0.4, 0.3, 0.5))
    frame = frame_of(ROOM)
    own = OwnParts((behind,), MOUNT, CONFIG)
    assert own.without(frame) is frame
    grid = own.mark(make_grid(frame, CONFIG, MOUNT))
    assert not grid.own.any()
    assert grid.hidden_m == 0.0
    assert not own.under(np.zeros((3, 2, 2), np.float32)).any()


def test_another_size_of_image_has_its_own_silhouette() -> None:
    own = OwnParts((BUMPER,), MOUNT, CONFIG)
    frame = frame_of(ROOM + bumper())
    half = replace(
        frame,
        depth=np.ascontiguousarray(frame.depth[::2, ::2]),
        intrinsics=replace(VGA, width=320, height=240, fx=305.0, fy=305.0, cx=159.5, cy=119.5),
    )
    whole = np.mean(own.without(frame).depth == 0)
    assert np.mean(own.without(half).depth == 0) == pytest.approx(whole, abs=0.02)


@pytest.mark.parametrize("step_px", [1, 2, 3, 4, 5])
def test_every_size_of_cell(step_px: int) -> None:
    """481 x 640: neither is a multiple of all."""
    frame = frame_of(ROOM + bumper())
    frame = replace(
        frame,
        depth=np.vstack((frame.depth, frame.depth[-1:])),
        intrinsics=replace(VGA, height=481),
    )
    config = CONFIG.model_copy(update={"grid_step_px": step_px})
    own = OwnParts((BUMPER,), MOUNT, config)
    grid = own.mark(make_grid(own.without(frame), config, MOUNT))
    assert grid.own.shape == grid.valid.shape
    assert grid.own.mean() == pytest.approx(0.18, abs=0.05)


def seen_for(own_part: OwnPart, seconds: int) -> tuple[CameraCondition, str]:
    """The camera's health after looks a second apart."""
    frame, seeing = frame_of(ROOM + bumper()), eyes(own_part)
    for second in range(seconds + 1):
        colour = frame.colour ^ np.uint8(second % 2)
        later = replace(frame, captured_ns=second * 1_000_000_000, colour=colour)
        health = seeing.perceive(later, None, None).scene.health
    return health.condition, health.reason


HIGHER = OwnPart(name="rack", from_m=(0.40, -0.30, 0.20), to_m=(0.51, 0.30, 0.70))


def test_a_box_where_nothing_of_the_robot_is_is_told_after_a_while() -> None:
    assert "rack" not in seen_for(HIGHER, 4)[1]
    condition, reason = seen_for(HIGHER, 6)
    assert condition is not CameraCondition.GOOD
    assert "of where camera.own_parts has 'rack' shows something farther: are its box and" in reason


def test_a_box_that_fits_is_never_told() -> None:
    assert "own_parts" not in seen_for(BUMPER, 8)[1]


def test_without_own_parts_nothing_is_different() -> None:
    """The grid has no own cells, and the frame is passed on as it is."""
    take = frames_of(ROOM, 3)
    grid = make_grid(take[0], CONFIG, MOUNT)
    assert grid.own.shape == (0, 0)
    assert grid.hidden_m == 0.0
    assert take[1].captured_ns - take[0].captured_ns == FRAME_NS
