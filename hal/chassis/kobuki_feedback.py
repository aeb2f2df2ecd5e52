"""What a Kobuki has reported: wheel speeds, pose, bumper, cliff and wheel-drop switches."""

from __future__ import annotations

import math

from config.chassis import KobukiChassisConfig
from hal.chassis.disagreement import Disagreement
from hal.chassis.frame_age import FrameAge
from hal.chassis.kobuki_packets import (
    CHARGER_OFF_CABLE,
    CHARGER_ON_CABLE,
    CLOCK_BITS,
    ENCODER_BITS,
    TICK_M,
    WHEEL_BASE_M,
    Core,
    Feedback,
    Inertia,
)
from hal.chassis.tracks import DeadReckoning, TrackCounter, TrackGeometry, wrapped_difference
from hal.clocks import NS_PER_MS
from hal.geometry import wrap_angle_rad
from hal.types import PlanarPose

_SIDES = ("right", "centre", "left")
_WHEELS = ("right", "left")
_MOTORS = ("left", "right")

# Below these the base stands still.
_STANDING_MPS = 0.01
_STANDING_RADPS = 0.03

# A larger step of the ticks than this ratio of what the wheels can do, plus the slack, is a restart.
_JUMP_RATIO = 1.5
_JUMP_SLACK_M = 0.02

# Tolerated difference of the yaw by gyro and by wheels in one second: the wheels slip a little, and the gyro
# drifts. Beyond it, a wheel is blocked or one of the sensors is wrong.
_DISAGREEMENT_RAD = 0.3
_DISAGREEMENT_RATIO = 0.4

# The vendor's driver calls the battery dangerously low below this (kobuki_core, battery.cpp).
_BATTERY_DANGEROUS_V = 13.2

# How much more time may have passed between two frames by the base's clock than by ours. Frames wait in
# buffers: less may have passed for the base (but not less than none), and more only by the time that the
# earlier frame had waited, which is always less than this.
_MAX_CLOCK_LEAD_MS = 500


