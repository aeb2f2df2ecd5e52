"""Where an AgileX base is and how fast it goes, by speeds and odometers that it tells."""

from __future__ import annotations

import pytest

from hal.chassis.agilex_messages import (
    MotionCommand,
    MotionFeedback,
    Odometer,
)
from hal.types import ChassisMode
from tests.support.agilex_bench import Bench, state
from tests.support.chassis_rig import MS


def test_slip_is_asked_for_and_taken_off() -> None:
    """The base turns 1 / slip_factor of what its tracks say."""
    bench = Bench(slip_factor=1.25)
    bench.arm()
    bench.exchange(0.5, 0.4)
    assert bench.sent() == [MotionCommand(0.5, 0.5)]
    bench.deliver(MotionFeedback(0.5, 0.5))
    assert bench.exchange(0.5, 0.4).w_radps == pytest.approx(0.4)


def test_the_limit_of_the_model_is_of_what_it_is_told() -> None:
    """2.5235 rad/s on the wire, of which slip leaves two thirds, and sent says so."""
    bench = Bench(slip_factor=1.5)
    bench.arm()
    sent = bench.exchange(1.0, 2.0).sent
    assert bench.sent() == [MotionCommand(0.841, 2.524)]
    assert sent is not None
    assert (sent.v_mps, sent.w_radps) == pytest.approx((2.5235 / 3.0, 2.5235 / 1.5))


def test_speeds_are_integrated_over_the_time_they_stand_for() -> None:
    bench = Bench()
    bench.deliver(MotionFeedback(1.0, 0.0))
    bench.exchange()
    for _ in range(50):
        bench.deliver(MotionFeedback(1.0, 0.0))
        bench.exchange()
    # Three at once, after 60 ms of silence: 20 ms for each.
    bench.deliver(MotionFeedback(1.0, 0.0), MotionFeedback(0.5, 0.0), MotionFeedback(0.0, 0.0))
    pose = bench.exchange(after_ms=60).pose
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((1.03, 0.0, 0.0))


def test_a_speed_does_not_stand_for_a_long_silence() -> None:
    bench = Bench()
    bench.deliver(MotionFeedback(1.0, 0.0))
    bench.exchange()
    bench.deliver(MotionFeedback(1.0, 0.0))
    assert bench.exchange(after_ms=10_000).pose.x_m == pytest.approx(0.2)


def test_odometer_is_counted_where_the_geometry_is_known() -> None:
    """Lost frames lose nothing, and the counter wraps."""
    bench = Bench(track_width_m=0.5)
    bench.deliver(MotionFeedback(1.0, 0.0), Odometer(2**31 - 10, 100))
    bench.exchange()
    bench.deliver(MotionFeedback(1.0, 0.0), Odometer(-(2**31) + 10, 120))
    assert bench.exchange().pose.x_m == pytest.approx(0.02)
    bench.deliver(MotionFeedback(1.0, 0.0), Odometer(-(2**31) + 110, 170))
    pose = bench.exchange(after_ms=100).pose
    assert pose.heading_rad == pytest.approx((0.05 - 0.1) / 0.5)
    assert pose.x_m == pytest.approx(0.02 + 0.075, abs=1e-3)


def test_an_odometer_that_starts_anew_is_no_travel() -> None:
    bench = Bench(track_width_m=0.5)
    for millimetres in (50_000, 50_010, 0, 10):
        bench.deliver(MotionFeedback(0.5, 0.0), Odometer(millimetres, millimetres))
        pose = bench.exchange().pose
    assert pose.x_m == pytest.approx(0.02)


def test_feedback_is_as_old_as_the_older_of_what_it_needs() -> None:
    bench = Bench(track_width_m=0.5)
    bench.deliver(MotionFeedback(0.0, 0.0))
    assert bench.exchange().feedback_ns is None, "no odometer yet"
    bench.deliver(Odometer(0, 0))
    assert bench.exchange().feedback_ns == 20 * MS
    bench.deliver(MotionFeedback(0.0, 0.0))
    assert bench.exchange().feedback_ns == 40 * MS


@pytest.mark.parametrize("frozen", ["odometer", "speed"])
def test_an_odometer_and_a_speed_that_disagree_latch(frozen: str) -> None:
    """One of the two is stuck: the pose, or the speed, would be a lie."""
    bench = Bench(track_width_m=0.5)
    bench.arm()
    for k in range(110):
        speed_mps = 0.0 if frozen == "speed" else 0.5
        count = 0 if frozen == "odometer" else 10 * k
        bench.deliver(MotionFeedback(speed_mps, 0.0), Odometer(count, count), state())
        seen = bench.exchange(0.5)
        if seen.mode is not ChassisMode.ARMED:
            break
    assert seen.mode is ChassisMode.ESTOP
    assert seen.reason.startswith("odometer and speed feedback disagree: ")


def test_ordinary_error_of_either_is_no_disagreement() -> None:
    bench = Bench(track_width_m=0.5)
    bench.arm()
    for k in range(300):
        bench.deliver(MotionFeedback(0.5 if k % 3 else 0.6, 0.0), Odometer(11 * k, 10 * k), state())
        assert bench.exchange(0.5).mode is ChassisMode.ARMED
