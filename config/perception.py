"""Perception: what counts as a fragment, how precise the camera is, when an obstacle counts as moving."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from config.loader import Section


class DepthNoise(Section):
    """Standard deviation of depth: sigma_z = floor_m + quadratic_per_m * z^2.

    The default was measured on a real RealSense (19 cm at 5 m); the paper's value is 5 cm at 10 m. A sigma
    that is too large costs a little precision; one that is too small makes walls seem to move.
    """

    floor_m: float = Field(default=0.005, gt=0, le=0.5)
    quadratic_per_m: float = Field(default=0.0075, gt=0, le=0.1)


TYPICAL_DEPTH_NOISE = DepthNoise()
IMPLAUSIBLE_SPEED_FACTOR = 1.6  # times the maximum speed of an obstacle: faster measured speeds are mistakes


class FragmentSettings(Section):
    """Edges, contours, segments and their tracking."""

    canny_least: float = Field(
        default=36.0,
        gt=0,
        description="minimum of Canny's upper threshold (L1 norm of Sobel), for places with few edges",
    )
    canny_most: float = Field(
        default=160.0, gt=0, description="maximum of Canny's upper threshold, for places with many edges"
    )
    edge_share: float = Field(
        default=0.05,
        gt=0,
        le=0.5,
        description="share of edge pixels to which Canny's upper threshold is adapted",
    )
    min_length_px: float = Field(
        default=32.0, ge=8, le=400, description="minimum length of a fragment; the paper's 32 px"
    )
    max_fragments: int = Field(default=128, ge=20, le=2000)
    closer_fragments: int = Field(
        default=16, ge=0, le=400, description="additional ones, for bodies that carry too few fragments"
    )
    tile_px: int = Field(
        default=40, ge=16, le=160, description="side of the square cells in which fragments are counted"
    )
    fragments_per_tile: int = Field(default=2, ge=1, le=16)
    lk_window_px: int = Field(default=11, ge=5, le=41)
    lk_levels: int = Field(default=3, ge=0, le=6)
    forward_backward_px: float = Field(
        default=6.0,
        gt=0,
        le=20,
        description="maximum forward-backward error of an end point, also along an edge",
    )
    forward_backward_sigmas: float = Field(default=3.0, gt=0, le=20)
    pixel_sigma_px: float = Field(
        default=0.15, gt=0, le=5, description="standard deviation of an end point, from one frame to the next"
    )

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> Self:
        if self.canny_least > self.canny_most:
            raise ValueError("canny_least must not be greater than canny_most")
        return self


class EgoMotionSettings(Section):
    """How far the prior of the ego-motion may be wrong (one sigma).

    It decides whether image motion that contradicts the prior is ego-motion or a mover that fills the view.
    """

    odometry_yaw_ratio: float = Field(
        default=0.20, ge=0, le=1, description="yaw error from slip, as a share of the yaw rate"
    )
    odometry_rotation_radps: float = Field(
        default=0.04, gt=0, description="yaw error in addition to that share"
    )
    vibration_radps: float = Field(
        default=0.25, gt=0, description="pitch and roll rates, which odometry does not measure"
    )
    odometry_speed_ratio: float = Field(default=0.06, ge=0, le=1)
    odometry_speed_mps: float = Field(default=0.03, gt=0)
    gyro_radps: float = Field(
        default=0.02, gt=0, description="bias and noise of the gyro, where there is one"
    )
    steady_rotation_radps: float = Field(
        default=0.6, gt=0, description="without odometry: change of the turn rate between two frames"
    )
    steady_speed_mps: float = Field(
        default=0.5, gt=0, description="without odometry: change of the velocity between two frames"
    )
    rolling_accel_mps2: float = Field(
        default=1.5,
        gt=0,
        description="without odometry: change of the forward speed of a robot, which is slow, in a second",
    )
    unknown_factor: float = Field(
        default=3.0,
        ge=1,
        description="factor on these where the motion of the frame before is not known either",
    )


class MotionSettings(Section):
    """When an obstacle counts as moving."""

    window_s: float = Field(default=0.25, gt=0.05, le=1.0, description="time over which motion is measured")
    max_speed_mps: float = Field(
        default=1.5, gt=0, le=10, description="the paper's V_omax: bounds velocities that are not measured"
    )
    min_speed_mps: float = Field(default=0.15, gt=0, le=2, description="slower than this counts as static")
    sigmas: float = Field(
        default=4.0, ge=1, le=10, description="how many standard deviations from zero a moving speed must be"
    )

    @property
    def implausible_mps(self) -> float:
        """No obstacle is faster: a greater measured speed is a mistake."""
        return IMPLAUSIBLE_SPEED_FACTOR * self.max_speed_mps


class PerceptionConfig(Section):
    """All settings of detection and tracking."""

    max_depth_m: float = Field(
        default=10.0, gt=0.5, le=50, description="depth beyond this is ignored (the paper's depth mask)"
    )
    min_depth_m: float = Field(default=0.25, gt=0, le=5)
    grid_step_px: int = Field(
        default=4, ge=1, le=16, description="the depth image is sampled at every n-th row and column"
    )
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
