"""Perception: what counts as a fragment, how precise the camera is, when a thing is called moving."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from config.loader import Section


class DepthNoise(Section):
    """Standard deviation of depth: sigma_z = floor_m + quadratic_per_m * z^2.

    The default is what a real RealSense was measured to do (19 cm at 5 m), not the paper's 5 cm at 10 m:
    a sigma that is too wide costs a little precision, one that is too narrow makes walls walk.
    """

    floor_m: float = Field(default=0.005, gt=0, le=0.5)
    quadratic_per_m: float = Field(default=0.0075, gt=0, le=0.1)


TYPICAL_DEPTH_NOISE = DepthNoise()


class FragmentSettings(Section):
    """Edges, contours, segments and their tracking."""

    canny_least: float = Field(
        default=36.0, gt=0, description="upper threshold of Canny where little is to be seen, Sobel L1"
    )
    canny_most: float = Field(default=160.0, gt=0, description="the same where much is to be seen")
    edge_share: float = Field(default=0.05, gt=0, le=0.5, description="edge pixels that are enough")
    min_length_px: float = Field(default=32.0, ge=8, le=400, description="the paper's 32 px")
    max_fragments: int = Field(default=128, ge=20, le=2000)
    closer_fragments: int = Field(
        default=16, ge=0, le=400, description="and more, for bodies of which too few of them tell"
    )
    tile_px: int = Field(default=40, ge=16, le=160, description="cell in which fragments are counted")
    fragments_per_tile: int = Field(default=2, ge=1, le=16)
    lk_window_px: int = Field(default=11, ge=5, le=41)
    lk_levels: int = Field(default=3, ge=0, le=6)
    forward_backward_px: float = Field(default=6.0, gt=0, le=20, description="also along an edge")
    forward_backward_sigmas: float = Field(default=3.0, gt=0, le=20)
    pixel_sigma_px: float = Field(default=0.15, gt=0, le=5, description="end point, one frame to the next")

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> Self:
        if self.canny_least > self.canny_most:
            raise ValueError("canny_least must not be greater than canny_most")
        return self


class EgoMotionSettings(Section):
    """How much the prior may be wrong: that decides when most of the view moves."""

    odometry_yaw_ratio: float = Field(default=0.20, ge=0, le=1, description="slip: share of the yaw rate")
    odometry_rotation_radps: float = Field(default=0.04, gt=0, description="yaw, besides the share")
    vibration_radps: float = Field(default=0.25, gt=0, description="pitch and roll that odometry cannot see")
    odometry_speed_ratio: float = Field(default=0.06, ge=0, le=1)
    odometry_speed_mps: float = Field(default=0.03, gt=0)
    gyro_radps: float = Field(default=0.02, gt=0, description="bias and noise of a gyro, where there is one")
    steady_rotation_radps: float = Field(
        default=0.6, gt=0, description="without odometry: change of the turn rate between two frames"
    )
    steady_speed_mps: float = Field(
        default=0.5, gt=0, description="without odometry: change of the velocity between two frames"
    )
    rolling_speed_mps: float = Field(
        default=0.15,
        gt=0,
        description="the same of a camera on a robot, which gathers speed slowly: along its way",
    )
    unknown_factor: float = Field(
        default=3.0, ge=1, description="how much more where not even the motion before is known"
    )


class MotionSettings(Section):
    """When a thing is moving."""

    window_s: float = Field(default=0.25, gt=0.05, le=1.0, description="time over which motion is measured")
    max_speed_mps: float = Field(
        default=1.5, gt=0, le=10, description="the paper's V_omax: bounds the unknown"
    )
    min_speed_mps: float = Field(default=0.15, gt=0, le=2, description="slower than this counts as static")
    sigmas: float = Field(default=4.0, ge=1, le=10, description="how far from zero a moving speed must be")


class PerceptionConfig(Section):
    """Everything that detect and track can be told."""

    max_depth_m: float = Field(default=10.0, gt=0.5, le=50, description="the paper's depth mask")
    min_depth_m: float = Field(default=0.25, gt=0, le=5)
    grid_step_px: int = Field(default=4, ge=1, le=16, description="every n-th pixel of depth is looked at")
    max_gap_s: float = Field(default=0.5, gt=0, le=5, description="frames further apart cannot be compared")
    depth_noise: DepthNoise = TYPICAL_DEPTH_NOISE
    fragments: FragmentSettings = FragmentSettings()
    ego_motion: EgoMotionSettings = EgoMotionSettings()
    motion: MotionSettings = MotionSettings()

    @model_validator(mode="after")
    def _depth_range(self) -> Self:
        if self.min_depth_m >= self.max_depth_m:
            raise ValueError("min_depth_m must be smaller than max_depth_m")
        return self
