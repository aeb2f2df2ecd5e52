"""A RealSense without hardware: librealsense's own software_device, behind the genuine pyrealsense2.

The driver's pipelines open it like a camera. Two things about it are documented nowhere (found with
2.59.1): a context forgets a software device unless somebody keeps the device list that the
devices-changed callback got, and without the metadata actual_fps (in mHz) the syncer never pairs depth
with colour.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, FPS = 640, 480, 30
SERIAL = "000000000001"
DEPTH_FX, COLOUR_FX, DEPTH_LEFT_OF_COLOUR_M = 385.0, 615.0, 0.015
PERIOD_MS = 1000.0 / FPS


class SoftwareRealsense:
    """One D435I-like device. vendor: to be handed to RealsenseCamera in place of the module."""

    def __init__(self, rs: Any) -> None:
        self._rs = rs
        self._context = rs.context()
        self._kept: list[Any] = []
        self._context.set_devices_changed_callback(lambda info: self._kept.append(info.get_new_devices()))
        self._device = rs.software_device()
        self._device.register_info(rs.camera_info.name, "D435I (software)")
        self._device.register_info(rs.camera_info.serial_number, SERIAL)
        self._depth_sensor = self._device.add_sensor("Stereo Module")
        self._colour_sensor = self._device.add_sensor("RGB Camera")
        self._motion_sensor = self._device.add_sensor("Motion Module")
        self._depth = self._depth_sensor.add_video_stream(
            self._video(0, rs.stream.depth, rs.format.z16, DEPTH_FX)
        )
        self._colour = self._colour_sensor.add_video_stream(
            self._video(1, rs.stream.color, rs.format.bgr8, COLOUR_FX)
        )
        self._gyro = self._motion_sensor.add_motion_stream(self._motion(2))
        self._depth.register_extrinsics_to(self._colour, self._shift(DEPTH_LEFT_OF_COLOUR_M))
        self._gyro.register_extrinsics_to(self._colour, self._shift(0.0))
        self._depth_sensor.add_read_only_option(rs.option.depth_units, 0.001)
        self._depth_sensor.add_read_only_option(rs.option.stereo_baseline, 50.0)
        for sensor in (self._depth_sensor, self._colour_sensor):
            sensor.set_metadata(rs.frame_metadata_value.actual_fps, 1000 * FPS)
        self._device.create_matcher(rs.matchers.default)
        self._device.add_to(self._context)
        names = ("stream", "format", "option", "camera_info", "config", "align", "frame_queue", "pipeline")
        self.vendor = SimpleNamespace(
            context=lambda: self._context, **{name: getattr(rs, name) for name in names}
        )

    def send(self, number: int, colour: NDArray[np.uint8] | None, depth: NDArray[np.uint16] | None) -> None:
        """One frame of each stream that is given, stamped number periods after the start."""
        if depth is not None:
            self._send(self._depth_sensor, self._depth, number, depth, 2)
        if colour is not None:
            self._send(self._colour_sensor, self._colour, number, colour, 3)

    def send_gyro(self, number: int, device_ms: float, rates_radps: tuple[float, float, float]) -> None:
        frame = self._rs.software_motion_frame()
        rate = self._rs.vector()
        rate.x, rate.y, rate.z = rates_radps
        frame.data = rate
        frame.timestamp = device_ms
        frame.domain = self._rs.timestamp_domain.hardware_clock
        frame.frame_number = number
        frame.profile = self._gyro.as_motion_stream_profile()
        self._motion_sensor.on_motion_frame(frame)

    def _send(
        self, sensor: Any, profile: Any, number: int, pixels: NDArray[Any], bytes_per_pixel: int
    ) -> None:
        frame = self._rs.software_video_frame()
        frame.pixels = pixels
        frame.stride = WIDTH * bytes_per_pixel
        frame.bpp = bytes_per_pixel
        frame.timestamp = number * PERIOD_MS
        frame.domain = self._rs.timestamp_domain.hardware_clock
        frame.frame_number = number
        frame.profile = profile.as_video_stream_profile()
        frame.depth_units = 0.001
        sensor.on_video_frame(frame)

    def _video(self, uid: int, kind: Any, pixel_format: Any, focal_px: float) -> Any:
        stream = self._rs.video_stream()
        stream.type, stream.uid, stream.index, stream.fmt = kind, uid, 0, pixel_format
        stream.width, stream.height, stream.fps = WIDTH, HEIGHT, FPS
        stream.bpp = 2 if kind == self._rs.stream.depth else 3
        k = self._rs.intrinsics()
        k.width, k.height, k.fx, k.fy, k.ppx, k.ppy = WIDTH, HEIGHT, focal_px, focal_px, 320.0, 240.0
        k.model, k.coeffs = self._rs.distortion.brown_conrady, [0.0] * 5
        stream.intrinsics = k
        return stream

    def _motion(self, uid: int) -> Any:
        stream = self._rs.motion_stream()
        stream.type, stream.uid, stream.index, stream.fps = self._rs.stream.gyro, uid, 0, 200
        stream.fmt = self._rs.format.motion_xyz32f
        return stream

    def _shift(self, x_m: float) -> Any:
        extrinsics = self._rs.extrinsics()
        extrinsics.rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
        extrinsics.translation = [x_m, 0.0, 0.0]
        return extrinsics
