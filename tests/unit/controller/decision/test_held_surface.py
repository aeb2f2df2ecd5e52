"""A surface that leaves the view while the robot drives is held; at rest, only one that was there long."""

from __future__ import annotations

import math

import pytest

from controller.decision.held_surface import HeldSurface, Nearest

FRAME_NS = 33_333_333
BLIND_M = 1.5  # ahead of the robot, where surfaces may leave the view


class Drive:
    """Notes what is seen at each place of a drive at 1.2 m/s, 30 frames a second."""

    def __init__(self) -> None:
        self.held, self.s_m, self.frame = HeldSurface(), 0.0, 0

    def on(self, nearest_s_m: float, frames: int) -> float:
        for _ in range(frames):
            self.s_m += 0.04
            self._note(nearest_s_m, standing=False)
        return self.held.s_m

    def on_explained(self, explained_s_m: float, frames: int) -> float:
        """The surface is seen as before, but belongs to a body now."""
        for _ in range(frames):
            self.s_m += 0.01
            self._note(math.inf, standing=False, explained_s_m=explained_s_m)
        return self.held.s_m

    def rest(self, nearest_s_m: float, frames: int = 5) -> float:
        for _ in range(frames):
            self._note(nearest_s_m, standing=True)
        return self.held.s_m

    def on_beside_mover(self, nearest_s_m: float, frames: int, in_swept_width: bool = True) -> float:
        for _ in range(frames):
            self.s_m += 0.04
            self._note(nearest_s_m, False, beside_mover=True, in_swept_width=in_swept_width)
        return self.held.s_m

    def _note(
        self,
        nearest_s_m: float,
        standing: bool,
        explained_s_m: float = math.inf,
        beside_mover: bool = False,
        in_swept_width: bool = True,
    ) -> None:
        self.frame += 1
        blind_s_m = self.s_m + BLIND_M
        now_ns = self.frame * FRAME_NS
        nearest = Nearest(nearest_s_m, beside_mover, in_swept_width)
        self.held.note(nearest, self.s_m, blind_s_m, now_ns, standing, explained_s_m)


def seen_until_below_the_view(frames_before: int) -> Drive:
    """A surface at 2.4 m, in sight for the last frames_before of 28 frames, then below the view."""
    drive = Drive()
    drive.on(math.inf, 28 - frames_before)
    drive.on(2.4, frames_before)
    drive.on(math.inf, 5)
    return drive


def test_one_that_was_seen_for_half_a_second_is_held_at_rest() -> None:
    drive = seen_until_below_the_view(20)
    assert drive.held.s_m == pytest.approx(2.4)
    assert drive.rest(math.inf, 300) == pytest.approx(2.4)


def test_one_that_was_seen_for_a_moment_is_held_while_the_robot_drives() -> None:
    """Such as a walker's last strip at the edge of the view."""
    drive = seen_until_below_the_view(6)
    assert drive.on(math.inf, 5) == pytest.approx(2.4)
    assert drive.rest(math.inf) == math.inf


def test_one_that_belongs_to_a_body_now_has_not_left_the_view() -> None:
    """The flank of a truck right before the robot: too large for a box until only its end is in view."""
    drive = Drive()
    drive.on(2.4, 28)
    assert drive.on_explained(2.45, 30) == math.inf
    assert drive.on(math.inf, 5) == math.inf
    assert drive.rest(math.inf) == math.inf


def test_one_beside_a_mover_may_be_a_part_of_it_and_is_not_held_at_rest() -> None:
    """The rest of a vehicle that crosses right before the robot, which no box covers."""
    drive = Drive()
    drive.on_beside_mover(2.4, 28)
    assert drive.on(math.inf, 5) == pytest.approx(2.4)
    assert drive.rest(math.inf) == math.inf


def test_one_beside_the_swept_width_that_was_only_seen_beside_a_mover_has_gone_with_it() -> None:
    """The rear of a vehicle that has just crossed: no box covers it, and the robot passes behind it."""
    drive = Drive()
    drive.on(math.inf, 10)
    assert drive.on_beside_mover(2.4, 18, in_swept_width=False) == pytest.approx(2.4)
    assert drive.on(math.inf, 5) == math.inf


@pytest.mark.parametrize("frames_alone", [1, 20])
def test_one_beside_the_swept_width_that_was_seen_without_a_mover_is_held(frames_alone: int) -> None:
    drive = Drive()
    drive.on_beside_mover(2.4, 8, in_swept_width=False)
    drive.on(2.4, frames_alone)
    drive.on_beside_mover(2.4, 20 - frames_alone, in_swept_width=False)
    assert drive.on(math.inf, 5) == pytest.approx(2.4)


def test_one_beside_the_swept_width_that_no_mover_was_beside_is_held() -> None:
    """A wall, or a crate that sinks below the view."""
    drive = Drive()
    for _ in range(28):
        drive.s_m += 0.04
        drive._note(2.4, standing=False, in_swept_width=False)
    assert drive.on(math.inf, 5) == pytest.approx(2.4)


def test_one_that_was_there_before_a_mover_passed_it_is_held_at_rest() -> None:
    drive = Drive()
    drive.on(2.4, 20)
    drive.on_beside_mover(2.4, 10)
    drive.on(math.inf, 5)
    assert drive.rest(math.inf, 300) == pytest.approx(2.4)


def test_a_body_elsewhere_explains_nothing() -> None:
    drive = Drive()
    drive.on(2.4, 28)
    drive.on_explained(3.0, 5)
    assert drive.rest(math.inf, 300) == pytest.approx(2.4)


def test_a_moment_does_not_replace_what_lasts() -> None:
    drive = seen_until_below_the_view(20)
    drive.on(2.0, 4)
    assert drive.on(math.inf, 4) == pytest.approx(2.0)
    assert drive.rest(math.inf) == pytest.approx(2.4)


def test_seen_again_at_rest_and_then_gone() -> None:
    drive = seen_until_below_the_view(20)
    assert drive.rest(2.45) == pytest.approx(2.4)
    assert drive.rest(math.inf) == math.inf


def test_what_was_seen_there_during_an_earlier_standstill_is_not_missed() -> None:
    """Between the two it sank below the view again."""
    drive = seen_until_below_the_view(20)
    drive.rest(2.4)
    drive.on(2.4, 2)
    drive.on(math.inf, 5)
    assert drive.rest(math.inf) == pytest.approx(2.4)


def test_another_one_behind_it_that_goes_does_not_take_it_along() -> None:
    drive = seen_until_below_the_view(20)
    drive.rest(4.0)
    assert drive.rest(math.inf) == pytest.approx(2.4)


def test_one_farther_away_than_where_surfaces_leave_the_view_has_gone() -> None:
    drive = Drive()
    drive.on(6.0, 20)
    assert drive.on(math.inf, 5) == math.inf


def test_it_is_forgotten_behind_the_robot() -> None:
    drive = seen_until_below_the_view(20)
    assert drive.on(math.inf, 40) == math.inf
