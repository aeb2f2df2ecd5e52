"""Track speeds and pose from the two encoder counters of a motor controller.

The base class of the feedback of RoboClaw and Roboteq, and of other bases with two encoders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hal.chassis.tracks import DeadReckoning, TrackCounter, TrackGeometry, wrapped_difference
from hal.clocks import NS_PER_S
from hal.types import PlanarPose

# A larger counter step than this ratio of what the motors can do, plus the slack, is a restart or noise.
_JUMP_RATIO = 1.5
_JUMP_SLACK_M = 0.05

# How far a track may deviate from its last speed between two answers, by stopping or rolling back.
_STEP_SLACK_M = 0.01

# Below these the base stands still.
_STANDING_MPS = 0.005
_STANDING_RADPS = 0.01


@dataclass(frozen=True, slots=True)
class _Counts:
    left: int
    right: int
    requested_ns: int


class EncoderFeedback:
    """The part of hal.chassis.driver.ChassisFeedback that comes from the counters. Speed is the counter step
    divided by the time between two answers.

    signs: +1 or -1 for (left, right), the sign of counts that mean ahead. max_track_mps: maximum track speed.
    checksum: whether the answers have one. If so, a jump is a restart. If not, it may be a wrong digit: the
    answer is dropped as a lost one is, and it was a restart if the next counts go on from it.
    counter_bits: how wide the counters are.
    """

    def __init__(
        self,
        geometry: TrackGeometry,
        counts_per_m: float,
        signs: tuple[int, int],
        max_track_mps: float,
        *,
        checksum: bool = True,
        counter_bits: int = 32,
    ) -> None:
        self._geometry = geometry
        self._counts_per_m = counts_per_m
        self._signs = signs
        self._max_track_mps = max_track_mps
        self._reckoning = DeadReckoning()
        self._checksum = checksum
        self._counter_bits = counter_bits
        self._counter = TrackCounter(counter_bits)
        self._believed: _Counts | None = None
        self._suspect: _Counts | None = None
        self._restarted = False
        self._setup_requested = False
        self.bytes_received = 0
        self.pose_ns: int | None = None
        self.feedback_ns: int | None = None
        self.status_ns: int | None = None
        self.v_mps = math.nan
        self.w_radps = math.nan
        self.battery_v = math.nan
        self.currents_a = (math.nan, math.nan)

    @property
    def pose(self) -> PlanarPose:
        """Dead reckoning since the driver was made."""
        return self._reckoning.pose

    @property
    def standing(self) -> bool:
        """Whether the measured speed is zero, except for a count or two of jitter; False while unknown."""
        return abs(self.v_mps) <= _STANDING_MPS and abs(self.w_radps) <= _STANDING_RADPS

    def await_setup(self) -> None:
        """Arming begins: earlier settings are no longer trusted; they must be set and read back."""
        self._setup_requested = True
        self._restarted = False

    def forget_setup(self) -> None:
        """The controller is no longer asked to take commands."""
        self._setup_requested = False

    def _take_counters(self, left: int, right: int, requested_ns: int, now_ns: int) -> None:
        """Take in both counters: asked for at requested_ns, answered at now_ns."""
        counts, last, suspect = _Counts(left, right, requested_ns), self._believed, self._suspect
        elapsed_s = 0.0 if last is None else (requested_ns - last.requested_ns) / NS_PER_S
        steps = self._counter.increments(
            left,
            right,
            self._jump_limit(elapsed_s),
            self._expected_counts(elapsed_s),
            _STEP_SLACK_M * self._counts_per_m,
        )
        # This outranks a plausible step: after a restart near 0, counts may go on from those before it, too.
        goes_on_from_suspect = suspect is not None and self._goes_on(suspect, counts)
        if steps is None and last is not None and not self._checksum and not goes_on_from_suspect:
            self._suspect = counts
            self._counter.start_at(last.left, last.right)
            return
        self._believed, self._suspect, self.pose_ns = counts, None, requested_ns
        if steps is None or goes_on_from_suspect:
            self._restarted = True
            self.v_mps = self.w_radps = math.nan
            return
        if last is None or elapsed_s <= 0.0:
            return
        distance_m, turn_rad = self._geometry.to_twist(
            self._signs[0] * steps[0] / self._counts_per_m, self._signs[1] * steps[1] / self._counts_per_m
        )
        self._reckoning.advance(distance_m, turn_rad)
        self.v_mps, self.w_radps = distance_m / elapsed_s, turn_rad / elapsed_s
        self.feedback_ns = now_ns

    def _jump_limit(self, elapsed_s: float) -> float:
        """The most counts that a track can make in this time."""
        return (_JUMP_RATIO * self._max_track_mps * elapsed_s + _JUMP_SLACK_M) * self._counts_per_m

    def _goes_on(self, last: _Counts, new: _Counts) -> bool:
        """Whether the tracks can have moved from the one to the other."""
        limit = self._jump_limit((new.requested_ns - last.requested_ns) / NS_PER_S)
        left = wrapped_difference(new.left, last.left, self._counter_bits)
        right = wrapped_difference(new.right, last.right, self._counter_bits)
        return max(abs(left), abs(right)) <= limit

    def _expected_counts(self, elapsed_s: float) -> tuple[float, float]:
        """Counts (left, right) in this time at the last measured speed; NaN while unknown."""
        left_mps, right_mps = self._geometry.to_tracks(self.v_mps, self.w_radps)
        counts = self._counts_per_m * elapsed_s
        return self._signs[0] * left_mps * counts, self._signs[1] * right_mps * counts
