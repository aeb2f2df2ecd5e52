import dataclasses

import numpy as np
import pytest

from controller.video.depth_view import DepthView, colour_table
from controller.video.moment import VideoMoment
from controller.video.seen_obstacles import seen_obstacles
from controller.video.style import DEPTH_SCALE, DEPTH_VIEW, NO_DEPTH, OWN, Image
from hal.types import DepthImage
from tests.support import video_moments as build

RANGE_M = 10.0


def drawn(moment: VideoMoment) -> Image:
    view = DepthView(DEPTH_VIEW, DEPTH_SCALE, RANGE_M)
    canvas = np.zeros((720, 1280, 3), np.uint8)
    view.draw_backdrop(canvas)
    view.draw(canvas, moment, seen_obstacles(moment))
    return DEPTH_VIEW.of(canvas)


def with_depth(depth: DepthImage, scale_m: float = 0.001) -> VideoMoment:
    moment = build.moment()
    return dataclasses.replace(
        moment, frame=dataclasses.replace(moment.frame, depth=depth, depth_scale_m=scale_m)
    )


def uniform(depth_m: float, scale_m: float = 0.001) -> VideoMoment:
    return with_depth(np.full((480, 640), round(depth_m / scale_m), np.uint16), scale_m)


@pytest.mark.parametrize("scale_m", [0.001, 0.0002])
@pytest.mark.parametrize("depth_m", [0.1, 2.5, 7.0, 10.0])
def test_the_colour_is_that_of_the_distance(depth_m: float, scale_m: float) -> None:
    level = round(255.0 * depth_m / RANGE_M)
    assert (drawn(uniform(depth_m, scale_m)) == colour_table()[level]).all()


def test_beyond_the_range_is_the_farthest_colour() -> None:
    assert (drawn(uniform(40.0)) == colour_table()[255]).all()


def test_no_data_is_dark_and_not_mixed_with_its_neighbours() -> None:
    depth = np.full((480, 640), 3000, np.uint16)
    depth[:, :320] = 0
    image = drawn(with_depth(depth))
    assert (image[:, :115] == NO_DEPTH).all()
    assert len(np.unique(image.reshape(-1, 3), axis=0)) == 2


def test_near_is_bright_and_every_step_is_darker() -> None:
    table = colour_table()[1:].astype(float)
    luminance = table @ [0.114, 0.587, 0.299]
    assert luminance[0] > 200
    assert (np.diff(luminance) < 1.0).all()
    assert luminance[-1] > 1.5 * np.dot(NO_DEPTH, [0.114, 0.587, 0.299])


def test_the_scale_runs_from_near_to_far() -> None:
    canvas = np.zeros((720, 1280, 3), np.uint8)
    DepthView(DEPTH_VIEW, DEPTH_SCALE, RANGE_M).draw_backdrop(canvas)
    bar = DEPTH_SCALE.of(canvas)[3]
    assert bar[0].tolist() == colour_table()[1].tolist()
    assert bar[-1].tolist() == colour_table()[255].tolist()


def test_obstacles_are_outlined_at_their_place() -> None:
    thing = build.obstacle(3, 3.0, 0.3, moving=True, size_m=(0.6, 0.8))
    moment = dataclasses.replace(uniform(3.0), scene=build.scene((thing,)))
    u0, v0, _, v1 = (round(edge * DEPTH_VIEW.width / 640) for edge in thing.bbox_px)
    assert (drawn(moment)[(v0 + v1) // 2, u0 - 1 : u0 + 2].min(axis=1) > min(OWN) - 60).any()


def test_a_wide_depth_image_keeps_its_shape() -> None:
    image = drawn(with_depth(np.full((360, 640), 3000, np.uint16)))
    assert (image[5] == NO_DEPTH).all()
    assert (image[DEPTH_VIEW.height // 2] == colour_table()[round(25.5 * 3)]).all()
