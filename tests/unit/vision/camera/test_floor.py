"""The floor of a camera whose mounting nobody knows."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from config.perception import DepthNoise, FragmentSettings, PerceptionConfig
from hal.types import FloatArray
from tests.support.grids import (
    LEVEL_UP,
    ROWS,
    X,
    Y,
    grid_of,
    nearest,
    no_depth,
    plane,
    plate,
    wall,
)
from tests.support.painted import QVGA, Take, box, drive, record, vector
from tests.support.painted import floor as painted_floor
from tests.support.painted import wall as painted_wall
from vision.camera.floor import Floor, FloorFinder, on_floor
from vision.percept import Percept
from vision.perception import Perception

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
NOISE = DepthNoise(floor_m=0.005, quadratic_per_m=0.0075)
SIDEWAYS = vector(0.0, -0.8, 0.0)


def tilted(pitch_deg: float, roll_deg: float) -> FloatArray:
    """The world's up in the axes of a camera that looks down by pitch and is rolled clockwise."""
    pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
    # Level: (0, -1, 0). Looking down, up comes to lie towards -z; rolling turns x and y.
    return vector(-math.cos(pitch) * math.sin(roll), -math.cos(pitch) * math.cos(roll), -math.sin(pitch))


def look(*depths_m: FloatArray) -> Floor | None:
    return FloorFinder().find(grid_of(nearest(*depths_m)))


def found(*depths_m: FloatArray) -> Floor:
    floor = look(*depths_m)
    assert floor is not None
    return floor


@pytest.mark.parametrize(
    ("pitch_deg", "roll_deg", "height_m"),
    [(0.0, 0.0, 0.5), (10.0, 0.0, 0.35), (25.0, 12.0, 1.4), (35.0, -15.0, 1.7), (-6.0, 3.0, 1.0)],
)
def test_a_plane_gives_its_normal_and_the_height_over_it(
    pitch_deg: float, roll_deg: float, height_m: float
) -> None:
    up = tilted(pitch_deg, roll_deg)
    floor = found(plane(up, height_m))
    np.testing.assert_allclose(floor.up, up, atol=1e-4)
    assert floor.camera_height_m == pytest.approx(height_m, rel=1e-4)
    assert np.linalg.norm(floor.up) == pytest.approx(1.0)


