"""The errors of a real perception, as numbers for controller/campaign/noisy_camera.py."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Standard deviations, times and shares; z is the distance in metres."""

    depth_sigma_1pm: float = 0.0075
    tracked_depth_ratio: float = 0.25
    lateral_sigma_m: float = 0.01
    lateral_velocity_mps: float = 0.05
    lateral_velocity_per_m: float = 0.010
    radial_velocity_mps: float = 0.07
    radial_velocity_per_m: float = 0.025
    first_velocity_mps: float = 1.5
    first_velocity_decay_s: float = 0.12
    velocity_lag_s: float = 0.15
    correlation_s: float = 0.25
    sightings: int = 3
    miss_rate: float = 0.03
    miss_rate_at_range: float = 0.4
    forget_s: float = 0.5
    moving_mps: float = 0.15
    moving_per_m: float = 0.02
    rise_s: float = 0.1
    fall_s: float = 0.3
    surface_bias_sigmas: float = 1.0
    surface_sigmas: float = 0.5
