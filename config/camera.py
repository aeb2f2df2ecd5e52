"""Which camera: ``kind`` chooses the driver, the other keys are its settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from config.loader import Section
from config.own_parts import OwnPart

# A D435i's colour camera, 1920x1080: focal length in image heights, and the aspect ratio of the whole sensor.
# No video mode is wider than the sensor.
_D435I_FOCAL = 1.28
_D435I_ASPECT = 16.0 / 9.0

# Where a recording's odometry comes from; auto: odometry.txt if the recording has one.
OdometryChoice = Literal["auto", "file", "none", "groundtruth"]


# Width and height of the image, fx, fy, cx, cy, all in pixels.
NominalView = tuple[int, int, float, float, float, float]


class CameraSection(Section):
    """What every camera can be told, whatever its kind.

    own_parts: parts of the robot in the camera's view, which are cut out of its images (config/own_parts.py),
    such as ``own_parts: [{name: bumper, from_m: [0.40, -0.35, 0.0], to_m: [0.55, 0.35, 0.25]}]``.
    """

    own_parts: Annotated[tuple[OwnPart, ...], Field(strict=False)] = ()

    @property
    def nominal_view(self) -> NominalView | None:
        """What is known of the image before the camera is open; None: nothing."""
        return None


class ReplayCameraConfig(CameraSection):
    """A recording, played in its own time: a TUM folder (rgb.txt, depth.txt, camera.yaml) or a ROS bag."""

    kind: Literal["replay"] = "replay"
    folder: str = Field(min_length=1, description="path of the recording, relative to this file")
    max_pair_gap_s: float = Field(
        default=0.02,
        gt=0,
        le=1,
        description="maximum time between the colour and the depth image of one frame",
    )
    read_ahead: int = Field(
        default=2,
        ge=0,
        le=64,
        description="folders: number of frames decoded in advance; 0: each when asked for",
    )
    colour_topic: str | None = Field(
        default=None,
        min_length=1,
        description="bags: topic of the colour images, if it is not found automatically",
    )
    depth_topic: str | None = Field(
        default=None,
        min_length=1,
        description="bags: topic of the depth images, if it is not found automatically",
    )
    gyro: bool = Field(default=True, description="use the gyro of the recording, if it has one")
    gyro_topic: str | None = Field(
        default=None,
        min_length=1,
        description="bags: topic of the gyro, if it is not found automatically",
    )

    @model_validator(mode="after")
    def _gyro_or_no_topic(self) -> Self:
        if self.gyro_topic is not None and not self.gyro:
            raise ValueError("gyro_topic has no effect with gyro: false; leave one out")
        return self

    @property
    def edge_tangents(self) -> None:
        """See SimulatedCameraConfig: only the recording knows, once it is open."""
        return None


class RealsenseCameraConfig(CameraSection):
    """An Intel RealSense D435i, depth aligned to colour.

    depth_options, colour_options: options of the depth and of the colour sensor by librealsense's names, set
    in this order before the streams start. ``rs-enumerate-devices -o`` lists them with their ranges; switches
    are 0 and 1. Such as ``depth_options: {visual_preset: 3, emitter_enabled: 1}`` (3: high accuracy), or
    ``colour_options: {enable_auto_exposure: 0, exposure: 100}``.
    """

    kind: Literal["realsense"] = "realsense"
    serial: str | None = Field(default=None, min_length=1, description="needed where several are connected")
    width: int = Field(
        default=848, gt=0, le=1920, description="with 480 rows, 848 columns see 69 degrees, 640 see 55"
    )
    height: int = Field(default=480, gt=0, le=1080)
    fps: int = Field(default=30, gt=0, le=90)
    gyro: bool = Field(default=False, description="also read the D435i's gyro")
    latency_s: float = Field(
        default=0.03,
        ge=0,
        le=0.5,
        description="minimum delay from exposure to arrival of a frame; it is subtracted from captured_ns",
    )
    start_timeout_s: float = Field(
        default=5.0, gt=0, le=60, description="how long to wait for the first frame"
    )
    depth_options: Mapping[str, float] = {}
    colour_options: Mapping[str, float] = {}

    @property
    def edge_tangents(self) -> tuple[float, float]:
        """See SimulatedCameraConfig. Nominal values: the camera tells its own only once it runs."""
        half = 0.5 * min(self.width / self.height, _D435I_ASPECT) / _D435I_FOCAL
        return half, half

    @property
    def nominal_view(self) -> NominalView:
        """See CameraSection; as for edge_tangents."""
        focal_px = self.width / sum(self.edge_tangents)
        return self.width, self.height, focal_px, focal_px, 0.5 * (self.width - 1), 0.5 * (self.height - 1)


class SimulatedCameraConfig(CameraSection):
    """A D435i-like camera in the simulated world: depth aligned to colour, both at one time.

    depth_noise: standard deviation z^2 * 0.0075 / m (realsense: what a real one was measured to do),
    z^2 * 0.0005 / m (paper: 5 cm at 10 m), or none.
    """

    kind: Literal["simulated"] = "simulated"
    width: int = Field(default=848, ge=32, le=4096)
    height: int = Field(default=480, ge=32, le=4096)
    fx: float = Field(default=610.0, gt=0)
    fy: float = Field(default=610.0, gt=0)
    cx: float = Field(
        default_factory=lambda given: 0.5 * (given.get("width", 848) - 1),
        description="the middle, if not given",
    )
    cy: float = Field(
        default_factory=lambda given: 0.5 * (given.get("height", 480) - 1),
        description="the middle, if not given",
    )
    fps: float = Field(default=30.0, gt=0, le=300)
    depth_min_m: float = Field(default=0.3, ge=0.05, le=5)
    depth_max_m: float = Field(default=10.0, gt=0, le=65)
    depth_noise: Literal["realsense", "paper", "none"] = "realsense"
    hole_ratio: float = Field(default=0.01, ge=0, le=0.5, description="share of pixels lost at random")
    depth_edges: bool = Field(
        default=True,
        description="no depth where only one of the two infrared cameras sees, beside nearer objects",
    )
    colour_noise: bool = True
    vibration_deg: float = Field(
        default=0.0, ge=0, le=5, description="amplitude of a sinusoidal pitch vibration"
    )
    vibration_hz: float = Field(default=8.0, gt=0, le=100)

    @property
    def edge_tangents(self) -> tuple[float, float]:
        """Tangents of the angles from the axis to the left and the right edge of the image, both positive."""
        return (self.cx + 0.5) / self.fx, (self.width - 0.5 - self.cx) / self.fx

    @property
    def nominal_view(self) -> NominalView:
        """See CameraSection."""
        return self.width, self.height, self.fx, self.fy, self.cx, self.cy

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.depth_min_m >= self.depth_max_m:
            raise ValueError("depth_min_m must be smaller than depth_max_m")
        if not (0 <= self.cx < self.width and 0 <= self.cy < self.height):
            raise ValueError(f"cx, cy must lie inside the {self.width}x{self.height} image, in pixels")
        return self


AnyCameraConfig = (
    ReplayCameraConfig  # one kind a line
    | RealsenseCameraConfig
    | SimulatedCameraConfig
)
CameraConfig = Annotated[AnyCameraConfig, Field(discriminator="kind")]
