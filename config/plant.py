"""The simulated tracked base behind a chassis emulator."""

from __future__ import annotations

from pydantic import Field

from config.loader import Section


class PlantConfig(Section):
    """The simulated tracked base behind a chassis emulator.

    lag_s: time constant of each track's speed loop. slip_factor: see AgilexChassisConfig; 1.1 turns
    about 10 % less than the tracks say. distance_slip: share by which they count the distance too long.
    """

    track_width_m: float = Field(default=0.555, gt=0.05, le=5)
    lag_s: float = Field(default=0.08, gt=0, le=2)
    max_accel_mps2: float = Field(default=2.0, gt=0, le=50)
    slip_factor: float = Field(default=1.1, ge=1.0, le=3.0)
    distance_slip: float = Field(default=0.0, ge=-0.2, le=0.5)