class KobukiFeedback:
    """The newest value of everything the base reports.

    Distance comes from the wheel ticks. Yaw comes from the gyro, which slip does not affect, where a frame
    has it. The yaw from the wheels is compared with it, and a large difference stops the base.

    The time between two frames is that of the base's own clock: frames wait in buffers, ticks do not. A
    report holds for the time at which its frame was made, as far as the two clocks show that. If frames
    arrive later and later, the feedback therefore grows old.
    """

    def __init__(self, config: KobukiChassisConfig) -> None:
        self._config = config
        self._geometry = TrackGeometry(WHEEL_BASE_M, config.slip_factor)
        self._reckoning = DeadReckoning()
        self._counter = TrackCounter(ENCODER_BITS)
        self._core: Core | None = None
        self._previous: Core | None = None  # the frame that the next one continues
        self._angle_rad: float | None = None
        self._disagreement = Disagreement(
            "gyro and wheels disagree", "rad", _DISAGREEMENT_RAD, _DISAGREEMENT_RATIO
        )
        self._age = FrameAge()
        self._arrived_ns = 0
        self._restarted = False
        self._setup_requested = False
        self.bytes_received = 0
        self.pose_ns: int | None = None
        self.feedback_ns: int | None = None
        self.v_mps = math.nan
        self.w_radps = math.nan
        self.currents_a = (math.nan, math.nan)

    @property
    def pose(self) -> PlanarPose:
        """Dead reckoning since the driver was made."""
        return self._reckoning.pose

    @property
    def status_ns(self) -> int | None:
        """The time of the pose: ticks and switches come in the same frame."""
        return self.pose_ns

    @property
    def standing(self) -> bool:
        """Whether the measured speed is zero, except for a tick or two of jitter; False while unknown."""
        return abs(self.v_mps) <= _STANDING_MPS and abs(self.w_radps) <= _STANDING_RADPS

    @property
    def battery_v(self) -> float:
        """Battery voltage; NaN while unknown."""
        return math.nan if self._core is None else self._core.battery_v

    @property
    def command_refusal(self) -> str:
        """A Kobuki always takes commands, so this tells only whether it restarted since it was armed."""
        if not self._setup_requested:
            return "it was not asked to"
        return "its clock or its ticks jumped: restarted" if self._restarted else ""

    @property
    def silence_hint(self) -> str:
        """What came instead of a frame with the basic sensors, and what to check."""
        if self.bytes_received == 0:
            return "not one byte came; check port, power and the switch on the base"
        return f"{self.bytes_received} bytes came, no frame of a Kobuki; check port and baud (115200)"

    @property
    def stop_cause(self) -> str:
        """Which of the base's own sensors require a stop; "" for none. Unknown bits count, too."""
        core = self._core
        if core is None:
            return ""
        causes = [
            *_named_bits("bumper pressed", core.bumper, _SIDES),
            *_named_bits("cliff", core.cliff, _SIDES),
            *_named_bits("wheel dropped", core.wheel_drop, _WHEELS),
        ]
        if core.charger in CHARGER_ON_CABLE:
            causes.append("the charging cable is plugged in")
        elif core.charger not in CHARGER_OFF_CABLE:
            causes.append(f"unknown state {core.charger} of the charger")
        if self._disagreement.sentence and not causes:
            return self._disagreement.sentence
        return f"emergency stop by the base's own sensors: {', '.join(causes)}" if causes else ""

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults that are not a reason to stop at once."""
        core = self._core
        if core is None:
            return ()
        dangerous = f"error: battery below {_BATTERY_DANGEROUS_V:g} V"
        battery = (dangerous,) if core.battery_v < _BATTERY_DANGEROUS_V else ()
        return battery + _named_bits("error: motor over-current", core.over_current, _MOTORS)

    def await_setup(self) -> None:
        """Arming begins: what is reported from now on need not continue what waited in buffers before."""
        self._setup_requested = True
        self._restarted = False
        self._previous = None
        self._counter = TrackCounter(ENCODER_BITS)
        self._age.restart()

    def forget_setup(self) -> None:
        """The base is no longer asked to take commands."""
        self._setup_requested = False

    def take(self, frame: Feedback, now_ns: int) -> None:
        """Take in one frame that arrived at now_ns."""
        if frame.currents_a is not None:
            self.currents_a = frame.currents_a
        if frame.core is not None:
            self._take_core(frame.core, frame.inertia, now_ns)

    def _take_core(self, core: Core, inertia: Inertia | None, now_ns: int) -> None:
        last, self._core, self._previous = self._previous, core, core
        last_ns, self._arrived_ns = self._arrived_ns, now_ns
        last_rad, self._angle_rad = self._angle_rad, None if inertia is None else inertia.angle_rad
        elapsed_ms = 0
        if last is not None:
            elapsed_ms = wrapped_difference(core.clock_ms, last.clock_ms, CLOCK_BITS)
            max_ms = (now_ns - last_ns) / NS_PER_MS + _MAX_CLOCK_LEAD_MS
            if not 0 <= elapsed_ms <= max_ms:
                self._handle_restart(core, now_ns)
                return
        self.pose_ns = now_ns - self._age.step(elapsed_ms, now_ns)
        limit_m = _JUMP_RATIO * self._max_wheel_mps() * abs(elapsed_ms) / 1000.0 + _JUMP_SLACK_M
        steps = self._counter.increments(core.left_ticks, core.right_ticks, limit_m / TICK_M)
        if steps is None:
            self._handle_restart(core, now_ns)
            return
        if elapsed_ms <= 0:
            return
        distance_m, turn_rad = self._geometry.to_twist(steps[0] * TICK_M, steps[1] * TICK_M)
        elapsed_s = elapsed_ms / 1000.0
        self.w_radps = turn_rad / elapsed_s
        if inertia is not None:
            self.w_radps = inertia.rate_radps
            if last_rad is not None:
                self._disagreement.expect(turn_rad)
                turn_rad = wrap_angle_rad(inertia.angle_rad - last_rad)
                self._disagreement.compare(turn_rad, now_ns)
        self._reckoning.advance(distance_m, turn_rad)
        self.v_mps = distance_m / elapsed_s
        self.feedback_ns = self.pose_ns

    def _handle_restart(self, core: Core, now_ns: int) -> None:
        """The base restarted: the motion since the last frame is unknown, and counting starts anew."""
        self._restarted = True
        self.pose_ns = now_ns
        self._age.restart()
        self._disagreement.restart(now_ns)
        self._counter = TrackCounter(ENCODER_BITS)
        self._counter.increments(core.left_ticks, core.right_ticks, math.inf)
        self.v_mps = self.w_radps = math.nan

    def _max_wheel_mps(self) -> float:
        config = self._config
        return config.max_speed_mps + self._geometry.to_tracks(0.0, config.max_yaw_rate_radps)[1]


def _named_bits(what: str, bits: int, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(
        f"{what} ({names[bit] if bit < len(names) else f'unknown bit {bit}'})"
        for bit in range(8)
        if bits >> bit & 1
    )
