import pytest

from controller.ending import ARM_TIMEOUT_S, SETTLE_S, Ending, Outcome
from hal.types import ChassisMode, Setpoint
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.scenes import chassis_state


class Drive:
    """An ending, stepped at 50 Hz until it has come."""

    def __init__(self) -> None:
        self.chassis = ObedientChassis()
        self.ending = Ending(self.chassis)
        self.now_ns = 0

    def run(
        self,
        seconds: float,
        mode: ChassisMode = ChassisMode.ARMED,
        v_mps: float = 0.0,
        w_radps: float = 0.0,
        arrived: bool = False,
    ) -> Outcome | None:
        for _ in range(round(seconds / PERIOD_S)):
            if self.ending.outcome is not None:
                break
            self.ending.begin(self.now_ns)
            state = chassis_state(self.now_ns, mode, v_mps, reason=f"it is {mode.value}")
            setpoint = Setpoint(self.now_ns, v_mps, 0.0, w_radps)
            self.ending.conclude(state, setpoint, self.now_ns, arrived=arrived)
            self.now_ns += round(PERIOD_S * 1e9)
        return self.ending.outcome


def test_the_chassis_is_armed_once_and_stopped_once() -> None:
    drive = Drive()
    drive.run(3.0)
    assert drive.chassis.stopped_at_ns == []
    drive.run(3.0, arrived=True)
    assert drive.ending.outcome is Outcome.REACHED
    assert drive.chassis.armed_at_ns == [0]
    assert drive.chassis.stopped_at_ns == [round((3.0 + SETTLE_S) * 1e9)]


def test_rest_means_no_speed_and_no_turning() -> None:
    drive = Drive()
    drive.ending.request_stop("asked", Outcome.STOPPED)
    assert drive.run(2.0, w_radps=0.1) is None
    assert drive.run(2.0, v_mps=0.1) is None
    drive.run(2.0)
    assert (drive.ending.outcome, drive.ending.stop_reason) == (Outcome.STOPPED, "asked")


def test_motion_in_between_begins_the_settling_anew() -> None:
    drive = Drive()
    drive.run(SETTLE_S - PERIOD_S, arrived=True)
    drive.run(PERIOD_S, v_mps=0.1, arrived=True)
    assert drive.run(SETTLE_S - PERIOD_S, arrived=True) is None


def test_the_first_wish_stays_and_arriving_counts_for_more() -> None:
    drive = Drive()
    drive.ending.request_stop("the camera is gone", Outcome.BROKEN_OFF)
    drive.ending.request_stop("SIGTERM received", Outcome.STOPPED)
    drive.run(1.0, arrived=True)
    assert (drive.ending.outcome, drive.ending.stop_reason) == (Outcome.REACHED, "the camera is gone")


@pytest.mark.parametrize("mode", [ChassisMode.ESTOP, ChassisMode.LOST])
def test_a_latched_chassis_ends_it_at_once_even_before_it_was_armed(mode: ChassisMode) -> None:
    drive = Drive()
    drive.run(PERIOD_S, mode)
    assert (drive.ending.outcome, drive.ending.stop_reason) == (
        Outcome.CHASSIS_FAULT,
        f"it is {mode.value}",
    )
    assert len(drive.chassis.stopped_at_ns) == 1


def test_a_chassis_that_disarms_itself_has_ended_the_drive() -> None:
    drive = Drive()
    drive.run(1.0, v_mps=0.5)
    drive.run(PERIOD_S, ChassisMode.STANDBY)
    assert (drive.ending.outcome, drive.ending.stop_reason) == (Outcome.CHASSIS_FAULT, "it is standby")


def test_arming_is_waited_for_but_not_for_ever() -> None:
    drive = Drive()
    assert drive.run(ARM_TIMEOUT_S, ChassisMode.ARMING) is None
    drive.run(1.0, ChassisMode.ARMING)
    assert (drive.ending.outcome, drive.ending.stop_reason) == (Outcome.NOT_ARMED, "it is arming")
