"""A base that tells of no motion while it is told to move, of a turn nobody commanded, of going too fast, of
motion while it is told to stand."""

import math
import tracemalloc

import pytest

from config.plant import PlantConfig
from hal.chassis.following import Following
from hal.geometry import advance_pose
from hal.types import PlanarPose, Setpoint
from sim.plant import TrackedPlant
from tests.support.chassis_rig import PERIOD_NS

STANDS = PlanarPose(0.0, 0.0, 0.0)


def seconds_until_told(following: Following, v_mps: float, w_radps: float = 0.0) -> float:
    """How long a base that stands is ordered to move before that is noticed; at most a minute."""
    for period in range(50 * 60):
        following.step(STANDS, period * PERIOD_NS)
        if following.sentence:
            return period / 50
        following.ordered(Setpoint(period * PERIOD_NS, v_mps, 0.0, w_radps))
    raise AssertionError("not noticed")


def assert_follows(lag_s: float, commands: list[tuple[float, float]]) -> None:
    """A base on slipping tracks that lags by lag_s, told each (v_mps, w_radps) for one period, is never said
    not to follow."""
    following, plant = Following(), TrackedPlant(PlantConfig(lag_s=lag_s, slip_factor=1.3))
    for period, (v_mps, w_radps) in enumerate(commands):
        now_ns = period * PERIOD_NS
        plant.advance_to(now_ns)
        following.step(plant.pose, now_ns)
        assert following.sentence == ""
        plant.command(v_mps, w_radps)
        following.ordered(Setpoint(now_ns, v_mps, 0.0, w_radps))


@pytest.mark.parametrize(
    ("v_mps", "w_radps", "after_s"), [(1.5, 0.0, 1.0), (0.5, 0.0, 1.0), (0.1, 0.0, 3.0), (0.0, 0.5, 2.0)]
)
def test_a_base_that_stands_is_noticed_by_what_was_commanded(
    v_mps: float, w_radps: float, after_s: float
) -> None:
    assert seconds_until_told(Following(), v_mps, w_radps) == pytest.approx(after_s, abs=0.05)


def test_the_sentence_says_what_was_told_and_what_commanded() -> None:
    following = Following()
    seconds_until_told(following, 0.5)
    assert following.sentence == (
        "the base does not follow: it reports 0.00 m in the 1.0 s in which 0.50 m were commanded; "
        "are its tracks free and its encoders connected?"
    )


def test_one_dead_encoder_is_a_turn_that_nobody_commanded() -> None:
    following, width_m = Following(), 0.5
    for period in range(100):
        told_m = 0.4 * period / 50  # of the right track; the left one is not counted any more
        heading_rad = told_m / width_m
        following.step(PlanarPose(0.25 * math.sin(heading_rad), 0.0, heading_rad), period * PERIOD_NS)
        following.ordered(Setpoint(period * PERIOD_NS, 0.4, 0.0, 0.0))
    assert following.sentence == (
        "the base does not follow: it reports 0.80 rad in the 1.0 s in which 0.00 rad were commanded; "
        "are its tracks free and its encoders connected?"
    )


