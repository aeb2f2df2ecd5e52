"""What an AgileX base has reported: speeds, dead-reckoned pose, mode, faults, battery."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from config.agilex import AGILEX_TOP_YAW_RATE_RADPS
from config.chassis import AgilexChassisConfig
from hal.chassis.agilex_messages import (
    ActuatorSlow,
    AgilexMessage,
    Battery,
    MotionFeedback,
    Odometer,
    SystemState,
)
from hal.chassis.agilex_models import (
    VEHICLE_ESTOP,
    VEHICLE_NORMAL,
    AgilexModel,
    over_serial,
    track_width_of,
)
from hal.chassis.disagreement import Disagreement
from hal.chassis.other_master import OtherMaster
from hal.chassis.tracks import DeadReckoning, TrackCounter, TrackGeometry
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.types import PlanarPose

# Below these the tracks stand still: two steps of the protocol's resolution.
_STANDING_MPS = 0.002
_STANDING_RADPS = 0.002

# By this identifier the vendor's SDK recognises a base of protocol V1.
_V1_STATE_ID = 0x151

# Minimum period of 0x211, and how many may arrive at once on top of that: the shortest period in any manual
# is 20 ms (TRACER v1.2).
_MIN_STATE_PERIOD_NS = 10 * NS_PER_MS
_MAX_STATE_BURST = 2

# Travel beyond what the top speed allows that two odometer frames cannot be apart, even where frames were
# lost or came late.
_JUMP_SLACK_M = 0.2

# How far a track may deviate from its last speed between two odometer frames, by stopping or rolling back.
_STEP_SLACK_M = 0.01
# Period of the odometer.
_ODOMETER_S = 0.02

# 0x221 and 0x311 describe the same tracks. If they differ by more than this plus this share in one second,
# one of them is wrong.
_DISAGREEMENT_M = 0.15
_DISAGREEMENT_RATIO = 0.3


class AgilexFeedback:
    """The newest value of everything the base reports.

    Dead reckoning: if the track width is known, the odometer 0x311 is used. It loses nothing when frames are
    lost or late, and its rounding to 1 mm does not accumulate. Otherwise the speeds 0x221, which need no
    geometry, are integrated over their times of arrival.

    After a restart the control mode is standby again. Where 0x421 is repeated, it may put the base back into
    command mode before the base reports standby. Then the restart shows in a jump of the odometer that no
    track can make, or in the count of 0x211 (byte 7, 0..255), which begins anew.

    no_frames_hint: what came and what to check, for the case that not one frame was understood. other_master:
    whether somebody else commands the base.
    """

    def __init__(
        self,
        config: AgilexChassisConfig,
        model: AgilexModel,
        no_frames_hint: Callable[[], str],
        other_master: OtherMaster,
    ) -> None:
        self._model = model
        self._other_master = other_master
        self._command_mode = model.command_mode(over_serial(config))
        self._other_control_modes = (model.modes_remote | {model.mode_can, model.mode_serial}) - {
            self._command_mode
        }
        self._actuators = config.actuators or model.actuators
        self._no_frames_hint = no_frames_hint
        self._slip_factor = config.slip_factor
        self._top_speed_mps = config.top_speed_mps
        self._top_yaw_rate_radps = AGILEX_TOP_YAW_RATE_RADPS[config.model]
        width_m = track_width_of(config)
        self._geometry = None if width_m is None else TrackGeometry(width_m, config.slip_factor)
        self._max_gap_ns = config.feedback_timeout_ms * NS_PER_MS
        self._reckoning = DeadReckoning()
        self._counter = TrackCounter()
        self._disagreement = Disagreement(
            "odometer and speed feedback disagree", "m", _DISAGREEMENT_M, _DISAGREEMENT_RATIO
        )
        self._odometer_ns: int | None = None
        self._state: SystemState | None = None
        self._battery: Battery | None = None
        self._driver_bits: dict[int, int] = {}
        self._foreign_id: int | None = None
        self._highest_actuator = 0
        self._restart = ""
        self.motion_ns: int | None = None
        self.status_ns: int | None = None
        self.v_mps = math.nan
        self.w_radps = math.nan
        self.faults: tuple[str, ...] = ()

    @property
    def pose(self) -> PlanarPose:
        """Dead reckoning since the driver was made."""
        return self._reckoning.pose

    @property
    def pose_ns(self) -> int | None:
        """When the newest message that dead reckoning uses arrived."""
        return self.motion_ns if self._geometry is None else self._odometer_ns

    @property
    def feedback_ns(self) -> int | None:
        """When the older of the messages that dead reckoning needs arrived; None while one is missing."""
        if self._geometry is None or self.motion_ns is None or self._odometer_ns is None:
            return self.motion_ns if self._geometry is None else None
        return min(self.motion_ns, self._odometer_ns)

    @property
    def command_refusal(self) -> str:
        """Why the base does not take commands, by its newest system state, or that it restarted since it was
        armed; "" when it obeys."""
        if self._state is None:
            return "no system state heard"
        if self._restart:
            return self._restart
        if self.in_command_mode:
            return ""
        return f"control mode is {self._model.describe_mode(self._state.control_mode)}"

    @property
    def in_command_mode(self) -> bool:
        """Whether the newest system state says that commands of this wire are followed."""
        return self._state is not None and self._state.control_mode == self._command_mode

    @property
    def silence_hint(self) -> str:
        """What came instead of 0x211, and what to check."""
        if self._foreign_id == _V1_STATE_ID:
            return "frames of protocol V1 came; this driver speaks V2"
        if self.motion_ns is not None:
            return "0x221 came, but no 0x211"
        if self._foreign_id is not None:
            return f"only foreign frames came, such as 0x{self._foreign_id:X}; is this the base's bus?"
        return self._no_frames_hint()

    @property
    def missing_message(self) -> str:
        """Which message for dead reckoning is missing, and what to do; "" if none is."""
        if self.motion_ns is None:
            return "0x211 came, but no 0x221"
        if self.feedback_ns is None:
            return "0x221 came, but no odometer 0x311; set chassis.track_width_m: null to reckon by speeds"
        return ""

    def await_setup(self) -> None:
        """Arming begins: an earlier restart no longer matters, because this base is the one to be armed. The
        odometer is counted anew, because it need not continue what waited in buffers."""
        self._restart = ""
        self._counter = TrackCounter()

    def note_foreign(self, arbitration_id: int) -> None:
        """A frame came that is not of protocol V2. Remember the first of V1, else the newest."""
        if self._foreign_id != _V1_STATE_ID:
            self._foreign_id = arbitration_id

    def note_actuator(self, index: int) -> None:
        """The motor with this index (from 0) has reported."""
        self._highest_actuator = max(self._highest_actuator, index)

    @property
    def standing(self) -> bool:
        """Whether the measured speed is zero; False while unknown."""
        return abs(self.v_mps) <= _STANDING_MPS and abs(self.w_radps) <= _STANDING_RADPS

    @property
    def battery_v(self) -> float:
        """Voltage from 0x211, else from 0x361; NaN while unknown."""
        if self._state is not None:
            return self._state.battery_v
        return math.nan if self._battery is None else self._battery.voltage_v

    @property
    def stop_cause(self) -> str:
        """Why the base must not be driven now; "" if it may be.

        Fault bits alone are not a cause: several models set "remote control lost" whenever the remote control
        is switched off. Faults that stop the base show in its vehicle state.
        """
        if self._highest_actuator >= self._actuators:
            return (
                f"motor {self._highest_actuator + 1} reports, but model {self._model.name} has "
                f"{self._actuators}; check chassis.model, or set chassis.actuators if your base has more"
            )
        if self._other_master.sentence:
            return self._other_master.sentence
        state = self._state
        if state is None:
            return ""
        if state.vehicle_state == VEHICLE_ESTOP:
            return "emergency stop is pressed"
        if state.vehicle_state != VEHICLE_NORMAL:
            faults = ", ".join(self.faults) or "no fault named"
            return f"the base reports an exception (vehicle state {state.vehicle_state}: {faults})"
        if state.control_mode in self._other_control_modes:
            taken_over = f"{self._model.describe_mode(state.control_mode)} has taken over"
            by_remote = state.control_mode in self._model.modes_remote
            return f"{taken_over}: {self._model.remote_release}" if by_remote else taken_over
        return self._disagreement.sentence

    def update(self, messages: Sequence[AgilexMessage], now_ns: int) -> None:
        """Take in what arrived since the last call."""
        motions = []
        for message in messages:
            match message:
                case MotionFeedback():
                    motions.append(message)
                case Odometer():
                    self._take_odometer(message, now_ns)
                case SystemState():
                    self._check_state_count(message, now_ns)
                    self._state, self.status_ns = message, now_ns
                    self._list_faults()
                case ActuatorSlow():
                    self.note_actuator(message.index)
                    if self._driver_bits.get(message.index) != message.state_bits:
                        self._driver_bits[message.index] = message.state_bits
                        self._list_faults()
                case Battery():
                    self._battery = message
        if motions:
            self._integrate(motions, now_ns)

    def _check_state_count(self, state: SystemState, now_ns: int) -> None:
        # Only where 0x421 is repeated. Other models stay in standby after a restart, and not every manual
        # says what their byte 7 counts.
        if self._model.mode_period_ms is None or self._state is None or self.status_ns is None:
            return
        max_increment = _MAX_STATE_BURST + (now_ns - self.status_ns) // _MIN_STATE_PERIOD_NS
        if (state.count - self._state.count) % 256 > max_increment and state.count <= max_increment:
            self._restart = "the count of its 0x211 began anew: restarted"

    def _integrate(self, motions: Sequence[MotionFeedback], now_ns: int) -> None:
        # Several at once have waited in a buffer: each covers an equal share of the time since the last
        # update. After a longer silence the motion is unknown: the newest speeds do not cover all of that
        # time.
        elapsed_ns = 0 if self.motion_ns is None else min(now_ns - self.motion_ns, self._max_gap_ns)
        interval_s = elapsed_ns / NS_PER_S / len(motions)
        for motion in motions:
            self._disagreement.expect(motion.v_mps * interval_s)
            if self._geometry is None:
                self._reckoning.advance(
                    motion.v_mps * interval_s, motion.w_radps / self._slip_factor * interval_s
                )
        self.motion_ns = now_ns
        self.v_mps = motions[-1].v_mps
        self.w_radps = motions[-1].w_radps / self._slip_factor

    def _take_odometer(self, odometer: Odometer, now_ns: int) -> None:
        if self._geometry is None:
            return
        elapsed_s = 0.0 if self._odometer_ns is None else (now_ns - self._odometer_ns) / NS_PER_S
        self._odometer_ns = now_ns
        max_track_mps = self._top_speed_mps + self._geometry.to_tracks(0.0, self._top_yaw_rate_radps)[1]
        limit_mm = 1000.0 * (max_track_mps * elapsed_s + _JUMP_SLACK_M)
        # Of several odometer frames that arrive at once, each of the later ones still covers one period.
        left_mps, right_mps = self._geometry.to_tracks(self.v_mps, self.w_radps)
        mm_per_mps = 1000.0 * max(elapsed_s, _ODOMETER_S)
        steps = self._counter.increments(
            odometer.left_mm,
            odometer.right_mm,
            limit_mm,
            (left_mps * mm_per_mps, right_mps * mm_per_mps),
            1000.0 * _STEP_SLACK_M,
        )
        if steps is None:
            self._restart = "its odometer jumped: restarted"
            self._disagreement.restart(now_ns)
            return
        distance_m, turn_rad = self._geometry.to_twist(steps[0] / 1000.0, steps[1] / 1000.0)
        self._reckoning.advance(distance_m, turn_rad)
        self._disagreement.compare(distance_m, now_ns)

    def _list_faults(self) -> None:
        bits = 0 if self._state is None else self._state.fault_bits
        found = self._model.describe_system_faults(bits)
        for index, driver_bits in sorted(self._driver_bits.items()):
            found += self._model.describe_driver_state(index, driver_bits)
        self.faults = found
