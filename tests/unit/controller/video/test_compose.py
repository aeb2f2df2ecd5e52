import dataclasses
import math
from itertools import combinations

import numpy as np
import pytest

from controller.decision.decision import Action, Reason
from controller.video import Composer, VideoMoment, text
from controller.video.compose import range_for
from controller.video.seen_obstacles import seen_obstacles
from controller.video.style import (
    ACTIONS,
    COLOUR_VIEW,
    DEPTH_SCALE,
    DEPTH_VIEW,
    HEADER,
    HEALTH,
    HEIGHT_PX,
    LEGEND,
    MOVING,
    SPEED_STRIP,
    STATIC,
    TOP_VIEW,
    WIDTH_PX,
    Image,
    Rect,
    bgr,
)
from tests.support import video_moments as build
from vision.scene import CameraCondition

PANELS = (HEADER, COLOUR_VIEW, DEPTH_VIEW, DEPTH_SCALE, LEGEND, SPEED_STRIP, TOP_VIEW)


def busy_moment(captured_ns: int = 0) -> VideoMoment:
    things = (
        build.obstacle(3, 5.0, 0.4, velocity_mps=(0.0, -1.1), moving=True),
        build.obstacle(7, 3.0, -0.9, size_m=(0.6, 0.5)),
        build.obstacle(9, 8.0, 1.2, unseen_s=0.2),
    )
    ends = np.array([[[100.0, 80.0], [180.0, 120.0]], [[300.0, 200.0], [340.0, 260.0]]])
    return build.moment(
        things,
        build.fragments(ends, [False, True], [True, True]),
        build.decision(Action.DECREASE, 0.62, obstacle_id=3),
        captured_ns=captured_ns,
        path_m=build.straight_path(),
    )


def test_panels_stand_inside_the_picture_and_apart() -> None:
    assert all(Rect(0, 0, WIDTH_PX, HEIGHT_PX).contains(panel) for panel in PANELS)
    assert not any(one.overlaps(other) for one, other in combinations(PANELS, 2))


def test_a_picture_is_1280_by_720_and_in_the_colours_of_the_palette() -> None:
    picture = Composer().compose(busy_moment())
    assert picture.shape == (720, 1280, 3)
    assert picture.dtype == np.uint8
    for panel in (COLOUR_VIEW, TOP_VIEW, LEGEND):
        for colour in (STATIC, MOVING):
            assert (panel.of(picture) == colour).all(axis=2).any()


def test_no_panel_spills_over_its_border() -> None:
    composer = Composer()
    calm = composer.compose(build.moment())
    crowded = tuple(
        build.obstacle(
            n, 0.8 + 0.4 * n, -3.0 + 0.3 * n, velocity_mps=(-3.0, 2.0), moving=n % 2 == 0, size_m=(2.0, 2.5)
        )
        for n in range(20)
    )
    ends = np.random.default_rng(3).uniform(-300, 900, (200, 2, 2))
    segments = build.fragments(ends, [True] * 200, [True] * 200)
    busy = composer.compose(
        build.moment(crowded, segments, condition=CameraCondition.DEGRADED, reason="dark " * 60)
    )
    margins = np.ones(calm.shape[:2], np.bool_)
    for panel in PANELS:
        margins[panel.y : panel.bottom, panel.x : panel.right] = False
    for panel in (COLOUR_VIEW, DEPTH_VIEW, SPEED_STRIP, TOP_VIEW):  # the captions above change
        margins[panel.y - 18 : panel.y, panel.x : panel.right] = False
    assert (busy[margins] == calm[margins]).all()
    assert (LEGEND.of(busy) == LEGEND.of(calm)).all()


def test_the_same_moments_give_the_same_pictures() -> None:
    first, second = Composer(), Composer()
    for stamp_ns in (0, 33_000_000, 66_000_000):
        a, b = first.compose(busy_moment(stamp_ns)), second.compose(busy_moment(stamp_ns))
        assert (a == b).all()


def test_pictures_are_not_written_over_by_later_ones() -> None:
    composer = Composer()
    first = composer.compose(busy_moment())
    kept = first.copy()
    composer.compose(build.moment(captured_ns=10**8))
    assert (first == kept).all()


def test_nothing_but_a_frame_is_needed() -> None:
    moment = busy_moment()
    bare = VideoMoment(
        moment.frame, build.scene(free=build.free_space(math.nan, math.nan)), build.NO_FRAGMENTS
    )
    picture = Composer().compose(bare)
    chip = HEADER.of(picture)[10, 12]
    assert tuple(chip.tolist()) not in {style.colour for style in ACTIONS.values()}


