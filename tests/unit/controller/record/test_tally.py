import math

import pytest

from config.robot import Limits
from controller.record.tally import (
    Complaints,
    FrameTally,
    SetpointTally,
    ShaperFaults,
    Standstill,
    TimingTally,
    mean_speed_mps,
)
from hal.types import ChassisMode, Setpoint

MS = 1_000_000
LIMITS = Limits()


def tally_of(*points: tuple[float, float]) -> SetpointTally:
    """Setpoints (v, a), 20 ms apart."""
    tally = SetpointTally(LIMITS, period_s=0.02)
    for index, (v_mps, a_mps2) in enumerate(points):
        tally.add(Setpoint(index * 20 * MS, v_mps, a_mps2, 0.0))
    return tally


def test_a_gentle_start_breaks_nothing() -> None:
    tally = tally_of((0.0, 0.0), (0.00012, 0.012), (0.00048, 0.024))
    assert (tally.count, tally.violations, tally.reversals) == (3, 0, 0)
    assert tally.max_jerk_mps3 == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("points", "what"),
    [
        (((1.6, 0.0),), "speed"),
        (((-0.01, 0.0),), "reversal"),
        (((0.5, 0.0), (0.52, 0.0)), "acceleration 1.0 m/s^2"),
        (((0.5, 0.0), (0.48, 0.0)), "deceleration 1.0 m/s^2"),
        (((0.5, 0.0), (0.5, 0.1)), "jerk 5 m/s^3"),
    ],
)
def test_each_broken_limit_is_counted(points: tuple[tuple[float, float], ...], what: str) -> None:
    assert tally_of(*points).violations == 1, what


def test_the_greatest_of_speed_and_acceleration_stay_when_less_follows() -> None:
    tally = tally_of((0.5, 0.0), (0.504, 0.2), (0.502, 0.0))
    assert tally.max_speed_mps == 0.504
    assert tally.max_accel_mps2 == pytest.approx(0.2)


def test_summary_tells_the_first_fault_of_the_shaper() -> None:
    faults = ShaperFaults()
    for fault in ("", "no solution", "another"):
        faults.add(fault)
    assert faults.line() == "braked by the stop profile in 2 steps; first: no solution"


def test_a_complaint_of_the_base_is_new_once() -> None:
    complaints = Complaints()
    said = [complaints.add(faults) for faults in ((), ("warm",), ("warm", "low"), (), ("warm",))]
    assert said == [[], ["warm"], ["low"], [], []]
    assert complaints.line() == "warm; low"


def test_a_late_step_followed_by_one_on_time_is_no_jerk() -> None:
    tally = SetpointTally(LIMITS, period_s=0.02)
    tally.add(Setpoint(15 * MS, 0.5, 0.0, 0.0))
    tally.add(Setpoint(20 * MS, 0.50012, 0.012, 0.0))
    assert tally.violations == 0


def test_a_driver_that_sends_every_second_setpoint_has_the_same_jitter() -> None:
    tally = SetpointTally(LIMITS, period_s=0.02)
    tally.add(Setpoint(4 * MS, 0.5, 0.3, 0.0))
    tally.add(None)
    tally.add(Setpoint(40 * MS, 0.512, 0.3, 0.0))
    tally.add(None)  # the driver's period had not passed: a step late, the next one on time
    tally.add(Setpoint(63 * MS, 0.524, 0.3, 0.0))
    assert tally.violations == 0
    tally.add(Setpoint(100 * MS, 0.536, 0.3, 0.0))
    assert tally.violations == 1, "two steps in one period are one too many"


def test_missing_and_repeated_setpoints_are_not_counted() -> None:
    tally = SetpointTally(LIMITS, period_s=0.02)
    point = Setpoint(0, 0.1, 0.0, 0.0)
    for sent in (None, point, point):
        tally.add(sent)
    assert tally.count == 1


@pytest.mark.parametrize("mode", [ChassisMode.LOST, ChassisMode.ESTOP])
def test_the_zero_of_a_latched_driver_is_no_jump_of_the_profile(mode: ChassisMode) -> None:
    tally = tally_of((0.8, 0.0))
    tally.add(Setpoint(20 * MS, 0.0, 0.0, 0.0), mode)
    tally.add(Setpoint(40 * MS, 0.0, 0.0, 0.0))
    assert (tally.count, tally.violations) == (2, 0)
    tally.add(Setpoint(60 * MS, 0.8, 0.0, 0.0))
    assert tally.violations == 1


