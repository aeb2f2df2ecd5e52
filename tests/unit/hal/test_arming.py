"""The arming state machine, step by step and, at the end, for every sequence hypothesis can think of."""

from __future__ import annotations

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from hal.chassis.arming import Arming, consent, disarm, step
from hal.types import ChassisMode
from tests.support.arming_evidence import LIMITS, MS, at


def armed() -> Arming:
    """Armed at 40 ms."""
    state = consent(Arming(), at(0, command_refusal="standby"), LIMITS)
    state = step(state, at(20, command_refusal="standby"), LIMITS)
    return step(state, at(40), LIMITS)


def test_a_stop_that_arming_resets_stands_in_the_way_of_being_armed_not_of_arming() -> None:
    state = step(armed(), at(60, stop_cause="button"), LIMITS)
    assert (state.mode, state.cleared) == (ChassisMode.ESTOP, False)
    assert consent(state, at(80, stop_cause="button"), LIMITS).mode is ChassisMode.ESTOP
    held = {"stop_cause": "button", "resettable": True}
    state = consent(state, at(80, **held), LIMITS)
    assert state.mode is ChassisMode.ARMING
    state = step(state, at(100, **held), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.ARMING, "arming: button")
    assert step(state, at(120), LIMITS).mode is ChassisMode.ARMED
    state = step(state, at(2200, **held), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.STANDBY, "arming gave up after 2.1 s: button")
    assert step(state, at(2220, **held), LIMITS).mode is ChassisMode.ESTOP


def test_starts_in_standby_and_stays_there_whatever_the_base_says() -> None:
    state = Arming()
    for now_ms in range(0, 1000, 20):
        state = step(state, at(now_ms), LIMITS)
        assert state.mode is ChassisMode.STANDBY
        assert not state.may_move


def test_arms_after_consent_when_the_base_obeys() -> None:
    state = consent(Arming(), at(0, command_refusal="control mode is standby"), LIMITS)
    assert state.mode is ChassisMode.ARMING
    assert not state.may_move
    state = step(state, at(20, command_refusal="control mode is standby"), LIMITS)
    assert state.reason == "arming: the base does not take commands: control mode is standby"
    state = step(state, at(40), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.ARMED, "armed")
    assert state.may_move


def test_messages_from_before_the_consent_do_not_arm() -> None:
    state = consent(Arming(), at(100), LIMITS)
    state = step(state, at(120, status_ns=100 * MS), LIMITS)
    assert state.reason == "arming: no status heard from the base"
    state = step(state, at(140, feedback_ns=100 * MS), LIMITS)
    assert state.reason == "arming: no motion feedback heard from the base"
    assert step(state, at(160), LIMITS).mode is ChassisMode.ARMED


def test_does_not_arm_into_a_command() -> None:
    state = consent(Arming(), at(0), LIMITS)
    state = step(state, at(20, command_is_zero=False), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.ARMING, "arming: the command is not zero")
    assert step(state, at(40), LIMITS).mode is ChassisMode.ARMED


def test_arming_gives_up_and_says_what_was_missing() -> None:
    state = consent(Arming(), at(0, feedback_ns=None, status_ns=None), LIMITS)
    for now_ms in range(20, 2001, 20):
        state = step(state, at(now_ms, feedback_ns=None, status_ns=None), LIMITS)
        assert state.mode is ChassisMode.ARMING
    state = step(state, at(2020, feedback_ns=None, status_ns=None), LIMITS)
    assert state.mode is ChassisMode.STANDBY
    assert state.reason == "arming gave up after 2.0 s: no status heard from the base"


@pytest.mark.parametrize(
    ("changes", "mode", "reason"),
    [
        ({"stop_cause": "emergency stop is pressed"}, ChassisMode.ESTOP, "emergency stop is pressed"),
        (
            {"command_refusal": "mode is standby"},
            ChassisMode.ESTOP,
            "the base no longer obeys: mode is standby",
        ),
        ({"link_error": "unplugged"}, ChassisMode.LOST, "unplugged"),
        ({"feedback_ns": 39 * MS}, ChassisMode.LOST, "no motion feedback for 201 ms"),
        ({"status_ns": -461 * MS}, ChassisMode.LOST, "no status for 701 ms"),
        (
            {"feedback_ns": 39 * MS, "late_answer": "60 ms late"},
            ChassisMode.LOST,
            "no motion feedback for 201 ms: 60 ms late",
        ),
    ],
)
def test_every_fault_latches_while_armed(changes: dict[str, object], mode: ChassisMode, reason: str) -> None:
    state = step(armed(), at(240, **changes), LIMITS)
    assert (state.mode, state.reason) == (mode, reason)
    for now_ms in range(260, 2000, 20):
        state = step(state, at(now_ms), LIMITS)
        assert state.mode is mode, "a latch does not open by itself"
    assert state.reason == f"{reason}; gone now, arm again to go on"


@pytest.mark.parametrize(
    ("now_ms", "reason"),
    [
        (541, "the control loop stood still for 501 ms"),
        (39, "the control loop stood still for -1 ms"),  # time that runs backwards is no time
    ],
)
def test_a_control_loop_that_stood_still_latches(now_ms: int, reason: str) -> None:
    """The base may have stopped by its own time-out: the old speed would now be a jump."""
    state = step(armed(), at(now_ms), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.ESTOP, reason)


def test_a_loop_that_stood_still_is_named_and_not_the_base_that_it_did_not_ask() -> None:
    """A RoboClaw says nothing without being asked, so its feedback has grown old, too."""
    state = step(armed(), at(2040, feedback_ns=40 * MS, status_ns=40 * MS), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.ESTOP, "the control loop stood still for 2000 ms")
    state = step(armed(), at(2040, link_error="unplugged"), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.LOST, "unplugged")


