"""Skid-steer kinematics of a tracked base, and dead reckoning from what it reports.

Tracks scrub sideways in a turn, so the base turns less than its track speeds say, as if the tracks were
further apart: effective width = real width * slip factor. (Mandow et al. 2007 call the tracks' virtual
contact points the ICRs; this is the symmetric case.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hal.geometry import advance_pose
from hal.types import PlanarPose

ORIGIN = PlanarPose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class TrackGeometry:
    """Geometry of a pair of tracks.

    width_m: between the track centres. slip_factor: >= 1, to be measured on the floor the robot drives on.
    """

    width_m: float
    slip_factor: float = 1.0

    @property
    def effective_width_m(self) -> float:
        """The width for which w = (right - left) / width holds on this floor."""
        return self.width_m * self.slip_factor

    def to_tracks(self, v_mps: float, w_radps: float) -> tuple[float, float]:
        """Track speeds (left, right) in m/s for this motion."""
        half_mps = 0.5 * w_radps * self.effective_width_m
        return v_mps - half_mps, v_mps + half_mps

    def to_twist(self, left: float, right: float) -> tuple[float, float]:
        """(v, w) from two track speeds, or (metres ahead, radians turned) from two track distances."""
        return 0.5 * (left + right), (right - left) / self.effective_width_m


def scale_to_fit(value: float, other: float, limit: float, other_limit: float) -> tuple[float, float]:
    """Both values scaled by one ratio <= 1 so that each is within its limit: the curvature does not
    change."""
    ratio = 1.0
    if abs(value) > limit:
        ratio = limit / abs(value)
    if abs(other) * ratio > other_limit:
        ratio = other_limit / abs(other)
    return value * ratio, other * ratio


def wrapped_difference(newer: int, older: int, bits: int = 32) -> int:
    """newer - older for a counter that wraps at 2**bits: the shorter way round, signed."""
    half = 1 << (bits - 1)
    return (newer - older + half) % (1 << bits) - half


class DeadReckoning:
    """The pose relative to the start, integrated from the motion that the base reports."""

    def __init__(self) -> None:
        self.pose = ORIGIN

    def advance(self, distance_m: float, turn_rad: float) -> None:
        """Move along an arc of this length and turn angle."""
        self.pose = advance_pose(self.pose, distance_m, turn_rad, 1.0)


class TrackCounter:
    """Increments of two wrapping counters, with detection of a restart of the base.

    A jump that no track can make counts as a restart. So does a return to 0 that the motion before does not
    explain: if the base restarts soon after it set off, the jump is short.
    """

    def __init__(self, bits: int = 32) -> None:
        self._bits = bits
        self._last: tuple[int, int] | None = None

    def increments(
        self,
        left: int,
        right: int,
        limit: float,
        expected: tuple[float, float] = (0.0, 0.0),
        slack: float = math.inf,
    ) -> tuple[int, int] | None:
        """Counts since the last call; (0, 0) at the first call; None after a restart, from which counting
        starts anew, unless start_at() says otherwise.

        limit: the largest plausible increment.
        expected: counts (left, right) at the speed measured before, NaN where unknown.
        slack: how many counts a track may deviate from that; inf turns the detection of a return to 0 off.
        """
        last, self._last = self._last, (left, right)
        if last is None:
            return 0, 0
        left_step = wrapped_difference(left, last[0], self._bits)
        right_step = wrapped_difference(right, last[1], self._bits)
        if max(abs(left_step), abs(right_step)) > limit:
            return None
        if self._restarted_from_zero(last, (left, right), expected, slack):
            return None
        return left_step, right_step

    def start_at(self, left: int, right: int) -> None:
        """Count the next increments from here."""
        self._last = left, right

    def _restarted_from_zero(
        self, last: tuple[int, int], new: tuple[int, int], expected: tuple[float, float], slack: float
    ) -> bool:
        """Whether the counters restarted from 0.

        Both must be near 0 now. At least one must have returned there by more than its motion explains, and
        the other must have done so, too, or have been near 0 before.
        """
        any_returned = False
        for before, after, expected_step in zip(last, new, expected, strict=True):
            count_before, count_now = (wrapped_difference(count, 0, self._bits) for count in (before, after))
            known = expected_step if math.isfinite(expected_step) else 0.0
            max_moved = slack + abs(known)  # the most that a track can have moved since the restart
            towards_zero = max(0.0, -known if count_before > 0 else known)
            returned = abs(count_before) - abs(count_now) > slack + 2.0 * towards_zero
            if abs(count_now) > max_moved or (not returned and abs(count_before) > max_moved):
                return False
            any_returned = any_returned or returned
        return any_returned
