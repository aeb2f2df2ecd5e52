import math
from dataclasses import replace

import pytest

from controller.base.drive_lifecycle import (
    ARM_TIMEOUT_S,
    MEASURED_REST_MPS,
    MEASURED_REST_RADPS,
    REST_TIMEOUT_S,
    SETTLE_S,
    DriveLifecycle,
    Outcome,
)
from hal.types import ChassisMode, Setpoint
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.scenes import chassis_state


class Drive:
    """A lifecycle, stepped at 50 Hz until its end."""

    def __init__(self) -> None:
        self.chassis = ObedientChassis()
        self.lifecycle = DriveLifecycle(self.chassis)
        self.now_ns = 0
        self.heard_ns: int | None = None

    def run(
        self,
        seconds: float,
        mode: ChassisMode = ChassisMode.ARMED,
        v_mps: float = 0.0,
        w_radps: float = 0.0,
        arrived: bool = False,
        told: tuple[float, float] | None = None,
        heard: bool = True,
    ) -> Outcome | None:
        """told: what the base tells of its (v m/s, w rad/s), else what it is told. heard: in every step."""
        for _ in range(round(seconds / PERIOD_S)):
            if self.lifecycle.outcome is not None:
                break
            self.lifecycle.arm_once(self.now_ns)
            state = chassis_state(self.now_ns, mode, v_mps, reason=f"it is {mode.value}")
            if heard:
                self.heard_ns = self.now_ns
            v_told, w_told = (v_mps, w_radps) if told is None else told
            state = replace(state, v_mps=v_told, w_radps=w_told, feedback_ns=self.heard_ns)
            setpoint = Setpoint(self.now_ns, v_mps, 0.0, w_radps)
            self.lifecycle.check_end(state, setpoint, self.now_ns, arrived=arrived)
            self.now_ns += round(PERIOD_S * 1e9)
        return self.lifecycle.outcome


def test_the_chassis_is_armed_once_and_stopped_once() -> None:
    drive = Drive()
    drive.run(3.0)
    assert drive.chassis.stopped_at_ns == []
    drive.run(3.0, arrived=True)
    assert drive.lifecycle.outcome is Outcome.REACHED
    assert drive.chassis.armed_at_ns == [0]
    assert drive.chassis.stopped_at_ns == [round((3.0 + SETTLE_S) * 1e9)]


def test_rest_means_no_speed_and_no_turning() -> None:
    drive = Drive()
    drive.lifecycle.request_stop("asked", Outcome.STOPPED)
    assert drive.run(2.0, w_radps=0.1) is None
    assert drive.run(2.0, v_mps=0.1) is None
    drive.run(2.0)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (Outcome.STOPPED, "asked")


def test_motion_in_between_begins_the_settling_anew() -> None:
    drive = Drive()
    drive.run(SETTLE_S - PERIOD_S, arrived=True)
    drive.run(PERIOD_S, v_mps=0.1, arrived=True)
    assert drive.run(SETTLE_S - PERIOD_S, arrived=True) is None


@pytest.mark.parametrize(
    "told",
    [
        (1.1 * MEASURED_REST_MPS, 0.0),
        (-0.3, 0.0),
        (0.0, 1.1 * MEASURED_REST_RADPS),
        (0.0, -1.0),
        (math.nan, 0.0),
    ],
)
@pytest.mark.parametrize("arrived", [True, False])
def test_a_base_that_still_moves_has_not_ended_the_drive(told: tuple[float, float], arrived: bool) -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5)
    if not arrived:
        drive.lifecycle.request_stop("asked", Outcome.STOPPED)
    assert drive.run(2.0, arrived=arrived, told=told) is None
    assert drive.run(SETTLE_S, arrived=arrived) is None, "it has stood for less than that"
    drive.run(PERIOD_S, arrived=arrived)
    assert drive.lifecycle.outcome is (Outcome.REACHED if arrived else Outcome.STOPPED)


def test_feedback_from_before_the_stop_command_is_no_evidence_of_rest() -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5, told=(0.0, 0.0))
    assert drive.run(2 * SETTLE_S, arrived=True, told=(0.0, 0.0), heard=False) is None
    assert drive.run(PERIOD_S, arrived=True, told=(0.0, 0.0)) is Outcome.REACHED


def test_the_jitter_of_a_counter_is_rest() -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5)
    jitter = 0.9 * MEASURED_REST_MPS, 0.9 * MEASURED_REST_RADPS
    assert drive.run(1.0, arrived=True, told=jitter) is Outcome.REACHED


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        (
            (0.3, -0.1),
            "commanded to stand for 6 s, the base still reports 0.30 m/s and -0.10 rad/s; does it hold "
            "itself where it stands, and do its motors obey?",
        ),
        ((math.nan, math.nan), "commanded to stand for 6 s, the base does not tell how fast it goes"),
    ],
)
def test_a_base_that_goes_on_although_it_is_told_to_stand_is_a_fault(
    told: tuple[float, float], sentence: str
) -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5)
    assert drive.run(REST_TIMEOUT_S, arrived=True, told=told) is None
    drive.run(PERIOD_S, arrived=True, told=told)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (Outcome.CHASSIS_FAULT, sentence)
    assert len(drive.chassis.stopped_at_ns) == 1


def test_a_fault_after_a_wish_to_stop_is_told_beside_it() -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5)
    drive.lifecycle.request_stop("SIGTERM received", Outcome.STOPPED)
    drive.run(PERIOD_S, ChassisMode.ESTOP)
    assert drive.lifecycle.stop_reason == "SIGTERM received; then it is e-stop"


def test_a_wish_to_stop_before_the_base_is_armed_asks_for_no_speed() -> None:
    drive = Drive()
    drive.lifecycle.request_stop("perception is lost", Outcome.BROKEN_OFF)
    drive.run(1.0, ChassisMode.ARMING, told=(math.nan, math.nan), heard=False)
    assert drive.lifecycle.outcome is Outcome.BROKEN_OFF


def test_the_first_wish_stays_and_arriving_counts_for_more() -> None:
    drive = Drive()
    drive.lifecycle.request_stop("the camera is gone", Outcome.BROKEN_OFF)
    drive.lifecycle.request_stop("SIGTERM received", Outcome.STOPPED)
    drive.run(1.0, arrived=True)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (Outcome.REACHED, "the camera is gone")


@pytest.mark.parametrize("mode", [ChassisMode.ESTOP, ChassisMode.LOST])
def test_a_latched_chassis_ends_it_at_once_even_before_it_was_armed(mode: ChassisMode) -> None:
    drive = Drive()
    drive.run(PERIOD_S, mode)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (
        Outcome.CHASSIS_FAULT,
        f"it is {mode.value}",
    )
    assert len(drive.chassis.stopped_at_ns) == 1


def test_a_chassis_that_disarms_itself_has_ended_the_drive() -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5)
    drive.run(PERIOD_S, ChassisMode.STANDBY)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (Outcome.CHASSIS_FAULT, "it is standby")


def test_arming_is_waited_for_but_not_for_ever() -> None:
    drive = Drive()
    assert drive.run(ARM_TIMEOUT_S, ChassisMode.STANDBY) is None
    drive.run(1.0, ChassisMode.STANDBY)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (Outcome.NOT_ARMED, "it is standby")


def test_how_long_arming_takes_is_up_to_the_driver() -> None:
    drive = Drive()
    assert drive.run(60.0, ChassisMode.ARMING) is None
    drive.run(PERIOD_S, ChassisMode.STANDBY)
    assert (drive.lifecycle.outcome, drive.lifecycle.stop_reason) == (Outcome.NOT_ARMED, "it is standby")