def test_limits_themselves_are_still_good() -> None:
    state = step(armed(), at(240, feedback_ns=40 * MS, status_ns=40 * MS), LIMITS)
    assert state.may_move
    state = step(state, at(740), LIMITS)
    assert state.may_move


def test_a_latch_opens_only_by_consent_with_the_cause_gone_and_a_zero_command() -> None:
    state = step(armed(), at(60, stop_cause="pressed"), LIMITS)
    state = consent(state, at(80, stop_cause="pressed"), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.ESTOP, "pressed; arming refused: pressed")
    state = step(state, at(100, command_is_zero=False), LIMITS)
    state = consent(state, at(100, command_is_zero=False), LIMITS)
    assert state.mode is ChassisMode.ESTOP
    assert state.refusal == "the command is not zero"
    state = consent(state, at(120), LIMITS)
    assert (state.mode, state.refusal) == (ChassisMode.ARMING, "")
    assert step(state, at(140), LIMITS).may_move


def test_lost_stays_lost_while_the_link_or_the_feedback_is_missing() -> None:
    state = step(armed(), at(60, link_error="unplugged"), LIMITS)
    state = consent(state, at(80, link_error="unplugged"), LIMITS)
    assert (state.mode, state.refusal) == (ChassisMode.LOST, "unplugged")
    state = consent(state, at(300, feedback_ns=60 * MS), LIMITS)
    assert (state.mode, state.refusal) == (ChassisMode.LOST, "no motion feedback for 240 ms")
    assert consent(state, at(320), LIMITS).mode is ChassisMode.ARMING


@pytest.mark.parametrize("heard", [{"status_ns": None}, {"feedback_ns": None}])
def test_a_link_that_works_again_is_no_base_that_answers(heard: dict[str, object]) -> None:
    """Bus-off because nobody is there to acknowledge: to arm again would not help yet."""
    state = step(Arming(), at(20, link_error="bus-off", **heard), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.LOST, "bus-off")
    assert step(state, at(540, **heard), LIMITS).reason == "bus-off"
    assert step(state, at(560), LIMITS).reason == "bus-off; gone now, arm again to go on"


def test_stop_ends_in_standby_once_the_base_stands_and_has_let_go() -> None:
    state = disarm(armed(), 60 * MS)
    assert state.mode is ChassisMode.STOPPING
    assert not state.may_move
    state = consent(state, at(70), LIMITS)
    assert (state.mode, state.refusal) == (ChassisMode.STOPPING, "still stopping")
    state = step(state, at(80, standing=False), LIMITS)
    assert state.mode is ChassisMode.STOPPING
    state = step(state, at(100), LIMITS)
    assert state.mode is ChassisMode.STOPPING, "the base still obeys"
    state = step(state, at(120, command_refusal="control mode is standby"), LIMITS)
    assert (state.mode, state.reason) == (ChassisMode.STANDBY, "stopped")


def test_stop_does_not_open_a_latch_and_arms_nothing() -> None:
    latched = step(armed(), at(60, stop_cause="pressed"), LIMITS)
    assert disarm(latched, 80 * MS) == latched
    assert disarm(Arming(), 0) == Arming()


def test_arming_twice_changes_nothing() -> None:
    once = consent(Arming(), at(0), LIMITS)
    assert consent(once, at(20), LIMITS) == once
    assert consent(armed(), at(60), LIMITS) == armed()


class ArmingLife(RuleBasedStateMachine):
    """Any order of consent, stops and evidence: armed only by consent, and never out of a latch by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.state = Arming()
        self.now_ms = 0
        self.consented = False
        self.seen = at(0)

    @rule(
        dt_ms=st.integers(0, 900),
        link_error=st.sampled_from(["", "", "", "gone"]),
        stop_cause=st.sampled_from(["", "", "", "pressed"]),
        command_refusal=st.sampled_from(["", "", "standby"]),
        feedback_age_ms=st.integers(0, 300),
        standing=st.booleans(),
        zero=st.booleans(),
    )
    def exchange(
        self,
        dt_ms: int,
        link_error: str,
        stop_cause: str,
        command_refusal: str,
        feedback_age_ms: int,
        standing: bool,
        zero: bool,
    ) -> None:
        self.now_ms += dt_ms
        self.seen = at(
            self.now_ms,
            link_error=link_error,
            stop_cause=stop_cause,
            command_refusal=command_refusal,
            feedback_ns=(self.now_ms - feedback_age_ms) * MS,
            standing=standing,
            command_is_zero=zero,
        )
        before = self.state
        self.state = step(before, self.seen, LIMITS)
        if before.latched:
            assert self.state.mode is before.mode
        if self.state.may_move:
            assert self.consented
            assert not link_error
            assert not stop_cause
            assert not command_refusal
            assert feedback_age_ms <= 200
            assert before.may_move or zero, "armed into a command"

    @rule()
    def give_consent(self) -> None:
        self.state = consent(self.state, self.seen, LIMITS)
        self.consented = self.consented or self.state.mode is ChassisMode.ARMING

    @rule()
    def stop(self) -> None:
        was_latched = self.state.latched
        self.state = disarm(self.state, self.now_ms * MS)
        assert self.state.latched == was_latched
        if not was_latched:
            self.consented = False

    @precondition(lambda self: self.state.latched)
    @rule()
    def forget_consent(self) -> None:
        self.consented = False

    @invariant()
    def moves_only_when_armed(self) -> None:
        assert self.state.may_move == (self.state.mode is ChassisMode.ARMED)
        assert self.state.reason


TestArmingLife = ArmingLife.TestCase
