"""Two encoders by hand: 1000 counts a metre, tracks 0.5 m apart, 0.8 m/s at the most."""

from __future__ import annotations

import math

import pytest

from hal.chassis.encoder_feedback import EncoderFeedback
from hal.chassis.tracks import TrackGeometry

STEP_NS = 100_000_000


class Answers(EncoderFeedback):
    """Counters that answer every 0.1 s; the right one counts down when its track goes ahead."""

    def __init__(self, *, checksum: bool = True, counter_bits: int = 32) -> None:
        super().__init__(
            TrackGeometry(0.5, 1.0), 1000.0, (1, -1), 0.8, checksum=checksum, counter_bits=counter_bits
        )
        self.now_ns = 0

    def answer(self, left: int, right: int, after_ns: int = STEP_NS) -> None:
        self.now_ns += after_ns
        self._take_counters(left, right, self.now_ns, self.now_ns)


def test_speeds_are_counter_steps_over_time() -> None:
    """40 mm and 60 mm in 0.1 s: 0.5 m/s ahead, (0.6 - 0.4) m/s / 0.5 m to the left."""
    told = Answers()
    told.answer(7, 9)
    assert math.isnan(told.v_mps)
    told.answer(47, -51)
    assert (told.v_mps, told.w_radps) == pytest.approx((0.5, 0.4))
    assert not told.standing
    assert (told.pose.x_m, told.pose.heading_rad) == pytest.approx((0.05, 0.04), abs=1e-4)
    told.answer(47, -51)
    assert told.standing


def test_two_answers_to_one_moment_are_no_speed() -> None:
    told = Answers()
    told.answer(0, 0)
    told.answer(40, -40)
    told.answer(41, -41, after_ns=0)
    assert told.v_mps == pytest.approx(0.4)


@pytest.mark.parametrize(("step", "believed"), [(169, True), (171, False)])
def test_a_step_beyond_what_the_tracks_can_do_is_a_restart(step: int, believed: bool) -> None:
    """1.5 x 0.8 m/s x 0.1 s + 0.05 m = 0.17 m."""
    told = Answers()
    told.answer(0, 0)
    told.answer(step, 0)
    assert math.isfinite(told.v_mps) == believed
    assert (told.pose.x_m > 0.0) == believed


@pytest.mark.parametrize("checksum", [True, False])
def test_counters_of_16_bits_go_on_where_they_wrap(checksum: bool) -> None:
    told = Answers(checksum=checksum, counter_bits=16)
    for left, right in ((65_500, 20), (4, 65_516), (44, 65_476)):
        told.answer(left, right)
    assert told.v_mps == pytest.approx(0.4)
    assert told.pose.x_m == pytest.approx(0.08)
    assert not told._restarted


def test_turning_on_the_spot_is_not_standing() -> None:
    told = Answers()
    told.answer(0, 0)
    told.answer(2, 2)
    assert told.v_mps == 0.0
    assert not told.standing


def counted(*counts: int, checksum: bool = True) -> Answers:
    """Both tracks ahead alike, every 0.1 s."""
    told = Answers(checksum=checksum)
    for count in counts:
        told.answer(count, -count)
    return told


@pytest.mark.parametrize(
    "counts",
    [
        (0, 10, 40, 70, 0),
        (0, 10, 40, 70, 12),  # it set off again at once
        (0, 10, 40, 70, 70, 70, 3),  # it stood
        (0, 0, 11, 0),
    ],
)
def test_back_at_zero_against_its_way_is_a_restart(counts: tuple[int, ...]) -> None:
    told = counted(*counts)
    assert math.isnan(told.v_mps)
    assert told.pose.x_m == pytest.approx(counts[-2] / 1000.0), "no travel backwards"


@pytest.mark.parametrize(
    "counts",
    [
        (0, 10, 40, 70, 72, 70, 66),  # it stops, and rolls back a little
        (0, 10, 8, 0),  # less than a track may roll back
        (200, 170, 130, 90, 50, 10, -30, -70),  # it comes backwards through 0
        (60, 50, 30, 5, -25),
        (0, 10, 90, 95, 40),  # far back, but not to 0
    ],
)
def test_other_ways_through_zero_are_travel(counts: tuple[int, ...]) -> None:
    told = counted(*counts)
    assert math.isfinite(told.v_mps)
    assert told.pose.x_m == pytest.approx((counts[-1] - counts[0]) / 1000.0)


def test_turning_back_on_the_spot_through_zero_is_travel() -> None:
    told = Answers()
    for count in (0, 20, 50, 60, 55, 35, 10, -15):
        told.answer(-count, -count)
    assert math.isfinite(told.w_radps)
    assert told.pose.heading_rad == pytest.approx(2 * -0.015 / 0.5)


def test_one_track_alone_at_zero_is_no_restart() -> None:
    told = Answers()
    for left, right in ((0, 0), (10, 0), (40, 20), (25, 50)):
        told.answer(left, -right)
    assert math.isfinite(told.v_mps)


@pytest.mark.parametrize("wrong", [9_140, -140, 100_140, 0])
def test_without_a_checksum_a_single_jump_is_dropped(wrong: int) -> None:
    told = counted(50, 90, 130, checksum=False)
    heard_ns, v_mps = told.feedback_ns, told.v_mps
    told.answer(wrong, -wrong)
    assert (told.feedback_ns, told.v_mps) == (heard_ns, v_mps), "as if no answer had come"
    assert told.pose.x_m == pytest.approx(0.08)
    told.answer(210, -210)
    assert told.v_mps == pytest.approx(0.4), "over the whole time since the last one that was believed"
    assert told.pose.x_m == pytest.approx(0.16)
    assert told.feedback_ns == told.now_ns


@pytest.mark.parametrize(
    "counts",
    [
        (500, 540, 580, 0, 0),
        (500, 540, 580, 0, 30),
        (500, 540, 580, 9000, 9040),
        (0, 5, 12, 0, 14),  # near 0, where the last one goes on from those before the restart, too
        (500, 540, 580, 9000, 0, 20),  # a wrong digit, then a restart
    ],
)
def test_without_a_checksum_a_jump_that_stays_is_a_restart(counts: tuple[int, ...]) -> None:
    told = counted(*counts[:-1], checksum=False)
    x_m = told.pose.x_m
    assert math.isfinite(told.v_mps)
    told.answer(counts[-1], -counts[-1])
    assert math.isnan(told.v_mps)
    assert told.pose.x_m == x_m
    told.answer(counts[-1] + 20, -counts[-1] - 20)
    assert told.v_mps == pytest.approx(0.2), "counting starts anew there"


def test_without_a_checksum_two_wrong_digits_are_no_restart() -> None:
    told = counted(0, 40, 80, 9120, 5160, 200, checksum=False)
    assert told.v_mps == pytest.approx(0.4)
    assert told.pose.x_m == pytest.approx(0.2)
