"""The last look at a setpoint before it becomes bytes. The same for every driver."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from config.chassis import COMMAND_EARLY
from hal.chassis.tracks import TrackGeometry, scale_to_fit
from hal.clocks import NS_PER_MS
from hal.types import Setpoint


def is_zero(setpoint: Setpoint | None) -> bool:
    """True where no motion is asked for. NaN is not zero."""
    return setpoint is None or (setpoint.v_mps == 0.0 and setpoint.w_radps == 0.0)


def zero(now_ns: int) -> Setpoint:
    """The explicit zero."""
    return Setpoint(now_ns, 0.0, 0.0, 0.0)


def due(last_ns: int | None, period_ns: int, now_ns: int) -> bool:
    """Whether something that is sent every period_ns, and was last sent at last_ns (None: never), is due."""
    return last_ns is None or not 0 <= now_ns - last_ns < COMMAND_EARLY * period_ns


@dataclass(frozen=True, slots=True)
class CommandLimits:
    """What the base can do, and how old a setpoint may be."""

    max_speed_mps: float
    max_yaw_rate_radps: float
    timeout_ns: int

    def setpoint_error(self, setpoint: Setpoint | None, now_ns: int) -> str:
        """Why this setpoint must stop the robot; "" if it need not. A speed above the limits is no
        error: fit() slows it down."""
        if setpoint is None:
            return ""
        if not (math.isfinite(setpoint.v_mps) and math.isfinite(setpoint.w_radps)):
            return f"the command is not finite: v {setpoint.v_mps} m/s, w {setpoint.w_radps} rad/s"
        age_ns = now_ns - setpoint.stamp_ns
        if age_ns > self.timeout_ns and not is_zero(setpoint):
            return f"the command is {age_ns / NS_PER_MS:.0f} ms old"
        return ""

    def fit(self, setpoint: Setpoint | None, now_ns: int) -> Setpoint:
        """The setpoint slowed to the limits on the same curve; None becomes zero."""
        if setpoint is None:
            return zero(now_ns)
        v_mps, w_radps = scale_to_fit(
            setpoint.v_mps, setpoint.w_radps, self.max_speed_mps, self.max_yaw_rate_radps
        )
        if v_mps == setpoint.v_mps and w_radps == setpoint.w_radps:
            return setpoint
        return replace(setpoint, v_mps=v_mps, w_radps=w_radps)


def fit_tracks(
    setpoint: Setpoint, geometry: TrackGeometry, max_track_mps: float
) -> tuple[Setpoint, float, float]:
    """The setpoint slowed on the same curve until no track is faster than max_track_mps, with the speeds of
    the tracks: (setpoint, left_mps, right_mps). CommandLimits.fit does not cover this: a track on the outside
    of a bend is faster than the middle."""
    requested = geometry.to_tracks(setpoint.v_mps, setpoint.w_radps)
    left_mps, right_mps = fitted = scale_to_fit(*requested, max_track_mps, max_track_mps)
    if fitted == requested:
        return setpoint, left_mps, right_mps
    v_mps, w_radps = geometry.to_twist(left_mps, right_mps)
    return replace(setpoint, v_mps=v_mps, w_radps=w_radps), left_mps, right_mps
