"""The arming state machine of all chassis drivers: pure functions from the evidence to the next mode.

    standby --arm()--> arming --the base obeys, command zero--> armed --stop()--> stopping --> standby
       any --emergency stop, exception, somebody else drives, mode lost--> e-stop   (latched)
       any --link gone, feedback or status silent--> lost                          (latched)
       e-stop, lost --arm(), cause gone, command zero--> arming

A latched chassis never moves again by itself: only arm(), a person's consent, ends a latched mode (ISO 3691-4
4.1.14). stop() does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from hal.clocks import NS_PER_MS, NS_PER_S
from hal.types import LATCHED_MODES, ChassisMode


@dataclass(frozen=True, slots=True)
class ArmingLimits:
    """Time limits of the machine.

    feedback_timeout_ns, status_timeout_ns: how long silence may last before the chassis counts as lost.
    arming_timeout_ns: how long arming may take.
    max_step_gap_ns: the longest gap between two steps while armed. After a longer one the base may have
    stopped by its own time-out, and resuming the old speed would be a jump.
    """

    feedback_timeout_ns: int
    status_timeout_ns: int
    arming_timeout_ns: int
    max_step_gap_ns: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that a driver knows when it steps the machine.

    link_error: "" while the link works.
    feedback_ns, status_ns: when the newest motion feedback and the newest status arrived (None: never).
    command_refusal: why the base does not take commands, by the newest status ("" when it takes them).
    stop_cause: why the robot must not move ("" for none).
    standing: measured speed is zero; False when unknown.
    command_is_zero: the setpoint of this step asks for no motion.
    silence_hint: while no status or no motion feedback was ever heard, what came instead and what to check.
    late_answer: how late the last answer came, if it came too late to be used.
    resettable: the base keeps stop_cause until arming resets it, so it prevents armed, but not arming.
    input_overflow: more was waiting than could be read, so what is known may be out of date.
    """

    now_ns: int
    link_error: str
    feedback_ns: int | None
    status_ns: int | None
    command_refusal: str
    stop_cause: str
    standing: bool
    command_is_zero: bool
    silence_hint: str = ""
    late_answer: str = ""
    resettable: bool = False
    input_overflow: bool = False


@dataclass(frozen=True, slots=True)
class Arming:
    """State of the machine: the mode, its cause, since when, and the time of the last step.

    cleared: the cause of a latched mode has gone, only consent is missing.
    refusal: why the last arm() was refused.
    """

    mode: ChassisMode = ChassisMode.STANDBY
    cause: str = "not armed"
    since_ns: int = 0
    stepped_ns: int = 0
    cleared: bool = False
    refusal: str = ""

    @property
    def reason(self) -> str:
        """The cause, whether it has gone, and the refusal, in one line."""
        cleared = "; gone now, arm again to go on" if self.cleared else ""
        refusal = f"; arming refused: {self.refusal}" if self.refusal else ""
        return self.cause + cleared + refusal

    @property
    def may_move(self) -> bool:
        """True in the only mode in which anything but zero may be sent."""
        return self.mode is ChassisMode.ARMED

    @property
    def latched(self) -> bool:
        """True in the modes that only arm() ends."""
        return self.mode in LATCHED_MODES


def step(state: Arming, evidence: Evidence, limits: ArmingLimits) -> Arming:
    """The state after one exchange."""
    return replace(_next(state, evidence, limits), stepped_ns=evidence.now_ns)


def consent(state: Arming, evidence: Evidence, limits: ArmingLimits) -> Arming:
    """The state after arm(): arming, or the old state with the refusal in its reason. Armed and arming stay
    as they are."""
    if state.mode in (ChassisMode.ARMED, ChassisMode.ARMING):
        return state
    if refusal := _refusal(state, evidence, limits):
        return replace(state, refusal=refusal)
    return Arming(ChassisMode.ARMING, "arming", evidence.now_ns, evidence.now_ns)


def disarm(state: Arming, now_ns: int) -> Arming:
    """The state after stop(): stopping, which leads to standby. A latched state stays latched."""
    if state.mode in (ChassisMode.ARMED, ChassisMode.ARMING):
        return Arming(ChassisMode.STOPPING, "stop was asked for", now_ns, now_ns)
    return state


