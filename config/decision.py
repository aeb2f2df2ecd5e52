"""How careful the decision is: the distances, times and speeds that are a choice, not physics."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from config.loader import Section


class Margins(Section):
    """Clearances that the robot keeps."""

    stop_m: float = Field(
        default=0.45, ge=0.05, le=3, description="clearance between the robot's front and what it stops for"
    )
    least_m: float = Field(
        default=0.2,
        ge=0.02,
        le=3,
        description="minimum clearance: what an emergency stop may leave of stop_m",
    )
    lateral_m: float = Field(
        default=0.15, ge=0, le=2, description="clearance beside the swept body, on either side"
    )
    graze_m: float = Field(
        default=0.05,
        ge=0,
        le=1,
        description="hysteresis: an obstacle inside lateral_m is outside again only this much further away",
    )
    crossing_s: float = Field(
        default=0.4,
        ge=0,
        le=5,
        description="minimum time between the robot and a crossing obstacle at the same place",
    )

    @model_validator(mode="after")
    def _least_is_less(self) -> Self:
        if self.least_m > self.stop_m:
            raise ValueError("least_m must not be greater than stop_m")
        return self


class Prediction(Section):
    """What the decision expects obstacles to do within horizon_s, and in the worst case."""

    horizon_s: float = Field(default=8.0, ge=2, le=30)
    sigmas: float = Field(
        default=1.0,
        ge=0,
        le=5,
        description="how many standard deviations of the measured velocity are covered",
    )
    manoeuvre_mps2: float = Field(
        default=0.25, ge=0, le=5, description="how hard a moving obstacle may accelerate, brake or turn"
    )
    cut_in_mps2: float = Field(
        default=1.0,
        ge=0,
        le=5,
        description="sideways acceleration of an obstacle that goes the robot's way: it may cut in unaware",
    )
    oncoming_mps2: float = Field(
        default=0.2,
        ge=0,
        le=5,
        description="sideways acceleration of an obstacle that has approached for a while: it sees the robot",
    )
    beside_mps: float = Field(
        default=0.3,
        ge=0,
        le=2,
        description="the worst case does not slow the robot below this speed beside an obstacle whose "
        "measured motion stays clear of the swept width",
    )
    leader_decel_mps2: float = Field(
        default=0.35,
        gt=0,
        le=10,
        description="expected deceleration of an obstacle that moves ahead of the robot in its direction; "
        "if it brakes harder, so does the robot",
    )
    confirm_s: float = Field(
        default=0.15,
        ge=0,
        le=2,
        description="minimum age of an obstacle before it counts, while there is room to wait",
    )
    body_depth_m: float = Field(
        default=0.3,
        ge=0,
        le=3,
        description="how far an obstacle is taken to extend behind its visible surface",
    )


class SightConfig(Section):
    """How far, and for how long, the camera is trusted."""

    range_m: float = Field(
        default=10.0, gt=0.5, le=100, description="range beyond which nothing is seen for certain"
    )
    near_m: float = Field(
        default=1.3,
        ge=0,
        le=10,
        description="floor nearer to the camera than this, or below its field of view, counts as not seen",
    )
    stale_s: float = Field(
        default=0.3, gt=0, le=5, description="a scene older than this makes the robot stop"
    )
    blind_s: float = Field(
        default=0.6,
        ge=0,
        le=5,
        description="the stop becomes an emergency stop once the camera has been unusable for this long",
    )
    degraded_mps: float = Field(
        default=0.5, ge=0, le=5, description="maximum speed while the camera is degraded"
    )
    memory_s: float = Field(
        default=1.0, ge=0, le=10, description="how long floor that was seen to be free keeps counting as free"
    )
    blind_corner_m: float = Field(
        default=1.0,
        ge=0,
        le=5,
        description="a rack or wall that ends this close to the swept width is a blind corner (0: none is)",
    )
    blind_corner_mps: float = Field(default=0.8, gt=0, le=5, description="maximum speed past a blind corner")
    known_share: float = Field(
        default=0.6, gt=0, le=1, description="share of the corridor's width that must be seen to be free"
    )


class Release(Section):
    """When the robot may go faster again. A lower target applies at once, a higher one only later."""

    delay_s: float = Field(
        default=0.3,
        ge=0,
        le=10,
        description="how long a higher speed must have been allowed before the robot takes it",
    )
    far_mps: float = Field(
        default=0.25,
        ge=0,
        le=5,
        description="while driving, an allowed speed this much above the present one needs only far_delay_s",
    )
    far_delay_s: float = Field(
        default=0.12,
        ge=0,
        le=10,
        description="used in place of delay_s where the allowed speed is far above the present one (far_mps)",
    )
    hold_s: float = Field(
        default=2.0, ge=0, le=30, description="minimum time from the start of a decrease to the next increase"
    )
    worth_mps: float = Field(
        default=0.1,
        ge=0,
        le=1,
        description="minimum gain for which the robot goes faster again soon after a decrease",
    )
    dead_band_mps: float = Field(
        default=0.03, gt=0, le=0.5, description="a target within this of the present speed means keep"
    )
    creep_mps: float = Field(default=0.06, ge=0, le=0.5, description="a target below this means stop")
    go_m: float = Field(
        default=0.3,
        ge=0,
        le=5,
        description="free way beyond the margin that the robot needs to start from rest",
    )


class DecisionConfig(Section):
    """All settings of the decision."""

    margins: Margins = Margins()
    prediction: Prediction = Prediction()
    sight: SightConfig = SightConfig()
    release: Release = Release()
    chassis_delay_s: float = Field(
        default=0.2, ge=0, le=2, description="time from a command until the chassis has followed it"
    )
    off_path_m: float = Field(
        default=0.5, gt=0, le=5, description="the robot stops when it is further than this beside its path"
    )
    emergency_caps_range: bool = Field(
        default=True,
        description="the speed limit from the camera's range assumes emergency braking (false: comfortable)",
    )
