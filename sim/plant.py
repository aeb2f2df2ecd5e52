"""The motion of a tracked base on the floor: two tracks with lag and limited acceleration, which scrub in
turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

from config.plant import PlantConfig
from hal.chassis.tracks import TrackGeometry
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.types import PlanarPose

# Substep: 1 mm of travel at 1 m/s. Within it, speeds follow the exact exponential of the lag.
_STEP_NS = NS_PER_MS
# A slower base stands: the speed of a track nears its target exponentially and never gets there.
PLANT_REST_MPS = 1e-3
PLANT_REST_RADPS = 1e-3


@dataclass(slots=True)
class Track:
    """One track, or the whole base along its path: its speed follows target_mps with lag."""

    target_mps: float = 0.0
    speed_mps: float = 0.0
    travel_m: float = 0.0

    def advance(self, dt_s: float, lag_s: float, max_accel_mps2: float) -> float:
        """Move for dt_s; return the distance travelled."""
        change = (self.target_mps - self.speed_mps) * -math.expm1(-dt_s / lag_s)
        limit = max_accel_mps2 * dt_s
        change = min(max(change, -limit), limit)
        distance_m = (self.speed_mps + 0.5 * change) * dt_s
        self.speed_mps += change
        self.travel_m += distance_m
        return distance_m


class TrackedPlant:
    """The true state of the base, which only the simulation knows. Deterministic: same calls, same numbers.

    The tracks follow their targets with first-order lag, within max_accel_mps2. The yaw rate from the tracks
    (track_twist) is slip_factor times the true one (twist), and their speed 1 + distance_slip times.
    """

    def __init__(self, config: PlantConfig, pose: PlanarPose | None = None, start_ns: int = 0) -> None:
        self._lag_s = config.lag_s
        self._max_accel_mps2 = config.max_accel_mps2
        self._nominal = TrackGeometry(config.track_width_m)
        self._true = TrackGeometry(config.track_width_m, config.slip_factor)
        self._distance_scale = 1.0 + config.distance_slip
        self._left = Track()
        self._right = Track()
        self._x_m, self._y_m, self._heading_rad = (
            (0.0, 0.0, 0.0) if pose is None else (pose.x_m, pose.y_m, pose.heading_rad)
        )
        self._now_ns = start_ns

    @property
    def now_ns(self) -> int:
        """The time up to which the plant has moved."""
        return self._now_ns

    @property
    def pose(self) -> PlanarPose:
        """The true pose of the body."""
        return PlanarPose(self._x_m, self._y_m, math.remainder(self._heading_rad, math.tau))

    @property
    def twist(self) -> tuple[float, float]:
        """The true (v m/s, w rad/s) of the body."""
        v_mps, w_radps = self._true.to_twist(self._left.speed_mps, self._right.speed_mps)
        return v_mps / self._distance_scale, w_radps

    @property
    def track_twist(self) -> tuple[float, float]:
        """(v m/s, w rad/s) as the base computes it from its tracks, without slip."""
        return self._nominal.to_twist(self._left.speed_mps, self._right.speed_mps)

    @property
    def track_speeds_mps(self) -> tuple[float, float]:
        """Speeds of the tracks (left, right)."""
        return self._left.speed_mps, self._right.speed_mps

    @property
    def track_travel_m(self) -> tuple[float, float]:
        """Travel of the tracks (left, right) since the start, as encoders count it."""
        return self._left.travel_m, self._right.travel_m

    def command(self, v_mps: float, w_radps: float) -> None:
        """Set track speeds for this twist, as a base does that does not account for slip."""
        self._left.target_mps, self._right.target_mps = self._nominal.to_tracks(v_mps, w_radps)

    def command_tracks(self, left_mps: float, right_mps: float) -> None:
        """Set the target speeds of the tracks."""
        self._left.target_mps, self._right.target_mps = left_mps, right_mps

    def advance_to(self, now_ns: int) -> None:
        """Move on to now_ns; a time in the past changes nothing."""
        while self._now_ns < now_ns:
            step_ns = min(_STEP_NS, now_ns - self._now_ns)
            self._advance(step_ns / NS_PER_S)
            self._now_ns += step_ns

    def _advance(self, dt_s: float) -> None:
        left_m = self._left.advance(dt_s, self._lag_s, self._max_accel_mps2)
        right_m = self._right.advance(dt_s, self._lag_s, self._max_accel_mps2)
        travel_m, turn_rad = self._true.to_twist(left_m, right_m)
        distance_m = travel_m / self._distance_scale
        # The chord of such a short arc equals its length to 1e-9, and has the direction of its middle.
        middle_rad = self._heading_rad + 0.5 * turn_rad
        self._x_m += distance_m * math.cos(middle_rad)
        self._y_m += distance_m * math.sin(middle_rad)
        self._heading_rad += turn_rad
