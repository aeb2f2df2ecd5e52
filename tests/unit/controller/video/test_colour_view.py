import dataclasses
import math

import cv2
import numpy as np
import pytest

from config.own_parts import OwnPart
from controller.video.colour_view import ColourView
from controller.video.corridor import corridor_ahead
from controller.video.moment import VideoMoment
from controller.video.placement import placement
from controller.video.seen_obstacles import seen_obstacles
from controller.video.style import (
    ALARM,
    COLOUR_VIEW,
    MOVING,
    OWN,
    PANEL,
    STATIC,
    UNMEASURED,
    WARNING,
    Colour,
    Image,
    Rect,
)
from hal.box_view import box_view
from hal.types import Intrinsics
from tests.support import video_moments as build
from vision.scene import CameraCondition

SOFT_EDGE = 45


def drawn(moment: VideoMoment) -> Image:
    view = ColourView(COLOUR_VIEW)
    canvas = np.zeros((720, 1280, 3), np.uint8)
    view.draw_backdrop(canvas)
    view.draw(canvas, moment, seen_obstacles(moment), corridor_ahead(moment, 10.0))
    return COLOUR_VIEW.of(canvas)


def close(image: Image, u: float, v: float, colour: Colour) -> bool:
    around = image[round(v) - 1 : round(v) + 2, round(u) - 1 : round(u) + 2].astype(int)
    return bool((abs(around - colour) < SOFT_EDGE).all(axis=2).any())


def test_an_image_of_the_panels_size_is_not_resampled() -> None:
    assert placement(640, 480, COLOUR_VIEW).place == Rect(0, 0, 640, 480)
    noise = np.random.default_rng(1).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    moment = build.moment()
    image = drawn(dataclasses.replace(moment, frame=dataclasses.replace(moment.frame, colour=noise)))
    assert abs(image - 0.82 * noise).max() <= 0.5 + 1e-9  # rounded once


def test_a_wider_image_stands_whole_in_the_middle() -> None:
    placed = placement(1280, 720, COLOUR_VIEW)
    assert placed.place == Rect(0, 60, 640, 360)
    assert placed.to_panel(np.array([[-0.5, -0.5], [1279.5, 719.5]])).tolist() == [
        [-0.5, 59.5],
        [639.5, 419.5],
    ]


def test_around_a_wider_image_the_panel_is_empty() -> None:
    wide = Intrinsics(1280, 720, 900.0, 900.0, 639.5, 359.5)
    moment = dataclasses.replace(build.moment(), frame=build.frame(intrinsics=wide))
    image = drawn(moment)
    assert tuple(image[20, 320].tolist()) == PANEL
    assert tuple(image[460, 320].tolist()) == PANEL
    assert image[80, 320].tolist() == [123, 123, 123]  # 0.82 * 150: the wall


def test_fragments_of_a_wider_image_are_scaled_with_it() -> None:
    wide = Intrinsics(1280, 720, 900.0, 900.0, 639.5, 359.5)
    segment = build.fragments(np.array([[[200.0, 200.0], [400.0, 200.0]]]), [True], [True])
    moment = build.moment(seen_fragments=segment)
    image = drawn(dataclasses.replace(moment, frame=build.frame(intrinsics=wide)))
    assert close(image, 150, 160, MOVING)  # half the size, 60 rows down
    assert not close(image, 200, 200, MOVING)


def test_fragments_are_coloured_by_what_is_known_of_them() -> None:
    ends = np.array([[[100, y], [200, y]] for y in (50, 80, 110, 140)], float)
    segments = build.fragments(ends, [False, True, False, True], [True, True, False, False])
    image = drawn(build.moment(seen_fragments=segments))
    assert close(image, 150, 50, STATIC)
    assert close(image, 150, 80, MOVING)
    assert close(image, 150, 110, UNMEASURED)
    assert close(image, 150, 140, MOVING)
    assert not close(image, 250, 80, MOVING)


def test_a_fragment_without_a_place_is_left_out() -> None:
    segments = build.fragments(np.array([[[100.0, 50.0], [math.nan, 50.0]]]), [True], [True])
    plain = drawn(build.moment())
    assert (drawn(build.moment(seen_fragments=segments)) == plain).all()


