"""The RealSense driver over a scripted vendor module: what it gives, and what it makes of misbehaviour."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from config.camera import RealsenseCameraConfig
from hal.cameras.realsense import RealsenseCamera
from hal.clocks import NS_PER_MS, SimulatedClock
from hal.errors import DeviceNotFound, DeviceRefused, FrameTimeout, LinkLost
from hal.types import Intrinsics
from tests.support.fake_realsense import FakeDevice, FakeRealsense, FakeStream
from tests.support.fake_realsense_frames import PERIOD_MS, FakeFrameset, FakeGyro, frameset, framesets

LATENCY_S = 0.03


def camera_over(
    *events: FakeFrameset | FakeGyro | RuntimeError, gyro: bool = False, serial: str | None = None
) -> tuple[RealsenseCamera, FakeRealsense, SimulatedClock]:
    clock = SimulatedClock()
    vendor = FakeRealsense(clock, list(events))
    config = RealsenseCameraConfig(gyro=gyro, serial=serial, latency_s=LATENCY_S)
    return RealsenseCamera(config, clock, vendor), vendor, clock


def test_gives_colour_and_depth_with_scale_intrinsics_and_device_time() -> None:
    camera, _, _ = camera_over(*framesets(0, 3))
    with camera:
        frame = camera.read(0.1)
        assert frame.colour.shape == (480, 848, 3)
        assert frame.colour.dtype == np.uint8
        assert np.all(frame.colour == 1)
        assert frame.depth.shape == (480, 848)
        assert frame.depth.dtype == np.uint16
        assert np.all(frame.depth == 1001)
        assert frame.depth_scale_m == 0.001
        assert frame.sequence == 1
        assert frame.device_s == pytest.approx(PERIOD_MS / 1000)
        assert frame.intrinsics == camera.intrinsics == Intrinsics(848, 480, 615.0, 614.0, 321.5, 238.5)
        assert frame.gyro is None


def test_a_frame_does_not_change_when_the_vendor_reuses_its_buffer() -> None:
    second = frameset(1)
    camera, _, _ = camera_over(frameset(0), second)
    with camera:
        frame = camera.read(0.1)
    second.colour.get_data()[...] = 0
    second.depth.get_data()[...] = 0
    assert np.all(frame.colour == 1)
    assert np.all(frame.depth == 1001)


def test_captured_ns_is_the_promptest_arrival_less_the_latency_without_the_jitter() -> None:
    late = frameset(2, arrival_ms=2 * PERIOD_MS + 29.0)
    camera, _, _ = camera_over(frameset(0), frameset(1), late, frameset(3))
    with camera:
        stamps_ns = [camera.read(0.1).captured_ns for _ in range(3)]
    expected_ms = [number * PERIOD_MS + 20.0 - 1000 * LATENCY_S for number in (1, 2, 3)]
    np.testing.assert_allclose(np.array(stamps_ns) / NS_PER_MS, expected_ms, atol=1e-3)


def test_asks_for_the_configured_modes_of_the_one_device_and_steadies_its_sensors() -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1))
    with camera:
        assert vendor.configs[0].serial == "000000000001"
        assert vendor.configs[0].streams == [
            ("color", 848, 480, "bgr8", 30),
            ("depth", 848, 480, "z16", 30),
        ]
        assert [sensor.options for sensor in vendor.device.sensors] == [
            {"global_time_enabled": 0},
            {"auto_exposure_priority": 0},
        ]


def test_single_stream_framesets_are_passed_over_and_counted() -> None:
    camera, _, _ = camera_over(
        frameset(0, depth=False),
        frameset(1),
        frameset(2, colour=False),
        frameset(3, depth=False),
        frameset(4),
    )
    with camera:
        assert camera.incomplete == 1
        assert camera.read(0.2).sequence == 4
        assert camera.incomplete == 3


def test_a_repeated_depth_frame_is_not_taken_for_a_new_one() -> None:
    stale = frameset(2, depth_number=1, depth_device_ms=2 * PERIOD_MS)
    camera, _, _ = camera_over(frameset(0), frameset(1), stale, frameset(3))
    with camera:
        assert [camera.read(0.1).sequence, camera.read(0.1).sequence] == [1, 3]


def test_depth_of_another_time_is_not_taken_for_the_colours() -> None:
    apart = frameset(1, depth_device_ms=-0.1)
    camera, _, _ = camera_over(frameset(0), apart, frameset(2))
    with camera:
        assert camera.read(0.1).sequence == 2


def test_silence_is_a_frame_timeout_after_exactly_the_time_given_and_reading_can_go_on() -> None:
    camera, _, clock = camera_over(frameset(0), frameset(9))
    with camera:
        before_ns = clock.now_ns()
        with pytest.raises(FrameTimeout, match=r"no frame within 0\.1 s"):
            camera.read(0.1)
        assert clock.now_ns() - before_ns == 100 * NS_PER_MS
        assert camera.read(1.0).sequence == 9


def test_a_stream_that_lost_its_depth_times_out_and_says_so() -> None:
    camera, _, clock = camera_over(frameset(0), *(frameset(n, depth=False) for n in range(1, 30)))
    with camera:
        before_ns = clock.now_ns()
        with pytest.raises(FrameTimeout, match="came without their depth or colour"):
            camera.read(0.5)
        assert clock.now_ns() - before_ns <= 501 * NS_PER_MS


def test_unplugging_is_link_lost_and_closing_afterwards_is_safe() -> None:
    camera, vendor, _ = camera_over(frameset(0))
    with camera:
        vendor.device.connected = False
        with pytest.raises(LinkLost, match=r"D435I \(fake\) 000000000001: disconnected"):
            camera.read(0.1)


def test_a_vendor_error_while_reading_is_link_lost_with_its_cause() -> None:
    camera, _, _ = camera_over(frameset(0), RuntimeError("uvc failed"))
    with camera, pytest.raises(LinkLost, match="uvc failed") as caught:
        camera.read(0.1)
    assert isinstance(caught.value.__cause__, RuntimeError)


def test_gyro_samples_come_with_the_frame_in_optical_axes_and_monotonic_time() -> None:
    camera, _, _ = camera_over(
        FakeGyro(-5.0, (9.0, 9.0, 9.0)),
        frameset(0),
        FakeGyro(10.0, (1.0, 2.0, 3.0)),
        FakeGyro(15.0, (0.5, 0.0, 0.0)),
        frameset(1),
        frameset(2),
        gyro=True,
    )
    with camera:
        gyro = camera.read(0.1).gyro
        assert gyro is not None
        # The fake's extrinsics turn x to y and y to -x.
        np.testing.assert_allclose(gyro.rates_radps, [[-2.0, 1.0, 3.0], [0.0, 0.5, 0.0]])
        offset_ms = 20.0 - 1000 * LATENCY_S
        np.testing.assert_allclose(
            gyro.stamps_ns / NS_PER_MS, [10.0 + offset_ms, 15.0 + offset_ms], atol=1e-3
        )
        none_new = camera.read(0.1).gyro
        assert none_new is not None
        assert none_new.rates_radps.shape == (0, 3)
        assert none_new.stamps_ns.shape == (0,)


def test_leaving_stops_both_pipelines_and_reading_is_refused() -> None:
    camera, vendor, _ = camera_over(frameset(0), gyro=True)
    with camera:
        assert [pipeline.running for pipeline in vendor.pipelines] == [True, True]
    assert [pipeline.running for pipeline in vendor.pipelines] == [False, False]
    with pytest.raises(DeviceRefused, match="not open"):
        camera.read(0.1)


def test_can_be_opened_again_after_closing() -> None:
    camera, _, _ = camera_over(*framesets(0, 4))
    with camera:
        assert camera.read(0.1).sequence == 1
    with camera:
        assert camera.read(0.1).sequence == 3


def test_intrinsics_are_refused_before_opening() -> None:
    camera, _, _ = camera_over()
    with pytest.raises(DeviceRefused, match="once it has been opened"):
        _ = camera.intrinsics


def test_without_the_driver_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    camera = RealsenseCamera(RealsenseCameraConfig(), SimulatedClock())
    with pytest.raises(DeviceNotFound, match=r"'\.\[realsense\]'.*libusb-1.0-0"):
        camera.__enter__()


def test_takes_the_module_that_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimulatedClock()
    monkeypatch.setitem(sys.modules, "pyrealsense2", FakeRealsense(clock, list(framesets(0, 2))))
    with RealsenseCamera(RealsenseCameraConfig(), clock) as camera:
        assert camera.read(0.1).sequence == 1


def test_no_camera_is_device_not_found() -> None:
    camera, vendor, _ = camera_over()
    vendor.devices = []
    with pytest.raises(DeviceNotFound, match="no camera is connected"):
        camera.__enter__()


def test_another_serial_number_is_device_not_found_and_tells_the_connected_ones() -> None:
    camera, _, _ = camera_over(serial="42")
    with pytest.raises(DeviceNotFound, match="serial number 42; connected: 000000000001"):
        camera.__enter__()


def test_serial_number_is_required_among_several_cameras() -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1))
    vendor.devices = [vendor.device, FakeDevice(serial="2")]
    with pytest.raises(DeviceNotFound, match=r"several cameras are connected \(000000000001, 2\)"):
        camera.__enter__()


def test_camera_with_the_configured_serial_number_is_opened() -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1), serial="2")
    vendor.devices = [vendor.device, FakeDevice(serial="2")]
    with camera:
        assert vendor.configs[0].serial == "2"


def test_a_mode_that_does_not_start_is_refused_with_the_vendors_reason() -> None:
    camera, vendor, _ = camera_over()
    vendor.refuse_video = "Couldn't resolve requests"
    with pytest.raises(DeviceRefused, match=r"848x480.*30 Hz.*Couldn't resolve requests.*USB 3"):
        camera.__enter__()


def test_a_device_that_gives_another_mode_than_asked_is_refused_and_stopped() -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1))
    vendor.streams["depth"] = FakeStream("Depth", "z16", size=(640, 480))
    with pytest.raises(DeviceRefused, match=r"Depth was asked for 848x480 .* gave 640x480"):
        camera.__enter__()
    assert [pipeline.running for pipeline in vendor.pipelines] == [False]


def test_a_distorted_colour_stream_is_refused() -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1))
    vendor.streams["color"].intrinsics.coeffs = [0.1, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(DeviceRefused, match="distorted"):
        camera.__enter__()


@pytest.mark.parametrize("scale_m", [0.0, 1.0, float("nan")])
def test_an_impossible_depth_unit_is_refused(scale_m: float, monkeypatch: pytest.MonkeyPatch) -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1))
    monkeypatch.setattr(vendor.device.depth_sensor, "get_depth_scale", lambda: scale_m)
    with pytest.raises(DeviceRefused, match="depth unit"):
        camera.__enter__()


def test_a_camera_without_gyro_is_refused_when_its_gyro_is_wanted_and_its_video_stopped() -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1), gyro=True)
    vendor.refuse_gyro = "Couldn't resolve requests"
    with pytest.raises(DeviceRefused, match=r"set camera\.gyro to false"):
        camera.__enter__()
    assert [pipeline.running for pipeline in vendor.pipelines] == [False]


def test_a_camera_that_starts_but_gives_nothing_is_refused() -> None:
    camera, vendor, clock = camera_over()
    with pytest.raises(DeviceRefused, match="no frames come"):
        camera.__enter__()
    assert clock.now_ns() == 5_000 * NS_PER_MS
    assert [pipeline.running for pipeline in vendor.pipelines] == [False]


def test_a_setting_that_is_not_permitted_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    camera, vendor, _ = camera_over(*framesets(0, 1))

    def deny(option: str, value: float) -> None:
        raise RuntimeError("Permission denied")

    monkeypatch.setattr(vendor.device.sensors[0], "set_option", deny)
    with pytest.raises(DeviceRefused, match=r"cannot be opened .*Permission denied"):
        camera.__enter__()
