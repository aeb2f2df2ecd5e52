import dataclasses
import math

import numpy as np
import pytest

from controller.decision.decision import Reason
from controller.video.corridor import corridor_ahead
from controller.video.moment import VideoMoment
from controller.video.seen_obstacles import seen_obstacles
from controller.video.style import FREE_SPACE, MOVING, OWN, PANEL, STATIC, SURFACE, TOP_VIEW, Colour, Image
from controller.video.top_view import TopView
from hal.types import FloatArray
from tests.support import video_moments as build
from vision.scene import FreeSpace

RANGE_M = 10.0
VIEW = TopView(TOP_VIEW, RANGE_M)
# An anti-aliased stroke of one pixel is a little fainter than its colour.
SOFT_EDGE = 45
NOTHING_FREE = build.free_space(known_m=0.0)


def drawn(moment: VideoMoment) -> Image:
    canvas = np.zeros((720, 1280, 3), np.uint8)
    VIEW.draw_backdrop(canvas)
    VIEW.draw(canvas, moment, seen_obstacles(moment), corridor_ahead(moment, RANGE_M))
    return TOP_VIEW.of(canvas)


def pixel(image: Image, forward_m: float, left_m: float) -> tuple[int, ...]:
    x, y = VIEW.to_pixels(np.array([forward_m, left_m])).round().astype(int)
    return tuple(int(value) for value in image[y, x])


