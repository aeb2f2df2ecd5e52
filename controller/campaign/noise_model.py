"""The errors of a real perception, as numbers for controller/campaign/noisy_camera.py."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Standard deviations (sigma), times and rates. A sigma with _per_m grows by that with each metre of
    distance, and depth_sigma_1pm with the square of the distance.

    tracked_depth_ratio: share of the depth's sigma that is left in the position of a tracked body.
    radial_*, lateral_*: sigma of the velocity along the view, and across it.
    first_velocity_mps, first_velocity_decay_s: sigma at the first sighting, on top, and how fast it decays.
    velocity_lag_s: time constant with which the measured velocity follows the true one.
    correlation_s: time constant of the errors of position and velocity.
    sightings: from how many on a body is reported.
    miss_rate, miss_rate_at_range: share of the frames in which a body is missed; at the end of the range.
    forget_s: how long a body that is not seen is reported.
    moving_mps, moving_per_m: a body that is faster seems to move ...
    rise_s, fall_s: ... and is called moving after this time, and no longer after this time without it.
    surface_bias_sigmas, surface_sigmas: the nearest surface of a band is nearer than the true one by so many
    sigmas of depth, and scatters by so many.
    """

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
