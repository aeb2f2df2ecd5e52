"""What all chassis drivers share: arming, a link that may be lost, and the final check of the command.

A driver adds its protocol in four methods: _receive, _send, _send_stop and _begin_arming; one whose base only
answers queries adds a fifth, _query. All but _begin_arming may raise LinkLost, which is handled here:
exchange(), arm(), stop() and listen() never raise.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from types import TracebackType
from typing import Protocol, Self

from hal.api import Device
from hal.chassis import arming
from hal.chassis.arming import Arming, ArmingLimits, Evidence
from hal.chassis.command import CommandLimits, is_zero, zero
from hal.chassis.following import Following
from hal.chassis.low_battery import LowBattery
from hal.chassis.rolling_back import RollingBack
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.errors import LinkLost
from hal.geometry import advance_pose
from hal.types import ChassisState, PlanarPose, Setpoint

# How long a lost link is left alone before the next try, counted from the exchange after the last try:
# opening a port can take milliseconds, or more.
_RETRY_NS = 500 * NS_PER_MS

# How often arm() reads while bytes keep coming. Each read takes at most as much as one exchange does.
_MAX_READS = 32


class ChassisFeedback(Protocol):
    """What the base has reported. hal.types.ChassisState and arming.Evidence describe the fields.

    pose_ns: the time for which pose holds; None while there is no pose.
    silence_hint: what came instead of a status, and what to check.
    """

    @property
    def feedback_ns(self) -> int | None: ...
    @property
    def status_ns(self) -> int | None: ...
    @property
    def command_refusal(self) -> str: ...
    @property
    def stop_cause(self) -> str: ...
    @property
    def silence_hint(self) -> str: ...
    @property
    def v_mps(self) -> float: ...
    @property
    def w_radps(self) -> float: ...
    @property
    def standing(self) -> bool: ...
    @property
    def pose(self) -> PlanarPose: ...
    @property
    def pose_ns(self) -> int | None: ...
    @property
    def battery_v(self) -> float: ...
    @property
    def faults(self) -> tuple[str, ...]: ...


class ChassisDriver(ABC):
    """hal.api.Chassis and hal.api.ChassisListener without the protocol."""

    def __init__(
        self,
        link: Device,
        feedback: ChassisFeedback,
        commands: CommandLimits,
        limits: ArmingLimits,
        battery_low_v: float | None = None,
    ) -> None:
        """battery_low_v: the operator is told where the battery stays below it; None: never."""
        self._device = link
        self._reported = feedback
        self._commands = commands
        self._limits = limits
        self._arming = Arming()
        self._following = Following()
        self._rolling_back = RollingBack()
        self._low_battery = LowBattery(battery_low_v)
        self._reverse_allowed = True
        self._requested: Setpoint | None = None
        self._setpoint_error = ""
        self._link_error = ""
        self._retry_ns: int | None = None
        self._now_ns = 0
        self._commanded = False

    def __enter__(self) -> Self:
        """Open the link. Raises DeviceNotFound, DeviceRefused."""
        self._device.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self._commanded:  # else there is nothing to stop, or somebody else's drive
                self.stop(self._now_ns)
        finally:
            self._device.__exit__(kind, error, trace)

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """See hal.api.Chassis. sent is the setpoint limited to what the base can do, before it is rounded to
        the resolution of the protocol."""
        self._now_ns = now_ns
        self._commanded = True
        self._requested = setpoint
        self._setpoint_error = self._commands.setpoint_error(setpoint, now_ns)
        self._poll_link(now_ns)
        self._low_battery.step(self._reported.battery_v, now_ns)
        self._following.step(self._reported.pose, now_ns)
        self._rolling_back.step(self._reported.pose, now_ns, expected=self._reverse_allowed)
        self._arming = arming.step(self._arming, self._evidence(now_ns), self._limits)
        command = self._commands.fit(setpoint, now_ns) if self._arming.may_move else zero(now_ns)
        # While not armed, the base may be pushed, or driven by somebody else.
        self._following.ordered(command if self._arming.may_move else None)
        self._reverse_allowed = command.v_mps < 0.0 or not self._arming.may_move
        return self._state(now_ns, self._send_unless_lost(command, now_ns))

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis. The reason of a refusal is in the state's reason."""
        self._now_ns = now_ns
        self._commanded = True
        # Read everything first: bytes of unknown age in the port must not count as an answer to this consent.
        input_overflow = all(self._poll_link(now_ns) for _ in range(_MAX_READS))
        before = self._arming.mode
        evidence = replace(self._evidence(now_ns), input_overflow=input_overflow)
        self._arming = arming.consent(self._arming, evidence, self._limits)
        if self._arming.mode is not before:
            self._begin_arming()

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._now_ns = now_ns
        self._arming = arming.disarm(self._arming, now_ns)
        try:  # Also on a lost link: it may work again.
            self._send_stop(now_ns)
        except LinkLost as error:
            self._handle_loss(error, now_ns)

    def listen(self, now_ns: int) -> ChassisState:
        """See hal.api.ChassisListener. For a driver that is never armed and never exchanges."""
        self._now_ns = now_ns
        self._poll_link(now_ns)
        self._low_battery.step(self._reported.battery_v, now_ns)
        if not self._link_error:
            try:
                self._query(now_ns)
            except LinkLost as error:
                self._handle_loss(error, now_ns)
        self._arming = arming.listen(self._evidence(now_ns), self._limits)
        return self._state(now_ns, None)

    @abstractmethod
    def _receive(self, now_ns: int) -> bool:
        """Read and keep what has arrived, without waiting and up to a maximum; return whether anything had.

        Must use the link every time, so that a link that works again is noticed. May raise LinkLost.
        """

    @abstractmethod
    def _send(self, command: Setpoint, now_ns: int) -> Setpoint | None:
        """Send what is due; return the motion command that was sent, None if none was due. May raise
        LinkLost.

        command is already zero in every mode except armed. A zero that replaces motion is due at once.
        """

    @abstractmethod
    def _send_stop(self, now_ns: int) -> None:
        """Send an explicit zero, then standby, now. May raise LinkLost."""

    @abstractmethod
    def _begin_arming(self) -> None:
        """Arming begins: forget what the base reported before about taking commands."""

    def _query(self, now_ns: int) -> None:
        """Ask what is due, for a base that is only listened to and reports nothing by itself. Never a
        command. May raise LinkLost."""
        del now_ns  # a base that reports by itself is asked nothing

    def _resettable(self) -> bool:
        """Whether the base keeps its stop cause until arming resets it."""
        return False

    def _missing_feedback(self) -> str:
        """If the base sent a status but no motion feedback: what came instead, and what to do; "" if that
        is unknown."""
        return ""

    def _late_answer(self) -> str:
        """How late the last answer came, if it came too late to be used; "" if it did not."""
        return ""

    def _silence_hint(self) -> str:
        if self._reported.status_ns is None:
            return self._reported.silence_hint
        return self._missing_feedback() if self._reported.feedback_ns is None else ""

    def _poll_link(self, now_ns: int) -> bool:
        """Read from the link, unless it is lost and not yet due to be tried again; return whether anything
        came."""
        if self._link_error and not self._retry_due(now_ns):
            return False
        try:
            received = self._receive(now_ns)
        except LinkLost as error:
            self._handle_loss(error, now_ns)
            return False
        self._link_error = ""
        return received

    def _retry_due(self, now_ns: int) -> bool:
        """Whether a lost link is due to be tried again. The waiting time begins with the first exchange after
        the last try, because only then the end of that try is known."""
        if self._retry_ns is None:
            self._retry_ns = now_ns + _RETRY_NS
        return now_ns >= self._retry_ns

    def _send_unless_lost(self, command: Setpoint, now_ns: int) -> Setpoint | None:
        if self._link_error:
            return None
        try:
            return self._send(command, now_ns)
        except LinkLost as error:
            self._handle_loss(error, now_ns)
            return None

    def _handle_loss(self, error: LinkLost, now_ns: int) -> None:
        """Step the arming machine at once, so that the state of this same exchange says lost."""
        self._link_error = str(error)
        self._retry_ns = None
        self._arming = arming.step(self._arming, self._evidence(now_ns), self._limits)

    def _evidence(self, now_ns: int) -> Evidence:
        feedback, late_answer = self._reported, self._late_answer()
        return Evidence(
            now_ns=now_ns,
            link_error=self._link_error,
            feedback_ns=feedback.feedback_ns,
            status_ns=feedback.status_ns,
            command_refusal=feedback.command_refusal,
            stop_cause=feedback.stop_cause
            or self._setpoint_error
            or self._rolling_back.sentence
            or self._following.sentence,
            standing=feedback.standing,
            command_is_zero=is_zero(self._requested),
            silence_hint=late_answer or self._silence_hint(),
            late_answer=late_answer,
            resettable=self._resettable(),
        )

    def _state(self, now_ns: int, sent: Setpoint | None) -> ChassisState:
        feedback = self._reported
        return ChassisState(
            stamp_ns=now_ns,
            mode=self._arming.mode,
            reason=self._arming.reason,
            feedback_ns=feedback.feedback_ns,
            v_mps=feedback.v_mps,
            w_radps=feedback.w_radps,
            pose=self._pose_now(now_ns),
            battery_v=feedback.battery_v,
            faults=feedback.faults + ((told,) if (told := self._low_battery.sentence) else ()),
            sent=sent,
        )

    def _pose_now(self, now_ns: int) -> PlanarPose:
        """The reported pose, extrapolated to now with the reported speeds.

        Feedback may come less often than exchanges, and consecutive poses must not stand still and then jump.
        Beyond the feedback's time limit the motion is unknown, and the pose is not extrapolated further.
        """
        feedback = self._reported
        if feedback.pose_ns is None or math.isnan(feedback.v_mps):
            return feedback.pose
        age_ns = min(max(now_ns - feedback.pose_ns, 0), self._limits.feedback_timeout_ns)
        return (
            advance_pose(feedback.pose, feedback.v_mps, feedback.w_radps, age_ns / NS_PER_S)
            if age_ns
            else feedback.pose
        )
