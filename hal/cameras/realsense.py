"""Intel RealSense D435i through pyrealsense2: colour with depth aligned to it, and optionally its gyro.

The only module that imports pyrealsense2 (Apache-2.0, extra "realsense"), and only when a camera is opened.
"""

from __future__ import annotations

import contextlib
import math
from types import TracebackType
from typing import Any, Self

import numpy as np

from config.camera import RealsenseCameraConfig
from hal.api import Clock
from hal.cameras.device_clock import DeviceClock
from hal.cameras.realsense_sensors import set_up_sensors
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.errors import DeviceNotFound, DeviceRefused, FrameTimeout, LinkLost
from hal.types import GyroSamples, Intrinsics, RgbdFrame

_GYRO_RATE_HZ = 200
_GYRO_QUEUE = 256  # more than a second of samples; a reader that stalls for longer loses the rest
_USB_HINT = "use the USB 3 cable in a USB 3 port, and close other programs that hold the camera"


class RealsenseCamera:
    """FrameSource over one camera. It verifies the mode that the device gave, and does not trust the
    request."""

    def __init__(self, config: RealsenseCameraConfig, clock: Clock, vendor: Any = None) -> None:
        """vendor: replaces the module pyrealsense2, for tests."""
        self._config = config
        self._clock = clock
        self._vendor = vendor
        self._intrinsics: Intrinsics | None = None
        self._pipeline: Any = None
        self._name = "RealSense"
        self._closing = contextlib.ExitStack()
        self.incomplete = 0
        """Framesets left out so far: one stream alone, or depth and colour of different times."""

    @property
    def intrinsics(self) -> Intrinsics:
        """The intrinsics of the colour stream, to which depth is aligned. Raises DeviceRefused before
        opening."""
        if self._intrinsics is None:
            raise DeviceRefused(f"{self._name}: its intrinsics are known only once it has been opened")
        return self._intrinsics

    def __enter__(self) -> Self:
        """Open and wait for the first frame. Raises DeviceNotFound, DeviceRefused."""
        with contextlib.ExitStack() as stack:
            try:
                self._open(stack)
                self.read(self._config.start_timeout_s)
            except FrameTimeout as error:
                raise DeviceRefused(f"opened, but no frames come: {error}; {_USB_HINT}") from error
            except RuntimeError as error:
                raise DeviceRefused(f"{self._name}: cannot be opened ({error}); {_USB_HINT}") from error
            self._closing = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    def read(self, timeout_s: float) -> RgbdFrame:
        """The next complete frame. Raises FrameTimeout, and LinkLost once the camera has gone."""
        if self._pipeline is None:
            raise DeviceRefused(f"{self._name}: is not open; read it inside a with block")
        try:
            return self._next_frame(timeout_s)
        except RuntimeError as error:
            raise LinkLost(f"{self._name}: lost ({error}); check its cable and reopen it") from error

    def _next_frame(self, timeout_s: float) -> RgbdFrame:
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        incomplete_before = self.incomplete
        while True:
            remaining_ms = max(0, math.ceil((deadline_ns - self._clock.now_ns()) / NS_PER_MS))
            arrived, frames = self._pipeline.try_wait_for_frames(remaining_ms)
            if not arrived:
                raise self._no_frame_error(timeout_s, self.incomplete - incomplete_before)
            arrival_ns = self._clock.now_ns()
            if self._is_complete(frames):
                return self._frame(frames, arrival_ns)
            self.incomplete += 1

    def _no_frame_error(self, timeout_s: float, partial: int) -> FrameTimeout | LinkLost:
        if not self._device.is_connected():
            return LinkLost(f"{self._name}: disconnected; check its cable and reopen it")
        detail = f"; {partial} came without their depth or colour" if partial else ""
        return FrameTimeout(f"{self._name}: no frame within {timeout_s:g} s{detail}")

    def _open(self, stack: contextlib.ExitStack) -> None:
        rs = self._rs = self._vendor if self._vendor is not None else _load_vendor()
        context = rs.context()
        device = _find_device(rs, context, self._config.serial)
        serial = device.get_info(rs.camera_info.serial_number)
        self._name = f"{device.get_info(rs.camera_info.name)} {serial}"
        set_up_sensors(rs, device, self._name, self._config)
        profile = self._start_video(context, serial, stack)
        self._device = profile.get_device()
        colour = profile.get_stream(rs.stream.color).as_video_stream_profile()
        depth = profile.get_stream(rs.stream.depth).as_video_stream_profile()
        self._verify(colour, rs.format.bgr8)
        self._verify(depth, rs.format.z16)
        self._intrinsics = self._read_intrinsics(colour.get_intrinsics())
        self._depth_scale_m = self._read_depth_scale()
        self._align = rs.align(rs.stream.color)
        self._device_clock = DeviceClock(round(self._config.latency_s * NS_PER_S))
        self._colour_number = self._depth_number = -1
        self._gyro_queue = self._start_gyro(context, serial, colour, stack) if self._config.gyro else None

    def _start_video(self, context: Any, serial: str, stack: contextlib.ExitStack) -> Any:
        rs, requested = self._rs, self._config
        settings = rs.config()
        settings.enable_device(serial)
        settings.enable_stream(
            rs.stream.color, requested.width, requested.height, rs.format.bgr8, requested.fps
        )
        settings.enable_stream(
            rs.stream.depth, requested.width, requested.height, rs.format.z16, requested.fps
        )
        pipeline = rs.pipeline(context)
        try:
            profile = pipeline.start(settings)
        except RuntimeError as error:
            raise DeviceRefused(
                f"{self._name}: does not start {requested.width}x{requested.height} colour and depth "
                f"at {requested.fps} Hz ({error}); {_USB_HINT}"
            ) from error
        stack.callback(_stop, pipeline)
        stack.callback(self._forget_pipeline)
        self._pipeline = pipeline
        return profile

    def _forget_pipeline(self) -> None:
        self._pipeline = None

    def _start_gyro(self, context: Any, serial: str, colour: Any, stack: contextlib.ExitStack) -> Any:
        """Start the gyro in a separate pipeline: the framesets of the video would hold only its newest
        sample."""
        rs = self._rs
        settings = rs.config()
        settings.enable_device(serial)
        settings.enable_stream(rs.stream.gyro, rs.format.motion_xyz32f, _GYRO_RATE_HZ)
        queue = rs.frame_queue(_GYRO_QUEUE, True)
        pipeline = rs.pipeline(context)
        try:
            profile = pipeline.start(settings, queue)
        except RuntimeError as error:
            raise DeviceRefused(
                f"{self._name}: gives no gyro at {_GYRO_RATE_HZ} Hz ({error}); "
                "a D435i has one, a D435 has not: set camera.gyro to false"
            ) from error
        stack.callback(_stop, pipeline)
        # librealsense stores rotations column by column.
        extrinsics = profile.get_stream(rs.stream.gyro).get_extrinsics_to(colour)
        self._gyro_to_colour = np.array(extrinsics.rotation, np.float64).reshape(3, 3).T
        return queue

    def _verify(self, stream: Any, pixel_format: Any) -> None:
        requested = self._config
        actual = (stream.width(), stream.height(), stream.fps(), stream.format())
        if actual != (requested.width, requested.height, requested.fps, pixel_format):
            raise DeviceRefused(
                f"{self._name}: {stream.stream_name()} was asked for {requested.width}x{requested.height} at "
                f"{requested.fps} Hz as {pixel_format}, the device gave {actual[0]}x{actual[1]} at "
                f"{actual[2]} Hz as {actual[3]}; choose a mode that it has (rs-enumerate-devices lists them)"
            )

    def _read_intrinsics(self, k: Any) -> Intrinsics:
        if any(k.coeffs):
            raise DeviceRefused(
                f"{self._name}: its colour stream is distorted ({k.model}), that of a D435i is not; "
                "this driver would take bent lines for straight ones"
            )
        return Intrinsics(k.width, k.height, k.fx, k.fy, k.ppx, k.ppy)

    def _read_depth_scale(self) -> float:
        scale_m = float(self._device.first_depth_sensor().get_depth_scale())
        if not 0.0 < scale_m < 0.1:
            raise DeviceRefused(f"{self._name}: its depth unit of {scale_m} m is impossible; reconnect it")
        # The device's float32 0.001 means 0.001, not 0.0010000000475.
        return float(str(np.float32(scale_m)))

    def _is_complete(self, frames: Any) -> bool:
        """Whether a frameset holds both streams, both new and of the same time.

        The first frameset after a start holds only one stream. While one stream stalls, librealsense may
        repeat its last frame next to new ones of the other.
        """
        colour, depth = frames.get_color_frame(), frames.get_depth_frame()
        if not colour or not depth:
            return False
        frame_numbers = colour.get_frame_number(), depth.get_frame_number()
        difference_ms = abs(colour.get_timestamp() - depth.get_timestamp())
        if self._colour_number == frame_numbers[0] or self._depth_number == frame_numbers[1]:
            return False
        if difference_ms > 1000.0 / self._config.fps:
            return False
        self._colour_number, self._depth_number = frame_numbers
        return True

    def _frame(self, frames: Any, arrival_ns: int) -> RgbdFrame:
        colour = frames.get_color_frame()
        depth = self._align.process(frames).get_depth_frame()
        device_ms = colour.get_timestamp()
        captured_ns = self._device_clock.captured_ns(round(device_ms * NS_PER_MS), arrival_ns)
        return RgbdFrame(
            # Copies, because librealsense owns the buffers and stops when too many are kept.
            colour=np.array(colour.get_data(), np.uint8),
            depth=np.array(depth.get_data(), np.uint16),
            depth_scale_m=self._depth_scale_m,
            captured_ns=captured_ns,
            device_s=device_ms / 1000.0,
            sequence=colour.get_frame_number(),
            intrinsics=self.intrinsics,
            gyro=self._gyro_samples(),
        )

    def _gyro_samples(self) -> GyroSamples | None:
        """All samples that have arrived since the last frame; None without a gyro."""
        if self._gyro_queue is None:
            return None
        stamps_ns: list[int] = []
        rates_radps: list[tuple[float, float, float]] = []
        while sample := self._gyro_queue.poll_for_frame():
            rate = sample.as_motion_frame().get_motion_data()
            stamps_ns.append(self._device_clock.monotonic_ns(round(sample.get_timestamp() * NS_PER_MS)))
            rates_radps.append((rate.x, rate.y, rate.z))
        rates = np.array(rates_radps, np.float64).reshape(-1, 3) @ self._gyro_to_colour.T
        return GyroSamples(np.array(stamps_ns, np.int64), rates)


def _load_vendor() -> Any:
    try:
        import pyrealsense2
    except ImportError as error:
        raise DeviceNotFound(
            f"RealSense: pyrealsense2 cannot be imported ({error}); pip install -e '.[realsense]' and, "
            "on Debian and Ubuntu, the system package libusb-1.0-0"
        ) from error
    return pyrealsense2


def _find_device(rs: Any, context: Any, serial: str | None) -> Any:
    """The device of that serial number, or the only one. Raises DeviceNotFound."""
    devices = {device.get_info(rs.camera_info.serial_number): device for device in context.query_devices()}
    if not devices:
        raise DeviceNotFound(f"RealSense: no camera is connected; {_USB_HINT}")
    found = ", ".join(sorted(devices))
    if serial is None:
        if len(devices) > 1:
            raise DeviceNotFound(
                f"RealSense: several cameras are connected ({found}); set camera.serial to one"
            )
        return next(iter(devices.values()))
    if serial not in devices:
        raise DeviceNotFound(f"RealSense: no camera with serial number {serial}; connected: {found}")
    return devices[serial]


def _stop(pipeline: Any) -> None:
    # A camera that was unplugged refuses to stop; there is nothing left to stop then.
    with contextlib.suppress(RuntimeError):
        pipeline.stop()
