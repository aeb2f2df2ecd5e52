"""The robot itself: its body, its limits, where its camera sits."""

from __future__ import annotations

import math
from typing import Self

from pydantic import Field, model_validator

from config.loader import Section


class Body(Section):
    """Outer size. The turning centre (origin of the body frame) lies rear_m ahead of the tail."""

    width_m: float = Field(default=0.78, ge=0.05, le=5)
    length_m: float = Field(default=1.02, ge=0.05, le=10)
    rear_m: float = Field(default=0.51, gt=0, le=10)
    height_m: float = Field(default=0.80, gt=0, le=5)
    clearance_m: float = Field(
        default=0.05, ge=0, le=0.5, description="the robot can drive over what is lower than this"
    )

    @property
    def front_m(self) -> float:
        """From the turning centre to the foremost point."""
        return self.length_m - self.rear_m

    @model_validator(mode="after")
    def _rear_inside(self) -> Self:
        if self.rear_m >= self.length_m:
            raise ValueError("rear_m must be smaller than length_m")
        return self


class Limits(Section):
    """Speed, acceleration and jerk; the paper's values (Daeef 2020, problem statement) as defaults."""

    max_speed_mps: float = Field(default=1.5, ge=0.02, le=5)
    max_accel_mps2: float = Field(default=0.3, ge=0.01, le=5)
    emergency_decel_mps2: float = Field(default=0.7, gt=0, le=10)
    max_jerk_mps3: float = Field(default=0.6, ge=0.01, le=50)
    emergency_jerk_mps3: float = Field(default=2.0, gt=0, le=100)
    max_yaw_rate_radps: float = Field(default=0.8, gt=0, le=5)
    max_obstacle_speed_mps: float = Field(
        default=1.5, ge=0, le=10, description="greatest speed of an obstacle, the paper's V_omax"
    )

    @model_validator(mode="after")
    def _emergency_is_harder(self) -> Self:
        if self.emergency_decel_mps2 < self.max_accel_mps2:
            raise ValueError(
                f"emergency_decel_mps2 ({self.emergency_decel_mps2:g}) must not be smaller than "
                f"max_accel_mps2 ({self.max_accel_mps2:g})"
            )
        if self.emergency_jerk_mps3 < self.max_jerk_mps3:
            raise ValueError(
                f"emergency_jerk_mps3 ({self.emergency_jerk_mps3:g}) must not be smaller than "
                f"max_jerk_mps3 ({self.max_jerk_mps3:g})"
            )
        return self


class Mount(Section):
    """Where the camera sits: ahead of the turning centre, left of it, above the floor; positive pitch looks
    down."""

    forward_m: float = Field(default=0.45, ge=-5, le=5)
    left_m: float = Field(default=0.0, ge=-5, le=5)
    height_m: float = Field(default=0.60, gt=0, le=5)
    pitch_deg: float = Field(default=4.0, ge=-45, le=60)

    @property
    def pitch_rad(self) -> float:
        return math.radians(self.pitch_deg)


class Robot(Section):
    """Everything about the robot that does not depend on what it is connected to."""

    body: Body = Body()
    limits: Limits = Limits()
    camera_mount: Mount = Mount()