@pytest.mark.parametrize("action", list(Action))
def test_the_header_shows_the_action(action: Action) -> None:
    picture = Composer().compose(build.moment(decided=build.decision(action)))
    assert tuple(HEADER.of(picture)[10, 12].tolist()) == ACTIONS[action].colour


def test_an_emergency_is_framed() -> None:
    decision = build.decision(Action.DECREASE, 0.0)

    def chip(emergency: bool) -> list[int]:
        decided = dataclasses.replace(decision, emergency=emergency)
        corner: list[int] = HEADER.of(Composer().compose(build.moment(decided=decided)))[8, 14].tolist()
        return corner

    assert tuple(chip(emergency=False)) == ACTIONS[Action.DECREASE].colour
    assert tuple(chip(emergency=True)) == bgr("F4F6F8")


@pytest.mark.parametrize("condition", list(CameraCondition))
def test_the_header_shows_the_cameras_health(condition: CameraCondition) -> None:
    header = HEADER.of(Composer().compose(build.moment(condition=condition, reason="why")))
    others = [colour for other, colour in HEALTH.items() if other is not condition]
    dot = header[:, 825:850]
    assert (dot == HEALTH[condition]).all(axis=2).any()
    assert not any((dot == colour).all(axis=2).any() for colour in others)


def header_with(sentence: str) -> Image:
    decision = dataclasses.replace(build.decision(), reason=Reason("free", sentence))
    return HEADER.of(Composer().compose(build.moment(decided=decision))).copy()


def test_a_long_reason_stays_clear_of_what_stands_beside_it() -> None:
    short, long = header_with("free"), header_with("because of this and that " * 20)
    assert (short[:, 826:] == long[:, 826:]).all()
    assert (short[:, :224] == long[:, :224]).all()
    assert (long[4:20, 240:800] != long[0, 240]).any()  # both of its lines are there
    assert (long[24:40, 240:800] != long[0, 240]).any()


@pytest.mark.parametrize("repeats", range(1, 9))
def test_a_reason_stands_in_the_middle_of_the_header(repeats: int) -> None:
    lines = header_with("the way is free " * repeats)[:, 240:820]
    rows = np.flatnonzero((lines != lines[0, 0]).any(axis=(1, 2)))
    assert 0.5 * (rows[0] + rows[-1]) == pytest.approx(HEADER.height / 2, abs=4.0)


def test_a_number_and_its_unit_stay_on_one_line() -> None:
    sentence = "waiting to speed up; last limit: obstacle 91, 5.0 m ahead, could step in: at most 1.00 m/s"
    for width_px in range(120, 620, 10):
        lines = text.wrap(sentence, width_px, 9, 13)
        assert " ".join(lines) == sentence
        assert not any(line.startswith(("m ", "m/s")) for line in lines)


def test_the_last_frames_tell_how_the_drive_ended() -> None:
    undecided = dataclasses.replace(busy_moment(), decision=None)
    ended = dataclasses.replace(undecided, ending="target reached")
    assert (HEADER.of(Composer().compose(ended)) != HEADER.of(Composer().compose(undecided))).any()


def near_moment(depth_m: float) -> VideoMoment:
    frame = build.frame()
    depth = np.full_like(frame.depth, round(depth_m / frame.depth_scale_m))
    return dataclasses.replace(build.moment(), frame=dataclasses.replace(frame, depth=depth))


def test_the_scale_is_that_of_what_is_seen_and_only_grows() -> None:
    composer = Composer(range_m=10.0)

    def scale(depth_m: float) -> Image:
        return DEPTH_SCALE.of(composer.compose(near_moment(depth_m))).copy()

    near, middle, far = scale(1.2), scale(3.5), scale(9.0)
    assert (near != middle).any()
    assert (middle != far).any()
    assert (scale(1.2) == far).all()
    assert (scale(50.0) == far).all()


def test_a_mover_beyond_the_depth_is_in_the_range() -> None:
    moment = near_moment(1.2)
    mover = build.moment((build.obstacle(3, 5.0, 0.4, velocity_mps=(0.0, -1.1), moving=True),))
    moment = dataclasses.replace(mover, frame=moment.frame)
    assert range_for(moment, seen_obstacles(moment), 10.0) == 6.0


def test_time_counts_from_the_first_moment() -> None:
    composer = Composer()
    late_ns = 1_305_031_098_665_300_000
    first = HEADER.of(composer.compose(busy_moment(late_ns))).copy()
    assert (first == HEADER.of(Composer().compose(busy_moment(0)))).all()
    assert (first != HEADER.of(composer.compose(busy_moment(late_ns + 10**9)))).any()


def test_a_hue_is_read_as_it_is_written() -> None:
    assert bgr("56B4E9") == (0xE9, 0xB4, 0x56)
