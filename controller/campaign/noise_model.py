"""The errors of a real perception, as numbers for controller/campaign/noisy_camera.py."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Standard deviations, times and shares; z is the distance in metres."""

    depth_sigma_1pm: float = 0.0075
    kept_by_tracker: float = 0.25
    side_sigma_m: float = 0.01
    side_velocity_mps: float = 0.05
    side_velocity_per_m: float = 0.010
    radial_velocity_mps: float = 0.07
    radial_velocity_per_m: float = 0.025
    first_velocity_mps: float = 1.5
    first_velocity_fades_s: float = 0.12
    velocity_lag_s: float = 0.15
    wander_s: float = 0.25
    sightings: int = 3
    missed_share: float = 0.03
    missed_share_at_range: float = 0.4
    forget_s: float = 0.5
    moving_mps: float = 0.15
    moving_per_m: float = 0.02
    rise_s: float = 0.1
    fall_s: float = 0.3
    surface_bias_sigmas: float = 1.0
    surface_sigmas: float = 0.5