@pytest.mark.parametrize("mode", [ChassisMode.LOST, ChassisMode.ESTOP])
def test_a_latched_driver_that_drives_is_judged(mode: ChassisMode) -> None:
    tally = tally_of((0.8, 0.0))
    tally.add(Setpoint(20 * MS, -0.8, 0.0, 0.0), mode)
    assert (tally.violations, tally.reversals) == (1, 1)


def test_the_first_command_after_a_latch_is_judged() -> None:
    tally = tally_of((0.8, 0.0))
    tally.add(Setpoint(20 * MS, 0.0, 0.0, 0.0), ChassisMode.LOST)
    tally.add(Setpoint(40 * MS, 0.8, 0.0, 0.0))
    assert tally.violations == 1


def test_commands_beyond_comfort_are_counted_by_kind() -> None:
    def beyond(*sent: tuple[float, float]) -> tuple[int, int, int]:
        tally = tally_of(*sent)
        return tally.emergency_count, tally.hard_braking_count, tally.high_jerk_count

    comfort = LIMITS.max_jerk_mps3 * 0.02
    assert beyond((1.0, 0.0), (1.0, -comfort)) == (0, 0, 0)
    assert beyond((1.0, 0.0), (1.0, -1.5 * comfort)) == (1, 0, 1)  # an emergency's jerk, while still gentle
    assert beyond((1.0, -0.3), (0.994, -0.3 - 0.5 * comfort)) == (1, 1, 0)
    assert beyond((1.0, -0.3), (0.994, -0.3 - 1.5 * comfort)) == (1, 1, 1)


def test_timing_gives_the_median_of_the_sum() -> None:
    timing = TimingTally()
    for detect_ms in (3.0, 4.0, 100.0):
        timing.add({"detect": detect_ms, "track": 1.0})
    assert timing.line().startswith("5.0 ms median, ")
    assert "(detect 4.0, track 1.0)" in timing.line()
    assert TimingTally().line() == "not measured"


def test_a_mean_speed_needs_time() -> None:
    assert mean_speed_mps(10.0, 20.0) == 0.5
    assert math.isnan(mean_speed_mps(0.0, 0.0))


def test_standing_is_counted_from_the_first_zero_on() -> None:
    standstill = Standstill()
    for seconds, v_mps in ((0, 0.0), (5, 0.3), (6, 0.0), (7, 0.0)):
        standstill.add(Setpoint(seconds * 1000 * MS, v_mps, 0.0, 0.0))
    assert standstill.elapsed_s(10_000 * MS) == 4.0
    standstill.add(Setpoint(10_000 * MS, 0.01, 0.3, 0.0))
    assert standstill.elapsed_s(11_000 * MS) == 0.0


def test_a_robot_that_turns_in_place_does_not_stand() -> None:
    standstill = Standstill()
    for seconds, yaw_radps in ((0, 0.0), (5, -0.4), (6, 0.0)):
        standstill.add(Setpoint(seconds * 1000 * MS, 0.0, 0.0, yaw_radps))
    assert standstill.elapsed_s(10_000 * MS) == 4.0


def test_frames_that_were_not_looked_at_are_told_and_a_camera_that_begins_anew_loses_none() -> None:
    frames = FrameTally()
    for sequence in (7, 8, 9, 0, 1):
        frames.add(sequence)
    assert (frames.processed, frames.captured, frames.line()) == (5, 5, "")
    frames.add(4)
    assert frames.line().startswith("6 of the camera's 8 were processed: perception did not keep up")


def test_zero_to_a_base_that_stands_though_it_was_told_to_go_breaks_no_limit() -> None:
    tally = tally_of((0.5, 0.3))
    tally.add(Setpoint(20 * MS, 0.0, 0.0, 0.0), standing=True)
    tally.add(Setpoint(40 * MS, 0.00012, 0.012, 0.0))
    assert tally.violations == 0
    tally.add(Setpoint(60 * MS, 0.02, 0.0, 0.0), standing=True)
    assert tally.violations == 1, "only zero is free"
