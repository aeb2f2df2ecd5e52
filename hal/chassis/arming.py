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
    stall_ns: the longest gap between two steps while armed. After a longer one the base may have stopped by
    its own time-out, and resuming the old speed would be a jump.
    """

    feedback_timeout_ns: int
    status_timeout_ns: int
    arming_timeout_ns: int
    stall_ns: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that a driver knows when it steps the machine.

    link_error: "" while the link works.
    feedback_ns, status_ns: when the newest motion feedback and the newest status arrived (None: never).
    disobeys: why the base does not take commands, by the newest status ("" when it takes them).
    stop_cause: why the robot must not move ("" for none).
    standing: measured speed is zero; False when unknown.
    command_is_zero: the setpoint of this step asks for no motion.
    silence: while no status or no motion feedback was ever heard, what came instead and what to check.
    resettable: the base keeps stop_cause until arming resets it, so it prevents armed, but not arming.
    unread: more was waiting than could be read, so what is known may be out of date.
    """

    now_ns: int
    link_error: str
    feedback_ns: int | None
    status_ns: int | None
    disobeys: str
    stop_cause: str
    standing: bool
    command_is_zero: bool
    silence: str = ""
    resettable: bool = False
    unread: bool = False


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


def step(state: Arming, seen: Evidence, limits: ArmingLimits) -> Arming:
    """The state after one exchange."""
    return replace(_next(state, seen, limits), stepped_ns=seen.now_ns)


def consent(state: Arming, seen: Evidence, limits: ArmingLimits) -> Arming:
    """The state after arm(): arming, or the old state with the refusal in its reason. Armed and arming stay
    as they are."""
    if state.mode in (ChassisMode.ARMED, ChassisMode.ARMING):
        return state
    if refusal := _refusal(state, seen, limits):
        return replace(state, refusal=refusal)
    return Arming(ChassisMode.ARMING, "arming", seen.now_ns, seen.now_ns)


def release(state: Arming, now_ns: int) -> Arming:
    """The state after stop(): stopping, which leads to standby. A latched state stays latched."""
    if state.mode in (ChassisMode.ARMED, ChassisMode.ARMING):
        return Arming(ChassisMode.STOPPING, "stop was asked for", now_ns, now_ns)
    return state


def _next(state: Arming, seen: Evidence, limits: ArmingLimits) -> Arming:
    loss = _loss(seen, limits)
    if state.latched:
        # The link may work again while the base does not answer yet.
        heard = seen.status_ns is not None and seen.feedback_ns is not None
        return replace(state, cleared=heard and not loss and not seen.stop_cause)
    # A loop that stood still has heard nothing meanwhile, and the base is not to blame for that.
    if state.mode is ChassisMode.ARMED and not seen.link_error and (stall := _stall(state, seen, limits)):
        return Arming(ChassisMode.ESTOP, stall, seen.now_ns)
    if loss:
        return Arming(ChassisMode.LOST, loss, seen.now_ns)
    if seen.stop_cause and not (state.mode is ChassisMode.ARMING and seen.resettable):
        return Arming(ChassisMode.ESTOP, seen.stop_cause, seen.now_ns)
    if state.mode is ChassisMode.ARMING:
        return _arming(state, seen, limits)
    if state.mode is ChassisMode.ARMED:
        return _armed(state, seen)
    if state.mode is ChassisMode.STOPPING and seen.standing and seen.disobeys:
        return Arming(ChassisMode.STANDBY, "stopped", seen.now_ns)
    return state


def _arming(state: Arming, seen: Evidence, limits: ArmingLimits) -> Arming:
    # Only what arrived after the consent counts: an old "obeys" may be from before a restart.
    if seen.status_ns is None or seen.status_ns <= state.since_ns:
        waiting = "no status heard from the base"
    elif seen.feedback_ns is None or seen.feedback_ns <= state.since_ns:
        waiting = "no motion feedback heard from the base"
    elif seen.stop_cause:
        waiting = seen.stop_cause
    elif seen.disobeys:
        waiting = f"the base does not take commands: {seen.disobeys}"
    elif not seen.command_is_zero:
        waiting = "the command is not zero"
    else:
        return Arming(ChassisMode.ARMED, "armed", seen.now_ns)
    if seen.now_ns - state.since_ns > limits.arming_timeout_ns:
        waited_s = (seen.now_ns - state.since_ns) / NS_PER_S
        cause = f"arming gave up after {waited_s:.1f} s: {waiting}" + (seen.silence and f": {seen.silence}")
        return Arming(ChassisMode.STANDBY, cause, seen.now_ns)
    return replace(state, cause=f"arming: {waiting}")


def _armed(state: Arming, seen: Evidence) -> Arming:
    if seen.disobeys:
        return Arming(ChassisMode.ESTOP, f"the base no longer obeys: {seen.disobeys}", seen.now_ns)
    return state


def _stall(state: Arming, seen: Evidence, limits: ArmingLimits) -> str:
    """That the control loop stood still since the last step; "" if it did not."""
    gap_ns = seen.now_ns - state.stepped_ns
    if 0 <= gap_ns <= limits.stall_ns:
        return ""
    return f"the control loop stood still for {gap_ns / NS_PER_MS:.0f} ms"


def _refusal(state: Arming, seen: Evidence, limits: ArmingLimits) -> str:
    if state.mode is ChassisMode.STOPPING:
        return "still stopping"
    if seen.unread:
        return "more came than can be read at once, and it may be old; what floods the line?"
    if problem := _loss(seen, limits) or ("" if seen.resettable else seen.stop_cause):
        return problem
    if not seen.command_is_zero:
        return "the command is not zero"
    return ""


def _loss(seen: Evidence, limits: ArmingLimits) -> str:
    """Why the chassis counts as lost; "" if it does not. Feedback or status that never came is not a loss:
    arming waits for it."""
    if seen.link_error:
        return seen.link_error
    for what, stamp_ns, limit_ns in (
        ("motion feedback", seen.feedback_ns, limits.feedback_timeout_ns),
        ("status", seen.status_ns, limits.status_timeout_ns),
    ):
        if stamp_ns is not None and seen.now_ns - stamp_ns > limit_ns:
            return f"no {what} for {(seen.now_ns - stamp_ns) / NS_PER_MS:.0f} ms"
    return ""
