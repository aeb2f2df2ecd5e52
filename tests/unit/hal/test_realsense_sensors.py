"""Options of a RealSense's sensors: set in their order, and refused in one line where the camera differs."""

from __future__ import annotations

import pytest

from config.camera import RealsenseCameraConfig
from hal.cameras.realsense import RealsenseCamera
from hal.clocks import SimulatedClock
from hal.errors import DeviceRefused
from tests.support.fake_realsense import FakeRealsense
from tests.support.fake_realsense_frames import framesets


def camera_with(**options: dict[str, float]) -> tuple[RealsenseCamera, FakeRealsense]:
    clock = SimulatedClock()
    vendor = FakeRealsense(clock, list(framesets(0, 1)))
    config = RealsenseCameraConfig.model_validate({"kind": "realsense", **options})
    return RealsenseCamera(config, clock, vendor), vendor


def test_options_go_to_their_sensor_in_their_order() -> None:
    camera, vendor = camera_with(
        depth_options={"visual_preset": 3, "exposure": 8500.1}, colour_options={"exposure": 100}
    )
    with camera:
        assert list(vendor.device.depth_sensor.options.items()) == [
            ("visual_preset", 3),
            ("exposure", 8500.1),
        ]
        assert vendor.device.colour_sensor.options == {"exposure": 100}


def test_without_options_the_sensors_keep_theirs() -> None:
    camera, vendor = camera_with()
    with camera:
        assert vendor.device.depth_sensor.options == vendor.device.colour_sensor.options == {}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"depth_options": {"name": 1}},
            r"camera\.depth_options\.name: this sensor has no such option",
        ),
        (
            {"depth_options": {"laser_power": 1}},
            r"camera\.depth_options\.laser_power: this sensor has no such",
        ),
        (
            {"colour_options": {"visual_preset": 3}},
            r"camera\.colour_options\.visual_preset: this sensor has no",
        ),
        ({"depth_options": {"global_time_enabled": 1}}, "the driver sets it to 0 itself; remove the key"),
        ({"depth_options": {"exposure": -1}}, r"exposure: -1 is not accepted \(out of range\)"),
    ],
)
def test_an_option_that_the_camera_does_not_have_or_take_is_one_clear_line(
    options: dict[str, dict[str, float]], words: str
) -> None:
    camera, vendor = camera_with(**options)
    with pytest.raises(DeviceRefused, match=words) as refused:
        camera.__enter__()
    assert str(refused.value).startswith("D435I (fake) 000000000001: camera.")
    assert "\n" not in str(refused.value)
    assert vendor.pipelines == [], "no stream was started"