def _next(state: Arming, evidence: Evidence, limits: ArmingLimits) -> Arming:
    loss = _loss(evidence, limits)
    if state.latched:
        # The link may work again while the base does not answer yet.
        answered = evidence.status_ns is not None and evidence.feedback_ns is not None
        return replace(state, cleared=answered and not loss and not evidence.stop_cause)
    # A loop that stood still has heard nothing meanwhile, and the base is not to blame for that.
    if (
        state.mode is ChassisMode.ARMED
        and not evidence.link_error
        and (stall := _stall(state, evidence, limits))
    ):
        return Arming(ChassisMode.ESTOP, stall, evidence.now_ns)
    if loss:
        return Arming(ChassisMode.LOST, loss, evidence.now_ns)
    if evidence.stop_cause and not (state.mode is ChassisMode.ARMING and evidence.resettable):
        return Arming(ChassisMode.ESTOP, evidence.stop_cause, evidence.now_ns)
    if state.mode is ChassisMode.ARMING:
        return _arming(state, evidence, limits)
    if state.mode is ChassisMode.ARMED:
        return _armed(state, evidence)
    if state.mode is ChassisMode.STOPPING and evidence.standing and evidence.command_refusal:
        return Arming(ChassisMode.STANDBY, "stopped", evidence.now_ns)
    return state


def _arming(state: Arming, evidence: Evidence, limits: ArmingLimits) -> Arming:
    # Only what arrived after the consent counts: an old "obeys" may be from before a restart.
    if evidence.status_ns is None or evidence.status_ns <= state.since_ns:
        waiting = "no status heard from the base"
    elif evidence.feedback_ns is None or evidence.feedback_ns <= state.since_ns:
        waiting = "no motion feedback heard from the base"
    elif evidence.stop_cause:
        waiting = evidence.stop_cause
    elif evidence.command_refusal:
        waiting = f"the base does not take commands: {evidence.command_refusal}"
    elif not evidence.command_is_zero:
        waiting = "the command is not zero"
    else:
        return Arming(ChassisMode.ARMED, "armed", evidence.now_ns)
    if evidence.now_ns - state.since_ns > limits.arming_timeout_ns:
        waited_s = (evidence.now_ns - state.since_ns) / NS_PER_S
        cause = f"arming gave up after {waited_s:.1f} s: {waiting}" + (
            evidence.silence_hint and f": {evidence.silence_hint}"
        )
        return Arming(ChassisMode.STANDBY, cause, evidence.now_ns)
    return replace(state, cause=f"arming: {waiting}")


def _armed(state: Arming, evidence: Evidence) -> Arming:
    if evidence.command_refusal:
        return Arming(
            ChassisMode.ESTOP, f"the base no longer obeys: {evidence.command_refusal}", evidence.now_ns
        )
    return state


def _stall(state: Arming, evidence: Evidence, limits: ArmingLimits) -> str:
    """That the control loop stood still since the last step; "" if it did not."""
    gap_ns = evidence.now_ns - state.stepped_ns
    if 0 <= gap_ns <= limits.max_step_gap_ns:
        return ""
    return f"the control loop stood still for {gap_ns / NS_PER_MS:.0f} ms"


def _refusal(state: Arming, evidence: Evidence, limits: ArmingLimits) -> str:
    if state.mode is ChassisMode.STOPPING:
        return "still stopping"
    if evidence.input_overflow:
        return "more came than can be read at once, and it may be old; what floods the line?"
    if problem := _loss(evidence, limits) or ("" if evidence.resettable else evidence.stop_cause):
        return problem
    if not evidence.command_is_zero:
        return "the command is not zero"
    return ""


def listen(evidence: Evidence, limits: ArmingLimits) -> Arming:
    """The state of a base that is only listened to: what is wrong with it now. Nothing is latched."""
    if loss := _loss(evidence, limits):
        return Arming(ChassisMode.LOST, loss, evidence.now_ns)
    if evidence.stop_cause:
        return Arming(ChassisMode.ESTOP, evidence.stop_cause, evidence.now_ns)
    missing = [
        f"no {what} heard from the base"
        for what, stamp_ns in (("status", evidence.status_ns), ("motion feedback", evidence.feedback_ns))
        if stamp_ns is None
    ]
    cause = ": ".join(filter(None, (missing[0], evidence.silence_hint))) if missing else "it answers"
    return Arming(ChassisMode.STANDBY, cause, evidence.now_ns)


def _loss(evidence: Evidence, limits: ArmingLimits) -> str:
    """Why the chassis counts as lost; "" if it does not. Feedback or status that never came is not a loss:
    arming waits for it."""
    if evidence.link_error:
        return evidence.link_error
    for what, stamp_ns, limit_ns in (
        ("motion feedback", evidence.feedback_ns, limits.feedback_timeout_ns),
        ("status", evidence.status_ns, limits.status_timeout_ns),
    ):
        if stamp_ns is not None and evidence.now_ns - stamp_ns > limit_ns:
            silence = f"no {what} for {(evidence.now_ns - stamp_ns) / NS_PER_MS:.0f} ms"
            return f"{silence}: {evidence.late_answer}" if evidence.late_answer else silence
    return ""