@pytest.mark.parametrize(("moving", "colour"), [(True, MOVING), (False, STATIC)])
def test_an_obstacle_has_its_box_and_a_label(moving: bool, colour: Colour) -> None:
    thing = build.obstacle(3, 5.0, 0.5, velocity_mps=(0.0, -1.0), moving=moving, size_m=(0.6, 0.7))
    u0, v0, u1, v1 = thing.bbox_px
    image = drawn(build.moment((thing,)))
    for u, v in ((u0, 0.5 * (v0 + v1)), (u1, 0.5 * (v0 + v1)), (0.5 * (u0 + u1), v1)):
        assert tuple(image[round(v), round(u)].tolist()) == colour
    above = image[round(v0) - 18 : round(v0) - 4, round(u0) : round(u0) + 50]
    assert (above == colour).all(axis=2).any()


def test_mover_has_the_thicker_box() -> None:
    def thickness(moving: bool) -> int:
        thing = build.obstacle(3, 5.0, 0.0, moving=moving, size_m=(0.6, 0.7))
        u0, v0, _, v1 = (round(edge) for edge in thing.bbox_px)
        row = drawn(build.moment((thing,)))[(v0 + v1) // 2, u0 - 8 : u0 + 8]
        return int((row == (MOVING if moving else STATIC)).all(axis=1).sum())

    assert thickness(moving=True) > thickness(moving=False) > 0


def test_an_obstacle_that_is_only_predicted_is_dashed() -> None:
    thing = build.obstacle(3, 4.0, 0.0, size_m=(0.6, 0.9))
    u0, v0, _, v1 = (round(edge) for edge in thing.bbox_px)

    def inked_share(unseen_s: float) -> float:
        image = drawn(build.moment((dataclasses.replace(thing, unseen_s=unseen_s),)))
        edge = image[v0 + 5 : v1 - 5, u0]
        return float((edge == STATIC).all(axis=1).mean())

    assert inked_share(0.0) == 1.0
    assert 0.2 < inked_share(0.3) < 0.8


def test_unseen_obstacle_is_drawn_at_its_predicted_place() -> None:
    # Seen last at the left; a metre to the right by now. Level, so that its surface is as the box was.
    old = build.obstacle(3, 4.0, 0.5, size_m=(0.6, 0.9))
    now = build.obstacle(3, 4.0, -0.5, size_m=(0.6, 0.9))
    gone = dataclasses.replace(now, bbox_px=old.bbox_px, unseen_s=0.1)
    image = drawn(build.moment((gone,)))

    def inked(u: float, v0: float, v1: float) -> bool:
        return bool((image[round(v0) + 5 : round(v1) - 5, round(u)] == STATIC).all(axis=1).any())

    assert not inked(old.bbox_px[0], old.bbox_px[1], old.bbox_px[3])
    x, y, z = now.position_m
    left_px = 610.0 * (x - 0.3) / z + 319.5
    top_px, bottom_px = (610.0 * (y + half) / z + 239.5 for half in (-0.45, 0.45))
    assert inked(left_px, top_px, bottom_px)


@pytest.mark.parametrize("z_m", [-1.0, 0.0, math.nan])
def test_obstacle_predicted_behind_the_camera_has_no_box(z_m: float) -> None:
    thing = dataclasses.replace(
        build.obstacle(3, 4.0, 0.0), position_m=np.array([0.0, 0.0, z_m]), unseen_s=0.1
    )
    image = drawn(build.moment((thing,)))
    assert not (image == STATIC).all(axis=2).any()


def test_deciding_obstacle_is_framed() -> None:
    thing = build.obstacle(3, 4.0, 0.0, moving=True, size_m=(0.6, 0.9))
    u0, v0, _, v1 = (round(edge) for edge in thing.bbox_px)

    def framed(deciding: int | None) -> bool:
        image = drawn(build.moment((thing,), decided=build.decision(obstacle_id=deciding)))
        return bool((abs(image[(v0 + v1) // 2, u0 - 5 : u0].astype(int) - OWN) < SOFT_EDGE).all(axis=1).any())

    assert framed(3)
    assert not framed(8)
    assert not framed(None)


def test_an_obstacle_without_a_box_is_no_error() -> None:
    thing = dataclasses.replace(build.obstacle(3, 4.0, 0.0), bbox_px=(math.nan,) * 4)
    image = drawn(build.moment((thing,)))
    assert not (image == STATIC).all(axis=2).any()


def test_the_corridor_lies_on_the_floor() -> None:
    # The point 4.45 m ahead and 0.5 m left on the floor: 4 m ahead of the camera, 0.6 m below it.
    pitch = build.MOUNT.pitch_rad
    z = 4.0 * math.cos(pitch) + 0.6 * math.sin(pitch)
    y = 0.6 * math.cos(pitch) - 4.0 * math.sin(pitch)
    u, v = 319.5 - 610.0 * 0.5 / z, 239.5 + 610.0 * y / z
    image = drawn(build.moment(path_m=build.straight_path()))
    plain = drawn(build.moment())
    assert image[round(v), round(u)].max() > 200
    assert (image[round(v), 320] > plain[round(v), 320]).all()  # tinted within
    assert (image[round(v), round(u) - 12] == plain[round(v), round(u) - 12]).all()


def test_without_a_mount_the_floor_is_not_known() -> None:
    moment = build.moment(path_m=build.straight_path())
    assert (drawn(dataclasses.replace(moment, mount=None)) == drawn(build.moment())).all()


def test_a_path_behind_the_camera_is_not_drawn_upside_down() -> None:
    backwards = build.moment(path_m=-build.straight_path())
    assert (drawn(backwards) == drawn(build.moment())).all()


@pytest.mark.parametrize(
    ("condition", "colour"), [(CameraCondition.DEGRADED, WARNING), (CameraCondition.UNTRUSTWORTHY, ALARM)]
)
def test_a_camera_that_is_not_good_has_a_banner(condition: CameraCondition, colour: Colour) -> None:
    image = drawn(build.moment(condition=condition, reason="half of the depth is missing"))
    assert tuple(image[-3, 600].tolist()) == colour
    assert tuple(drawn(build.moment())[-3, 600].tolist()) != colour


def test_no_label_covers_the_banner() -> None:
    thing = dataclasses.replace(build.obstacle(3, 4.0, 0.0), bbox_px=(200.0, 3.0, 300.0, 452.0))
    with_thing = drawn(build.moment((thing,), condition=CameraCondition.DEGRADED, reason="dark"))
    without = drawn(build.moment(condition=CameraCondition.DEGRADED, reason="dark"))
    assert (with_thing[-24:] == without[-24:]).all()


def test_the_cameras_image_is_left_as_it_is() -> None:
    moment = build.moment((build.obstacle(3, 4.0, 0.0, moving=True),), path_m=build.straight_path())
    before = moment.frame.colour.copy()
    drawn(moment)
    assert (moment.frame.colour == before).all()


def test_the_outline_of_an_own_part_is_dashed_around_its_silhouette() -> None:
    """A bumper across the view, whose far upper edge is seen."""
    moment = build.moment()
    assert moment.mount is not None
    forward_m, height_m = moment.mount.forward_m, moment.mount.height_m
    bumper = OwnPart(
        name="bumper",
        from_m=(forward_m + 0.4, -0.1, height_m - 0.3),
        to_m=(forward_m + 0.5, 0.1, height_m - 0.1),
    )
    without, drawn_on = drawn(moment), drawn(dataclasses.replace(moment, own_parts=(bumper,)))
    changed = (without != drawn_on).any(axis=2)
    seen = box_view(bumper, moment.mount, moment.frame.intrinsics).seen.astype(np.uint8)
    # It ends at the border of the image, too. A dash may cut a corner by a few pixels.
    around = cv2.copyMakeBorder(seen, 9, 9, 9, 9, cv2.BORDER_CONSTANT, value=0)
    rim = cv2.dilate(around, np.ones((9, 9), np.uint8)) - cv2.erode(around, np.ones((9, 9), np.uint8))
    assert not changed[rim[9:-9, 9:-9] == 0].any()
    # About half of it, as it is dashed; a line is drawn with soft edges.
    outline_px = cv2.arcLength(cv2.findContours(seen, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0][0], True)
    assert 0.4 * outline_px < np.count_nonzero(changed) < 2.0 * outline_px


def test_without_a_mounting_no_own_part_is_drawn() -> None:
    part = OwnPart(name="bumper", from_m=(0.4, -0.1, 0.2), to_m=(0.5, 0.1, 0.4))
    moment = dataclasses.replace(build.moment(), mount=None)
    assert (drawn(moment) == drawn(dataclasses.replace(moment, own_parts=(part,)))).all()