def test_the_normal_by_hand() -> None:
    """1 m over the floor, looking 30 degrees down: the axis hits it 2 m away (1 / sin 30)."""
    depth_m = plane(tilted(30.0, 0.0), 1.0)
    middle = 0.5 * (depth_m[ROWS // 2 - 1] + depth_m[ROWS // 2])
    assert middle == pytest.approx(np.full_like(middle, 2.0), rel=1e-3)
    floor = found(depth_m)
    np.testing.assert_allclose(floor.up, [0.0, -0.8660254, -0.5], atol=1e-4)
    assert floor.camera_height_m == pytest.approx(1.0, rel=1e-4)


def test_noise_of_depth_and_clutter_shift_it_by_little() -> None:
    up = tilted(20.0, 5.0)
    depth_m = nearest(plane(up, 1.2), plate(2.0, (-0.7, -0.2), (-0.5, 0.6)), wall(4.5))
    inverse = 1.0 / depth_m + np.random.default_rng(3).normal(0.0, 0.003, depth_m.shape)
    floor = found(1.0 / inverse)
    assert math.degrees(math.acos(min(1.0, float(floor.up @ up)))) < 1.0
    assert floor.camera_height_m == pytest.approx(1.2, rel=0.03)


def test_heights_and_distances_over_the_floor_found() -> None:
    """A crate 0.4 m high stands 2 m ahead along the floor; the camera is 1 m up and looks 15 degrees down."""
    pitch = math.radians(15.0)
    cosine, sine = math.cos(pitch), math.sin(pitch)
    front = 2.0 / (cosine - Y * sine)  # depth at which a ray is 2 m ahead, along the floor
    above = 1.0 - front * (Y * cosine + sine)
    crate = ((above >= 0.0) & (above <= 0.4))[:, None] & (np.abs(X) <= 0.2)[None, :]
    up = tilted(15.0, 0.0)
    depth_m = np.where(crate, np.broadcast_to(front[:, None], crate.shape), plane(up, 1.0))
    grid = grid_of(depth_m)
    floor = FloorFinder().find(grid)
    assert floor is not None
    known = on_floor(grid, floor, NOISE)
    assert known.height_m is not None
    np.testing.assert_allclose(known.forward_m[crate], 2.0, rtol=1e-3)
    np.testing.assert_allclose(
        known.height_m[crate], np.broadcast_to(above[:, None], crate.shape)[crate], atol=2e-3
    )
    assert 0.36 < float(known.height_m[crate].max()) <= 0.401
    on_the_ground = grid.valid & ~crate & (depth_m < 6.0)
    np.testing.assert_allclose(known.height_m[on_the_ground], 0.0, atol=2e-3)
    assert known.camera_height_m == floor.camera_height_m
    np.testing.assert_array_equal(known.up, floor.up)


def test_doubt_of_a_height_by_hand() -> None:
    """Noise of depth times the slope of the ray, 1 cm of the plane and 6 mm a metre."""
    grid = grid_of(wall(2.0))
    known = on_floor(grid, Floor(LEVEL_UP, 1.0), NOISE)
    assert known.height_sigma_m is not None
    row = 50
    cell = 0.4 * (0.005 + 0.0075 * 4.0)
    expected = cell * abs(Y[row]) + 0.01 + 0.006 * 2.0
    np.testing.assert_allclose(known.height_sigma_m[row], expected, rtol=1e-5)


def test_a_wall_alone_is_no_floor() -> None:
    assert look(wall(3.0)) is None


def test_a_ceiling_is_no_floor() -> None:
    assert look(plane(-LEVEL_UP, 1.5)) is None


@pytest.mark.parametrize("height_m", [0.1, 3.2])
def test_a_plane_too_near_or_too_far_below_is_no_floor(height_m: float) -> None:
    assert look(plane(tilted(20.0, 0.0), height_m)) is None


def test_a_camera_held_on_its_side_finds_no_floor() -> None:
    assert look(plane(tilted(10.0, 50.0), 1.0)) is None
    assert look(plane(tilted(10.0, 40.0), 1.0)) is not None


def test_floor_wins_over_a_table() -> None:
    up = tilted(20.0, 0.0)
    table_m, floor_m = plane(up, 0.45), plane(up, 1.2)
    left = (X < 0.285)[None, :] & (table_m > 0.0)
    depth_m = np.where(left, table_m, floor_m)
    seen = (depth_m > 0.0) & (depth_m < 10.0)
    assert 3.2 < np.count_nonzero(seen & left) / np.count_nonzero(seen & ~left) < 3.9  # much more table
    assert found(depth_m).camera_height_m == pytest.approx(1.2, rel=1e-3)


def test_too_little_floor_is_no_floor() -> None:
    depth_m = plane(tilted(20.0, 0.0), 1.0)
    patch = no_depth()
    patch[40:52, 20:40] = depth_m[40:52, 20:40]  # 5 % of the cells
    assert look(patch) is None
    patch[40:54, 20:44] = depth_m[40:54, 20:44]  # 7 %
    assert found(patch).camera_height_m == pytest.approx(1.0, rel=1e-3)


def test_without_any_depth_there_is_no_floor() -> None:
    assert look(no_depth()) is None


def test_the_last_floor_is_kept_for_five_frames() -> None:
    finder = FloorFinder()
    seen = finder.find(grid_of(plane(tilted(15.0, 0.0), 0.8)))
    assert seen is not None
    for _ in range(5):
        kept = finder.find(grid_of(wall(2.0)))
        assert kept is not None
        np.testing.assert_array_equal(kept.up, seen.up)
        assert kept.camera_height_m == seen.camera_height_m
    assert finder.find(grid_of(wall(2.0))) is None
    assert finder.find(grid_of(wall(2.0))) is None


def test_a_floor_seen_again_is_kept_for_as_long_as_at_first() -> None:
    finder = FloorFinder()
    floor_m, wall_m = grid_of(plane(tilted(15.0, 0.0), 0.8)), grid_of(wall(2.0))
    for grid in (floor_m, *[wall_m] * 4, floor_m, *[wall_m] * 5):
        assert finder.find(grid) is not None
    assert finder.find(wall_m) is None


def test_a_floor_that_comes_into_view_is_found_at_once() -> None:
    finder = FloorFinder()
    assert finder.find(grid_of(wall(2.0))) is None
    assert finder.find(grid_of(wall(2.0))) is None
    seen = finder.find(grid_of(plane(tilted(15.0, 0.0), 0.8)))
    assert seen is not None
    assert seen.camera_height_m == pytest.approx(0.8, rel=1e-3)


def test_another_floor_is_found_at_once_when_the_old_one_is_lost() -> None:
    finder = FloorFinder()
    assert finder.find(grid_of(plane(tilted(15.0, 0.0), 0.8))) is not None
    seen = finder.find(grid_of(plane(tilted(15.0, 0.0), 1.4)))
    assert seen is not None
    assert seen.camera_height_m == pytest.approx(1.4, rel=1e-3)


def test_a_floor_is_followed_while_the_camera_turns() -> None:
    """Half a degree a frame, as a hand does, and no frame without it."""
    finder = FloorFinder()
    for k in range(12):
        turned_m = plane(tilted(15.0 + 0.5 * k, 0.0), 0.8)
        seen = finder.find(grid_of(turned_m))
        assert seen is not None
        np.testing.assert_allclose(seen.up, found(turned_m).up, atol=1e-3)


def test_a_larger_floor_takes_the_place_of_a_table_within_five_frames() -> None:
    """A table at 0.4 m fills the view at first; then most of what is seen lies 0.6 m under it."""
    finder = FloorFinder()
    table_m, floor_m = plane(tilted(30.0, 0.0), 0.4), plane(tilted(30.0, 0.0), 1.0)
    first = finder.find(grid_of(table_m))
    assert first is not None
    assert first.camera_height_m == pytest.approx(0.4, rel=1e-3)
    seen_m = floor_m.copy()
    seen_m[:, :24] = table_m[:, :24]
    for _ in range(5):
        last = finder.find(grid_of(seen_m))
    assert last is not None
    assert last.camera_height_m == pytest.approx(1.0, rel=1e-3)


def test_the_same_depth_gives_the_same_floor_to_the_last_bit() -> None:
    clean_m = nearest(plane(tilted(20.0, 5.0), 1.2), wall(5.0))
    noise = np.random.default_rng(5).normal(0.0, 0.003, (4, *clean_m.shape))
    one, other = FloorFinder(), FloorFinder()
    for k in range(4):
        grid = grid_of(1.0 / (1.0 / clean_m + noise[k]))
        first, second = one.find(grid), other.find(grid)
        assert first is not None
        assert second is not None
        np.testing.assert_array_equal(first.up, second.up)
        assert first.camera_height_m == second.camera_height_m


@cache
def in_the_hand() -> tuple[Take, list[Percept]]:
    """A crate crosses, another one stands; nobody knows how the camera is mounted."""
    crates = box(vector(3.5, 1.0, 0.0), vector(0.4, 0.6, 1.2), 10, SIDEWAYS)
    crates += box(vector(4.0, -1.4, 0.0), vector(0.4, 0.7, 0.7), 20)
    take = record(painted_floor() + painted_wall() + crates, drive(), 25, QVGA)
    eyes = Perception(SMALL, None, body_height_m=0.8, clearance_m=0.05)
    return take, [eyes.perceive(frame, None, None) for frame in take.frames]


def test_without_a_mounting_a_mover_on_the_floor_is_found_and_a_static_crate_is_not() -> None:
    take, percepts = in_the_hand()
    for k in range(21, 25):
        movers = [one for one in percepts[k].scene.obstacles if one.moving]
        assert len(movers) == 1
        expected = take.cameras[k].rotation.T @ SIDEWAYS
        assert np.linalg.norm(movers[0].velocity_mps - expected) <= 0.15
        assert movers[0].extent_m[0] < 1.0  # the crate, not the crate and the floor it stands on
    standing = [
        one
        for one in percepts[-1].scene.obstacles
        if not one.moving and one.extent_m[0] < 1.0 and abs(one.position_m[0] - 1.4) < 0.2
    ]
    assert len(standing) == 1
    assert standing[0].position_m[2] == pytest.approx(4.0, abs=0.2)


def test_without_a_mounting_the_floor_is_no_obstacle() -> None:
    take = record(painted_floor(cell_m=0.2), drive(), 4, QVGA)
    eyes = Perception(SMALL, None, body_height_m=0.8, clearance_m=0.05)
    for frame in take.frames:
        percept = eyes.perceive(frame, None, None)
        assert percept.scene.obstacles == ()
        assert np.isinf(percept.scene.free_space.nearest_m).all()
