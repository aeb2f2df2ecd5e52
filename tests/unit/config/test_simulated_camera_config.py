from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.camera import SimulatedCameraConfig


def test_the_default_is_like_a_d435i() -> None:
    config = SimulatedCameraConfig()
    assert (config.width, config.height, config.fps) == (848, 480, 30.0)
    assert (config.depth_min_m, config.depth_max_m) == (0.3, 10.0)
    assert config.depth_noise == "realsense"


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("depth_max_m", 0.2, "smaller than depth_max_m"),
        ("depth_noise", "laser", "depth_noise"),
        ("cx", 848.0, "inside the 848x480 image"),
        ("cy", -0.5, "inside the 848x480 image"),
        ("fps", 0.0, "greater than 0"),
        ("hole_ratio", 0.9, "less than or equal"),
        ("zoom", 2.0, "extra"),
    ],
)
def test_impossible_camera_settings_are_refused(key: str, value: object, says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        SimulatedCameraConfig.model_validate({key: value})


def test_the_optical_axis_meets_the_middle_of_any_image_unless_it_is_given() -> None:
    small = SimulatedCameraConfig(width=320, height=240)
    assert (small.cx, small.cy) == (159.5, 119.5)
    assert SimulatedCameraConfig(width=320, cx=150.0).cx == 150.0
