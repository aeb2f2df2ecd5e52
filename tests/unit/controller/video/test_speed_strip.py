import numpy as np
import pytest

from controller.decision.decision import Action
from controller.video.speed_strip import SpeedStrip
from controller.video.style import (
    ACTIONS,
    COMMANDED_SPEED,
    MEASURED_SPEED,
    SPEED_STRIP,
    TARGET_SPEED,
    Colour,
    Image,
)
from tests.support import video_moments as build

SOFT_EDGE = 60
HISTORY_S = 10.0


class Drawing:
    """A strip that is fed with speeds at 10 Hz."""

    def __init__(self) -> None:
        self.strip = SpeedStrip(SPEED_STRIP, 1.5, HISTORY_S)
        self.stamp_ns = 0

    def add(
        self,
        action: Action | None = Action.KEEP,
        target_mps: float = 0.2,
        commanded_mps: float | None = None,
        measured_mps: float | None = None,
        step_s: float = 0.1,
    ) -> Image:
        canvas = np.zeros((720, 1280, 3), np.uint8)
        self.strip.draw_backdrop(canvas)
        decided = None if action is None else build.decision(action, target_mps)
        moment = build.moment(
            decided=decided, captured_ns=self.stamp_ns, speeds_mps=(commanded_mps, measured_mps)
        )
        self.strip.draw(canvas, moment)
        self.stamp_ns += round(step_s * 1e9)
        return SPEED_STRIP.of(canvas)

    def close(self, image: Image, age_s: float, speed_mps: float, colour: Colour) -> bool:
        x, y = self.strip.to_pixels(np.array(age_s), np.array(speed_mps)).round().astype(int)
        around = image[y - 1 : y + 2, x - 1 : x + 2].astype(int)
        return bool((abs(around - colour) < SOFT_EDGE).all(axis=2).any())

    def ribbon(self, image: Image, age_s: float) -> tuple[int, ...]:
        x, y = self.strip.to_pixels(np.array(age_s), np.array(0.0)).round().astype(int)
        return tuple(int(value) for value in image[y + 6, x])


def test_each_speed_is_drawn_at_its_height_in_its_colour() -> None:
    drawing = Drawing()
    for _ in range(30):
        image = drawing.add(target_mps=1.2, commanded_mps=0.8, measured_mps=0.4)
    for speed_mps, colour in ((1.2, TARGET_SPEED), (0.8, COMMANDED_SPEED), (0.4, MEASURED_SPEED)):
        assert drawing.close(image, 1.05, speed_mps, colour)
        assert not drawing.close(image, 4.55, speed_mps, colour)  # before the first moment


def test_now_is_at_the_right_edge_and_the_past_moves_left() -> None:
    drawing = Drawing()
    for k in range(41):
        image = drawing.add(measured_mps=1.0 if k < 20 else 0.5)
    assert drawing.close(image, 0.35, 0.5, MEASURED_SPEED)
    assert drawing.close(image, 2.55, 1.0, MEASURED_SPEED)
    assert not drawing.close(image, 2.55, 0.5, MEASURED_SPEED)


def test_a_target_holds_until_the_next_one() -> None:
    drawing = Drawing()
    drawing.add(target_mps=1.4, step_s=2.0)
    image = drawing.add(target_mps=0.3)
    assert drawing.close(image, 1.05, 1.4, TARGET_SPEED)  # no slope between the two
    assert drawing.close(image, 0.0, 0.8, TARGET_SPEED)  # but a step


def test_an_unknown_speed_leaves_a_gap() -> None:
    drawing = Drawing()
    for k in range(41):
        image = drawing.add(measured_mps=None if 10 <= k < 30 else 0.7, commanded_mps=float("nan"))
    assert drawing.close(image, 0.55, 0.7, MEASURED_SPEED)
    assert drawing.close(image, 3.55, 0.7, MEASURED_SPEED)
    assert not drawing.close(image, 2.05, 0.7, MEASURED_SPEED)


def test_speeds_beyond_the_scale_stay_in_the_plot() -> None:
    drawing = Drawing()
    for _ in range(20):
        image = drawing.add(commanded_mps=9.0, measured_mps=-3.0)
    assert drawing.close(image, 0.55, 1.65, COMMANDED_SPEED)
    assert drawing.close(image, 0.55, 0.0, MEASURED_SPEED)


def test_actions_are_marked_above_the_time_they_were_taken() -> None:
    drawing = Drawing()
    for k in range(91):
        action = Action.INCREASE if k < 30 else Action.KEEP if k < 60 else Action.DECREASE
        image = drawing.add(action)
    assert drawing.ribbon(image, 6.2) == ACTIONS[Action.INCREASE].colour
    assert drawing.ribbon(image, 3.2) == ACTIONS[Action.KEEP].colour
    assert drawing.ribbon(image, 0.2) == ACTIONS[Action.DECREASE].colour
    assert drawing.ribbon(image, 9.5) not in {style.colour for style in ACTIONS.values()}


def test_without_a_decision_nothing_is_marked() -> None:
    drawing = Drawing()
    for _ in range(30):
        image = drawing.add(None, measured_mps=0.5)
    assert drawing.ribbon(image, 1.0) not in {style.colour for style in ACTIONS.values()}
    assert drawing.close(image, 1.05, 0.5, MEASURED_SPEED)


def test_actions_older_than_the_history_are_not_drawn() -> None:
    drawing = Drawing()
    drawing.add(Action.DECREASE, measured_mps=1.4)
    for _ in range(150):
        image = drawing.add(Action.KEEP, measured_mps=0.5)
    assert not (image == ACTIONS[Action.DECREASE].colour).all(axis=2).any()
    assert drawing.close(image, 9.9, 0.5, MEASURED_SPEED)


def test_a_time_that_goes_back_starts_anew() -> None:
    drawing = Drawing()
    for _ in range(40):
        drawing.add(Action.DECREASE, measured_mps=1.4)
    drawing.stamp_ns = 0
    for _ in range(10):
        image = drawing.add(Action.KEEP, measured_mps=0.5)
    assert not (image == ACTIONS[Action.DECREASE].colour).all(axis=2).any()
    assert not drawing.close(image, 0.85, 1.4, MEASURED_SPEED)


def test_the_scales_meet_the_corners_of_the_plot() -> None:
    strip = SpeedStrip(SPEED_STRIP, 1.5, HISTORY_S)
    right, bottom = strip.to_pixels(np.array(0.0), np.array(0.0))
    left, top = strip.to_pixels(np.array(HISTORY_S), np.array(1.65))
    assert (left, top) == pytest.approx((36, 8))
    assert right < SPEED_STRIP.width
    assert bottom < SPEED_STRIP.height
