"""Which camera: ``kind`` chooses the driver, the other keys are its settings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from config.loader import Section

OdometryChoice = Literal["file", "none", "groundtruth"]


class ReplayCameraConfig(Section):
    """A recording in a TUM RGB-D folder (rgb.txt, depth.txt, camera.yaml)."""

    kind: Literal["replay"] = "replay"
    folder: str = Field(min_length=1, description="the recording; relative to this file")
    odometry: OdometryChoice = Field(
        default="file", description="file: odometry.txt if the recording has one; groundtruth: for evaluation"
    )
    max_pair_gap_s: float = Field(
        default=0.02, gt=0, le=1, description="colour and depth further apart than this are not one frame"
    )
    read_ahead: int = Field(
        default=2, ge=0, le=64, description="frames decoded in advance; 0: when asked for"
    )


class RealsenseCameraConfig(Section):
    """An Intel RealSense D435i, depth aligned to colour."""

    kind: Literal["realsense"] = "realsense"
    serial: str | None = Field(default=None, min_length=1, description="needed where several are connected")
    width: int = Field(default=640, gt=0, le=1920)
    height: int = Field(default=480, gt=0, le=1080)
    fps: int = Field(default=30, gt=0, le=90)
    gyro: bool = Field(default=False, description="also read the D435i's gyro")
    latency_s: float = Field(
        default=0.03,
        ge=0,
        le=0.5,
        description="from exposure to arrival of the promptest frame; taken off captured_ns",
    )
    start_timeout_s: float = Field(
        default=5.0, gt=0, le=60, description="how long to wait for the first frame"
    )


CameraConfig = Annotated[ReplayCameraConfig | RealsenseCameraConfig, Field(discriminator="kind")]
