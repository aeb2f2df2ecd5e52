"""An AgileX base that was away for a moment: it is not driven on without consent."""

from __future__ import annotations

import pytest

from hal.chassis.agilex_messages import (
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    Odometer,
    SystemState,
)
from hal.types import ChassisMode, ChassisState
from tests.support.agilex_bench import CAN, STANDBY, Bench, state


def mini(**changes: object) -> Bench:
    """A BUNKER MINI, whose 0x421 is repeated: it may be in command mode again before its first 0x211."""
    return Bench(model="bunker_mini", **changes)


def counted(count: int) -> SystemState:
    return SystemState(0, CAN, 48.0, 0, count)


def drive(bench: Bench, millimetres: int) -> ChassisState:
    bench.deliver(MotionFeedback(0.3, 0.0), Odometer(millimetres, millimetres))
    return bench.exchange(0.3)


def test_an_odometer_that_jumps_latches_until_consent() -> None:
    """0.9 m driven, then 0: no track can make that in 80 ms, so nobody need wait for 0x211."""
    bench = mini(track_width_m=0.5)
    bench.arm()
    for k in range(1, 151):
        if k % 10 == 0:
            bench.deliver(state(CAN))
        assert drive(bench, 6 * k).mode is ChassisMode.ARMED
    bench.deliver(MotionFeedback(0.3, 0.0))
    bench.exchange(0.3, after_ms=60)
    seen = drive(bench, 0)
    assert (seen.mode, seen.reason) == (
        ChassisMode.ESTOP,
        "the base no longer obeys: its odometer jumped: restarted",
    )
    assert bench.sent() == [MotionCommand(0.0, 0.0)]
    drive(bench, 0)
    assert bench.sent() == [MotionCommand(0.0, 0.0), ControlModeCommand(STANDBY)], "taken back to standby"
    for k in range(100):
        if k % 5 == 0:
            bench.deliver(state(STANDBY))
        bench.deliver(MotionFeedback(0.0, 0.0), Odometer(0, 0))
        assert bench.exchange(0.3).mode is ChassisMode.ESTOP
        assert ControlModeCommand(CAN) not in bench.sent()
    bench.exchange()
    bench.arm()


def test_a_restart_soon_after_setting_off_is_no_travel_backwards() -> None:
    """54 mm at 0.3 m/s, then 3 mm: less than an odometer may jump, but against its way."""
    bench = mini(track_width_m=0.5)
    bench.arm()
    for k in range(1, 10):
        gone_m = drive(bench, 6 * k).pose.x_m
    seen = drive(bench, 3)
    assert seen.mode is ChassisMode.ESTOP
    assert seen.pose.x_m == pytest.approx(gone_m)
    assert "its odometer jumped: restarted" in seen.reason


@pytest.mark.parametrize("seconds", [1, 5, 20])
def test_however_much_waited_none_of_it_is_an_answer_to_the_consent(seconds: int) -> None:
    """It obeyed for long, nobody read it, and just now it restarted into standby."""
    bench = Bench(track_width_m=0.5)
    for k in range(50 * seconds):
        bench.deliver(MotionFeedback(0.0, 0.0), Odometer(k, k), state(CAN))
    bench.chassis.arm(bench.now_ns)
    for _ in range(20):
        bench.deliver(MotionFeedback(0.0, 0.0), Odometer(0, 0), state(STANDBY))
        seen = bench.exchange()
        assert seen.mode is ChassisMode.ARMING
    assert seen.reason == "arming: the base does not take commands: control mode is standby"
    bench.deliver(MotionFeedback(0.0, 0.0), Odometer(0, 0), state(CAN))
    assert bench.exchange().mode is ChassisMode.ARMED


def test_a_flood_refuses_the_consent() -> None:
    bench = Bench()
    for _ in range(9000):
        bench.deliver(MotionFeedback(0.0, 0.0))
    bench.chassis.arm(bench.now_ns)
    seen = bench.exchange()
    assert (seen.mode, seen.reason) == (
        ChassisMode.STANDBY,
        "not armed; arming refused: more came than can be read at once, and it may be old; what floods "
        "the line?",
    )
    bench.chassis.arm(bench.now_ns)
    assert bench.exchange().mode is ChassisMode.ARMING, "it has ended"


def test_odometer_jump_before_the_consent_does_not_count() -> None:
    bench = mini(track_width_m=0.5)
    for millimetres in (50_000, 50_010, 0, 10):
        bench.deliver(MotionFeedback(0.0, 0.0), Odometer(millimetres, millimetres))
        bench.exchange()
    bench.chassis.arm(bench.now_ns)
    bench.deliver(state(CAN), MotionFeedback(0.0, 0.0), Odometer(10, 10))
    assert bench.exchange().mode is ChassisMode.ARMED


@pytest.mark.parametrize(
    ("before", "after", "after_ms", "restarts"),
    [
        (7, 8, 100, False),
        (255, 0, 100, False),
        (7, 10, 100, False),  # two were lost
        (7, 7, 100, False),  # a base that does not count
        (7, 7 + 13, 100, False),  # what is lost is no restart
        (7, 90, 100, False),  # odd, but no beginning
        (120, 0, 100, True),
        (120, 1, 200, True),
        (120, 0, 20, True),
    ],
)
def test_the_count_of_the_system_state_begins_anew(
    before: int, after: int, after_ms: int, restarts: bool
) -> None:
    bench = mini()
    bench.arm()
    bench.deliver(counted(before), MotionFeedback(0.0, 0.0))
    assert bench.exchange().mode is ChassisMode.ARMED
    bench.deliver(counted(after), MotionFeedback(0.0, 0.0))
    seen = bench.exchange(after_ms=after_ms)
    assert seen.mode is (ChassisMode.ESTOP if restarts else ChassisMode.ARMED)
    assert ("the count of its 0x211 began anew: restarted" in seen.reason) is restarts


def test_a_base_whose_mode_is_not_repeated_is_asked_for_its_mode_alone() -> None:
    """It is in standby after a restart, and what its byte 7 counts not every manual says."""
    bench = Bench()
    bench.arm()
    for count in (120, 0):
        bench.deliver(counted(count), MotionFeedback(0.0, 0.0))
        assert bench.exchange().mode is ChassisMode.ARMED