def near(image: Image, forward_m: float, left_m: float, colour: Colour, reach: int = 2) -> bool:
    x, y = VIEW.to_pixels(np.array([forward_m, left_m])).round().astype(int)
    around = image[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(int)
    return bool((abs(around - colour) < SOFT_EDGE).all(axis=2).any())


def test_known_points_land_on_known_pixels() -> None:
    # 626 + 10 rows for 0.85 m behind, 10 m ahead and 0.35 m beyond.
    px_per_m = TOP_VIEW.height / 11.2
    origin = VIEW.to_pixels(np.array([0.0, 0.0]))
    assert origin == pytest.approx([(TOP_VIEW.width - 1) / 2, TOP_VIEW.height - 1 - 0.85 * px_per_m])
    assert VIEW.to_pixels(np.array([3.0, 0.0])) - origin == pytest.approx([0.0, -3.0 * px_per_m])
    assert VIEW.to_pixels(np.array([0.0, 1.0])) - origin == pytest.approx([-px_per_m, 0.0])


def test_the_whole_range_is_inside_the_panel() -> None:
    x, y = VIEW.to_pixels(np.array([build.MOUNT.forward_m + RANGE_M - 0.2, 0.0]))
    assert 0 <= x < TOP_VIEW.width
    assert 0 <= y < TOP_VIEW.height
    _, tail = VIEW.to_pixels(np.array([-build.BODY.rear_m, 0.0]))
    assert tail < TOP_VIEW.height


@pytest.mark.parametrize(("moving", "colour"), [(True, MOVING), (False, STATIC)])
def test_an_obstacle_is_drawn_where_it_is(moving: bool, colour: Colour) -> None:
    thing = build.obstacle(4, 5.0, 1.2, moving=moving, size_m=(0.8, 1.0))
    image = drawn(build.moment((thing,), free=NOTHING_FREE))
    assert near(image, 5.0, 1.2 + 0.4, colour)  # its left edge
    assert near(image, 5.0, 1.2 - 0.4, colour)
    assert near(image, 5.0 - 0.15, 1.2, colour)  # its front
    assert pixel(image, 5.0, 0.6) == PANEL


def test_an_obstacle_of_unknown_size_or_velocity_is_still_drawn() -> None:
    thing = dataclasses.replace(
        build.obstacle(4, 5.0, 1.2, moving=True),
        extent_m=np.full(3, math.nan),
        velocity_mps=np.full(3, math.nan),
        velocity_cov=np.full((3, 3), math.inf),
    )
    assert near(drawn(build.moment((thing,), free=NOTHING_FREE)), 5.0, 1.2 + 0.06, MOVING)


def test_the_arrow_ends_where_the_obstacle_will_be_in_a_second() -> None:
    thing = build.obstacle(4, 6.0, 1.5, velocity_mps=(0.0, -1.0), moving=True, sigma_mps=0.1)
    image = drawn(build.moment((thing,), free=NOTHING_FREE))
    assert near(image, 6.0, 0.9, MOVING)  # on its way
    assert near(image, 6.0, 0.52, MOVING)  # its tip
    assert not near(image, 6.0, 0.3, MOVING)


def test_the_uncertainty_is_drawn_to_scale_along_its_axes() -> None:
    # obstacle() gives sigma across the view, twice that along it.
    thing = build.obstacle(4, 6.0, 0.0, velocity_mps=(0.0, 0.0), moving=True, sigma_mps=0.4)
    image = drawn(build.moment((thing,), free=NOTHING_FREE))
    assert near(image, 6.0, 0.4, MOVING)
    assert near(image, 6.8, 0.0, MOVING)
    assert not near(image, 6.0, 0.32, MOVING, reach=1)  # neither filled nor smaller


def test_an_uncertainty_wider_than_the_view_is_left_out() -> None:
    thing = build.obstacle(4, 6.0, 0.0, moving=True, sigma_mps=1.2)
    image = drawn(build.moment((thing,), free=NOTHING_FREE))
    assert not near(image, 8.4, 0.0, MOVING)


def test_the_path_and_the_edges_of_its_corridor() -> None:
    image = drawn(build.moment(path_m=build.straight_path(), free=NOTHING_FREE))
    assert near(image, 4.0, 0.0, OWN)
    background = pixel(image, 4.0, 1.0)
    assert pixel(image, 4.0, 0.25) != background  # tinted inside
    assert pixel(image, 4.0, -0.25) == pixel(image, 4.0, 0.25)
    assert pixel(image, 4.0, 0.6) == background


def test_without_a_path_there_is_no_corridor() -> None:
    assert corridor_ahead(build.moment(), RANGE_M) is None
    assert corridor_ahead(build.moment(path_m=np.array([[0.0, 0.0]])), RANGE_M) is None
    assert corridor_ahead(build.moment(path_m=np.zeros((3, 2))), RANGE_M) is None


def test_a_corridor_keeps_its_width_round_a_bend() -> None:
    angle = np.linspace(0.0, 1.5, 60)
    path_m: FloatArray = 4.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    corridor = corridor_ahead(build.moment(path_m=path_m), RANGE_M)
    assert corridor is not None
    centre = np.array([0.0, 4.0])
    assert np.hypot(*(corridor.left_m - centre).T) == pytest.approx(3.5, abs=0.02)
    assert np.hypot(*(corridor.right_m - centre).T) == pytest.approx(4.5, abs=0.02)


def test_a_corridor_ends_at_the_range() -> None:
    corridor = corridor_ahead(build.moment(path_m=build.straight_path(40.0)), RANGE_M)
    assert corridor is not None
    assert corridor.centre_m[-1] == pytest.approx([RANGE_M, 0.0])


def test_free_space_ends_at_the_nearest_surface() -> None:
    image = drawn(build.moment(free=build.free_space(nearest_m=4.0)))
    foot_m = build.MOUNT.forward_m
    assert pixel(image, foot_m + 2.6, 0.3) == FREE_SPACE
    assert near(image, foot_m + 4.0, 0.3, SURFACE)
    assert pixel(image, foot_m + 5.0, 0.3) == PANEL
    assert pixel(image, foot_m + 2.6, 2.0) == PANEL  # outside the view


def test_unseen_floor_is_not_drawn_as_free() -> None:
    image = drawn(build.moment(free=build.free_space(known_m=3.0)))
    foot_m = build.MOUNT.forward_m
    assert pixel(image, foot_m + 2.6, 0.3) == FREE_SPACE
    assert pixel(image, foot_m + 3.4, 0.3) == PANEL
    assert not (image == SURFACE).all(axis=2).any()


def test_unknown_or_no_bands_are_not_free() -> None:
    empty = np.zeros(0)
    for free in (
        build.free_space(nearest_m=math.nan, known_m=math.nan),
        FreeSpace(empty, 0.01, empty, empty),
    ):
        assert not (drawn(build.moment(free=free)) == FREE_SPACE).all(axis=2).any()


def test_bands_to_the_right_are_drawn_to_the_right() -> None:
    free = build.free_space(known_m=0.0)
    known_m = free.known_m.copy()
    known_m[-8:] = 6.0  # the highest bearings: right
    image = drawn(build.moment(free=dataclasses.replace(free, known_m=known_m)))
    foot_m = build.MOUNT.forward_m
    assert pixel(image, foot_m + 5.0, -0.45 * 5.0) == FREE_SPACE
    assert pixel(image, foot_m + 5.0, 0.45 * 5.0) == PANEL


def test_the_robot_is_drawn_with_its_size_only_where_it_is_known() -> None:
    moment = build.moment(free=NOTHING_FREE)
    half_m = 0.5 * build.BODY.width_m
    assert near(drawn(moment), 0.2, half_m, OWN)
    assert near(drawn(moment), -build.BODY.rear_m, 0.2, OWN)
    without = drawn(dataclasses.replace(moment, body=None))
    assert not near(without, 0.2, half_m, OWN)


def test_without_a_mount_the_camera_is_the_origin() -> None:
    thing = build.obstacle(4, 5.0, 1.0)
    moment = dataclasses.replace(build.moment((thing,)), mount=None)
    (seen,) = seen_obstacles(moment)
    assert seen.centre_m == pytest.approx([thing.position_m[2], -thing.position_m[0]])


def test_distances_are_those_over_the_floor_from_the_camera() -> None:
    (seen,) = seen_obstacles(build.moment((build.obstacle(4, 4.45, 3.0),)))
    assert seen.centre_m == pytest.approx([4.45, 3.0])
    assert seen.distance_m == pytest.approx(5.0)  # 4 ahead of the camera, 3 to the left


def test_labels_are_sorted_by_deciding_moving_and_nearest() -> None:
    things = (
        build.obstacle(1, 2.0, 0.0),
        build.obstacle(2, 7.0, 0.0),
        build.obstacle(3, 6.0, 0.0, moving=True),
        build.obstacle(4, 8.0, 0.0),
    )
    seen = seen_obstacles(build.moment(things, decided=build.decision(obstacle_id=4)))
    assert [one.obstacle.id for one in seen] == [4, 3, 1, 2]
    assert [one.is_deciding for one in seen] == [True, False, False, False]


def test_an_obstacle_without_a_position_is_not_placed_anywhere() -> None:
    thing = dataclasses.replace(build.obstacle(1, 2.0, 0.0), position_m=np.full(3, math.nan))
    assert seen_obstacles(build.moment((thing,))) == []


def test_labels_say_number_distance_and_speed() -> None:
    moving = build.obstacle(12, 4.45, 3.0, velocity_mps=(0.6, 0.8), moving=True)
    static = build.obstacle(7, 4.45, -3.0)
    unknown = dataclasses.replace(moving, id=13, velocity_mps=np.full(3, math.nan))
    words = {
        one.obstacle.id: one.describe() for one in seen_obstacles(build.moment((moving, static, unknown)))
    }
    assert words == {12: "#12  5.0 m  1.0 m/s", 7: "#7  5.0 m", 13: "#13  5.0 m  speed unknown"}


def test_a_place_that_decides_is_marked_across_the_corridor() -> None:
    """A blind corner, for example, which is no obstacle that could have a box."""
    decided = dataclasses.replace(
        build.decision(), reason=Reason("corner", "a blind corner 3.0 m ahead", distance_m=3.0)
    )
    marked = drawn(build.moment(decided=decided, path_m=build.straight_path()))
    plain = drawn(build.moment(path_m=build.straight_path()))
    at_m = 3.0 + build.BODY.front_m
    assert near(marked, at_m, 0.3, OWN)
    assert not near(plain, at_m, 0.3, OWN)


def test_a_distance_is_read_beside_a_box() -> None:
    """The label of the ring of 4 m moves to the left side where a box covers its place on the right."""
    behind = drawn(build.moment((build.obstacle(4, 3.95, -2.2, size_m=(1.4, 1.0)),)))
    x, y = VIEW.to_pixels(np.array([build.MOUNT.forward_m + math.sqrt(12.0), 2.0])).round().astype(int)
    assert (behind[y - 14 : y - 4, x - 28 : x] > 120).any()
    nothing = drawn(build.moment())
    assert not (nothing[y - 14 : y - 4, x - 28 : x] > 120).any()
