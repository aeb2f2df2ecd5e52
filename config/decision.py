"""How careful the decision is: distances, times and speeds that no physics dictates."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from config.loader import Section


class Margins(Section):
    """Distances kept."""

    stop_m: float = Field(default=0.45, ge=0.05, le=3, description="from the front to what it stops for")
    least_m: float = Field(
        default=0.2, ge=0.02, le=3, description="what an emergency stop may leave of stop_m"
    )
    lateral_m: float = Field(default=0.15, ge=0, le=2, description="beside the swept body, on either side")
    graze_m: float = Field(
        default=0.05, ge=0, le=1, description="how much further an obstacle must be to count as outside again"
    )
    crossing_s: float = Field(
        default=0.4, ge=0, le=5, description="between the robot and a crossing obstacle at one place"
    )

    @model_validator(mode="after")
    def _least_is_less(self) -> Self:
        if self.least_m > self.stop_m:
            raise ValueError("least_m must not be greater than stop_m")
        return self


class Prediction(Section):
    """What obstacles may do next."""

    horizon_s: float = Field(default=8.0, ge=2, le=30)
    sigmas: float = Field(default=1.0, ge=0, le=5, description="how many sigmas of the velocity are covered")
    manoeuvre_mps2: float = Field(
        default=0.25, ge=0, le=5, description="by how much a moving obstacle may change its velocity"
    )
    cut_in_mps2: float = Field(
        default=1.0,
        ge=0,
        le=5,
        description="the same, sideways, for who goes the robot's way: they do not see it and may cut in",
    )
    oncoming_mps2: float = Field(
        default=0.1,
        ge=0,
        le=5,
        description="the same, sideways, for who has come towards the robot for a while: they see it",
    )
    beside_mps: float = Field(
        default=0.3,
        ge=0,
        le=2,
        description="past somebody near whose measured motion keeps clear of the swept width",
    )
    leader_decel_mps2: float = Field(
        default=0.35,
        gt=0,
        le=10,
        description="how hard a leader is expected to brake; should it brake harder, so does the robot",
    )
    confirm_s: float = Field(
        default=0.15, ge=0, le=2, description="age before an obstacle counts, while there is room to wait"
    )
    body_depth_m: float = Field(
        default=0.3, ge=0, le=3, description="how far an obstacle reaches behind the surface that is seen"
    )


class SightConfig(Section):
    """What the camera is trusted with."""

    range_m: float = Field(default=10.0, gt=0.5, le=100, description="beyond it nothing is seen for certain")
    near_m: float = Field(
        default=1.3,
        ge=0,
        le=10,
        description="ahead of the camera, nearer than this the floor is not seen (nor below its view)",
    )
    stale_s: float = Field(default=0.3, gt=0, le=5, description="an older scene leads to a stop")
    blind_s: float = Field(
        default=0.6,
        ge=0,
        le=5,
        description="the robot brakes hard once the camera was not to be trusted for so long",
    )
    degraded_mps: float = Field(default=0.5, ge=0, le=5, description="top speed with a degraded camera")
    memory_s: float = Field(
        default=1.0, ge=0, le=10, description="how long floor that was seen free counts as free"
    )
    blind_corner_m: float = Field(
        default=1.0,
        ge=0,
        le=5,
        description="the end of a rack or wall so near beside the swept width is a blind corner (0: none is)",
    )
    blind_corner_mps: float = Field(default=0.8, gt=0, le=5, description="past a blind corner")
    known_share: float = Field(
        default=0.6, gt=0, le=1, description="share of the corridor's width that must be seen as free"
    )


class Release(Section):
    """Faster again: later than slower."""

    delay_s: float = Field(default=0.3, ge=0, le=10, description="the way must have been free for so long")
    far_mps: float = Field(
        default=0.25,
        ge=0,
        le=5,
        description="what allows so much more than the present speed is far above it",
    )
    far_delay_s: float = Field(
        default=0.12, ge=0, le=10, description="instead of delay_s, for what is far above the present speed"
    )
    hold_s: float = Field(
        default=2.0, ge=0, le=30, description="no increase sooner than this after a decrease began"
    )
    worth_mps: float = Field(default=0.1, ge=0, le=1, description="a smaller gain is no reason to go faster")
    dead_band_mps: float = Field(default=0.03, gt=0, le=0.5, description="a smaller difference means keep")
    creep_mps: float = Field(default=0.06, ge=0, le=0.5, description="a slower target means stop")
    go_m: float = Field(
        default=0.3, ge=0, le=5, description="free way beyond the margin before it starts from rest"
    )


class DecisionConfig(Section):
    """Everything that the decision can be tuned with."""

    margins: Margins = Margins()
    prediction: Prediction = Prediction()
    sight: SightConfig = SightConfig()
    release: Release = Release()
    chassis_delay_s: float = Field(
        default=0.2, ge=0, le=2, description="from a command until the chassis has followed it"
    )
    off_path_m: float = Field(default=0.5, gt=0, le=5, description="further beside the path it stops")
    emergency_caps_range: bool = Field(
        default=True,
        description="the speed that the range admits counts on emergency braking (false: on comfort)",
    )