@pytest.mark.parametrize("lag_s", [0.05, 0.3, 0.6])
@pytest.mark.parametrize("w_radps", [0.4, 0.8, 1.2])
def test_bends_one_way_and_the_other_are_followed(lag_s: float, w_radps: float) -> None:
    """The yaw rate steps, as where arcs without a blend meet."""
    assert_follows(lag_s, [(0.5, w_radps if period // 70 % 2 else -w_radps) for period in range(1000)])


def test_a_zero_command_ends_the_complaint() -> None:
    following = Following()
    seconds_until_told(following, 0.5)
    following.ordered(Setpoint(0, 0.0, 0.0, 0.0))
    following.step(STANDS, 100 * PERIOD_NS * 50)
    assert following.sentence == ""


@pytest.mark.parametrize("lag_s", [0.05, 0.5, 2.0])
@pytest.mark.parametrize("accel_mps2", [0.1, 0.3, 3.0])
def test_a_sluggish_base_follows(lag_s: float, accel_mps2: float) -> None:
    speeds_mps = [min(accel_mps2 * period / 50, 1.0) for period in range(500)]
    assert_follows(lag_s, [(v_mps, 0.4 * v_mps) for v_mps in speeds_mps])


def seconds_until_too_fast(scale: float, v_mps: float, lag_s: float = 0.2) -> float | None:
    """How long a base that does scale times what it is told may go on; at most 20 s."""
    following, plant = Following(), TrackedPlant(PlantConfig(lag_s=lag_s))
    for period in range(20 * 50):
        now_ns = period * PERIOD_NS
        plant.advance_to(now_ns)
        following.step(plant.pose, now_ns)
        if following.sentence:
            return period / 50
        ramp_mps = min(0.3 * period / 50, v_mps)
        plant.command(scale * ramp_mps, 0.0)
        following.ordered(Setpoint(now_ns, ramp_mps, 0.0, 0.0))
    return None


@pytest.mark.parametrize("scale", [2.0, 3.0])
def test_a_base_that_does_more_than_it_is_told_is_noticed_before_it_has_gone_far(scale: float) -> None:
    noticed_s = seconds_until_too_fast(scale, 0.75)
    assert noticed_s is not None
    assert noticed_s < 4.5  # 2.5 s of which it still gets faster


@pytest.mark.parametrize(("scale", "lag_s"), [(1.0, 0.2), (1.0, 2.0), (1.3, 0.2), (0.7, 0.2), (0.75, 2.0)])
def test_a_base_that_does_about_what_it_is_told_is_not(scale: float, lag_s: float) -> None:
    assert seconds_until_too_fast(scale, 0.75, lag_s) is None


def test_counters_with_half_the_scale_are_noticed_before_the_robot_has_gone_twice_as_far() -> None:
    noticed_s = seconds_until_too_fast(0.5, 0.75)
    assert noticed_s is not None
    assert noticed_s < 2.5 + 4.5  # the ramp, 3 s at full speed, and two glances


def test_the_sentence_of_a_slow_base_names_both_speeds() -> None:
    following = Following()
    for period in range(300):
        following.step(PlanarPose(0.01 * period, 0.0, 0.0), period * PERIOD_NS)
        if following.sentence:
            break
        following.ordered(Setpoint(period * PERIOD_NS, 1.0, 0.0, 0.0))
    assert following.sentence == (
        "the base does not follow: it reports 0.50 m/s while at least 1.00 m/s was commanded for 3 s; "
        "is the scale of its counters right in chassis:, and can its motors go that fast?"
    )


def test_coasting_after_faster_commands_is_not_too_fast() -> None:
    """It lags by 2 s, and is told to creep after 1.5 m/s."""
    following, plant = Following(), TrackedPlant(PlantConfig(lag_s=2.0))
    for period in range(10 * 50):
        now_ns, v_mps = period * PERIOD_NS, 1.5 if period < 250 else 0.05
        plant.advance_to(now_ns)
        following.step(plant.pose, now_ns)
        assert following.sentence == "" or "m/s" not in following.sentence
        plant.command(v_mps, 0.0)
        following.ordered(Setpoint(now_ns, v_mps, 0.0, 0.0))


def test_the_sentence_names_both_speeds_and_what_to_look_at() -> None:
    following = Following()
    for period in range(120):
        following.step(PlanarPose(0.04 * period, 0.0, 0.0), period * PERIOD_NS)
        if following.sentence:
            break
        following.ordered(Setpoint(period * PERIOD_NS, 1.0, 0.0, 0.0))
    assert following.sentence == (
        "the base does not follow: it reports 2.00 m/s while at most 1.00 m/s was commanded; "
        "are the scales of its speed and of its counters right in chassis:?"
    )


def runs_away(
    v_mps: float, w_radps: float, stood_s: float, driven_mps: float = 0.0
) -> tuple[float, str] | None:
    """After how many seconds it is noticed that a base moves so on its own, which has driven and was then
    told to stand for stood_s, and what is said; None if it is not, within 20 s."""
    following, pose = Following(), STANDS
    for period in range(round(20 * 50 + 100 + 50 * stood_s)):
        now_s = period / 50 - 2.0 - stood_s
        following.step(pose, period * PERIOD_NS)
        if following.sentence:
            return now_s, following.sentence
        told = (v_mps, w_radps) if now_s >= 0.0 else (driven_mps if now_s < -stood_s else 0.0, 0.0)
        pose = advance_pose(pose, *told, 0.02)
        order_mps = driven_mps if now_s < -stood_s else 0.0
        following.ordered(Setpoint(period * PERIOD_NS, order_mps, 0.0, 0.0))
    return None


@pytest.mark.parametrize(
    ("v_mps", "w_radps", "stood_s", "driven_mps", "at_most_s"),
    [
        (0.5, 0.0, 1.0, 0.0, 1.5),
        (-0.5, 0.0, 1.0, 0.0, 1.5),
        (0.0, 1.0, 1.0, 0.0, 1.5),
        (0.0, -1.0, 1.0, 0.5, 1.5),
        (1.0, 0.0, 1.0, 0.5, 1.5),
        (0.5, 0.0, 1.0, 0.5, 7.0),  # as fast as it was told to go until a moment ago
        (0.06, 0.0, 10.0, 0.5, 1.5),  # creeps, long after it was told to stand
        (0.0, 0.2, 10.0, 0.5, 1.5),
    ],
)
def test_a_base_that_moves_while_it_is_told_to_stand_is_noticed(
    v_mps: float, w_radps: float, stood_s: float, driven_mps: float, at_most_s: float
) -> None:
    noticed = runs_away(v_mps, w_radps, stood_s, driven_mps)
    assert noticed is not None
    assert 0.5 < noticed[0] <= at_most_s
    assert "does not follow" in noticed[1]


def test_the_sentence_of_one_that_runs_away_asks_whether_it_holds_itself() -> None:
    noticed = runs_away(0.0, 1.0, 10.0)
    assert noticed is not None
    assert noticed[1] == (
        "the base does not follow: it reports 1.00 rad/s while at most 0.00 rad/s was commanded; "
        "does it hold itself where it stands, and do its motors obey?"
    )


@pytest.mark.parametrize(("v_mps", "w_radps"), [(0.04, 0.0), (-0.04, 0.0), (0.0, 0.15)])
def test_hardly_moving_base_counts_as_standing(v_mps: float, w_radps: float) -> None:
    assert runs_away(v_mps, w_radps, 10.0) is None


@pytest.mark.parametrize("lag_s", [0.2, 1.0, 2.0])
@pytest.mark.parametrize("w_radps", [0.0, 1.5])
def test_a_base_that_comes_to_rest_late_is_not_one_that_runs_away(lag_s: float, w_radps: float) -> None:
    """The command is a step: harder than any that the program sends."""
    assert_follows(lag_s, [(1.5 if w_radps == 0.0 else 0.3, w_radps)] * 250 + [(0.0, 0.0)] * 1000)


@pytest.mark.parametrize("begins", [1000, 1007, 1013, 1020])
def test_somebody_who_knocks_against_a_standing_base_does_not_latch_it(begins: int) -> None:
    """4 cm and 8 degrees, within 0.3 s."""
    following = Following()
    for period in range(2000):
        shoved = min(max(period - begins, 0) / 15, 1.0)
        following.step(PlanarPose(0.04 * shoved, 0.0, 0.14 * shoved), period * PERIOD_NS)
        assert following.sentence == ""
        following.ordered(Setpoint(period * PERIOD_NS, 0.0, 0.0, 0.0))


def test_the_jitter_of_a_counter_at_rest_is_no_motion() -> None:
    """An odometer of 1 mm steps that stands right between two of them, on the left."""
    following, width_m = Following(), 0.5
    for period in range(2000):
        left_m = 0.001 * (period % 2)
        following.step(PlanarPose(0.5 * left_m, 0.0, -left_m / width_m), period * PERIOD_NS)
        assert following.sentence == ""
        following.ordered(Setpoint(period * PERIOD_NS, 0.0, 0.0, 0.0))


def test_a_base_that_is_not_armed_may_be_pushed_and_turned() -> None:
    following, pose = Following(), STANDS
    for period in range(1000):
        following.step(pose, period * PERIOD_NS)
        assert following.sentence == ""
        armed = period >= 500
        following.ordered(Setpoint(period * PERIOD_NS, 0.0, 0.0, 0.0) if armed else None)
        if not armed:
            pose = advance_pose(pose, 1.0, 1.0, 0.02)


def test_a_base_that_stands_for_hours_takes_no_memory_for_it() -> None:
    """Nor is the first step after it a long one, with everything to be forgotten at once."""
    following = Following()
    tracemalloc.start()
    try:
        for period in range(20_000):
            following.step(STANDS, period * PERIOD_NS)
            following.ordered(Setpoint(period * PERIOD_NS, 0.0, 0.0, 0.0))
        kept_bytes, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept_bytes < 10_000
