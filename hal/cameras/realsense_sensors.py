"""Sets the options of a RealSense's sensors: the driver's own, then those of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from config.camera import RealsenseCameraConfig
from hal.errors import DeviceRefused

# What the driver sets itself; see steady().
_OWN = frozenset({"auto_exposure_priority", "global_time_enabled"})


def set_up_sensors(rs: Any, device: Any, name: str, config: RealsenseCameraConfig) -> None:
    """Raises DeviceRefused for an option that the camera does not have or does not take.

    rs: the module pyrealsense2. name: of the camera, for messages.
    """
    _steady(rs, device)
    for key, sensor, options in (
        ("depth_options", device.first_depth_sensor, config.depth_options),
        ("colour_options", device.first_color_sensor, config.colour_options),
    ):
        if options:
            _set_options(rs, sensor(), f"{name}: camera.{key}", options)


def _steady(rs: Any, device: Any) -> None:
    for sensor in device.query_sensors():
        # Otherwise auto exposure would halve the rate of the colour images in dim light.
        if sensor.supports(rs.option.auto_exposure_priority):
            sensor.set_option(rs.option.auto_exposure_priority, 0)
        # Global time follows the wall clock, which steps; the device's own clock does not.
        if sensor.supports(rs.option.global_time_enabled):
            sensor.set_option(rs.option.global_time_enabled, 0)


def _set_options(rs: Any, sensor: Any, where: str, options: Mapping[str, float]) -> None:
    """In their order in the file: a preset changes other options, and exposure needs auto exposure off."""
    for name, value in options.items():
        option = rs.option.__members__.get(name)
        if name in _OWN:
            raise DeviceRefused(f"{where}.{name}: the driver sets it to 0 itself; remove the key")
        if option is None or not sensor.supports(option):
            raise DeviceRefused(
                f"{where}.{name}: this sensor has no such option (rs-enumerate-devices -o lists them)"
            )
        try:
            sensor.set_option(option, value)
        except RuntimeError as error:
            raise DeviceRefused(f"{where}.{name}: {value:g} is not accepted ({error})") from error
