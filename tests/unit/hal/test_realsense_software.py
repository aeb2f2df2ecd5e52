"""The RealSense driver through the genuine pyrealsense2 and a software device; skipped without that package.

Real time: librealsense pairs and delivers in threads of its own. Frames are sent and read one by one, so
nothing sleeps here and no test depends on a rate.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import numpy as np
import pytest

from config.camera import RealsenseCameraConfig
from hal.cameras.realsense import RealsenseCamera
from hal.cameras.registration import DepthRegistration
from hal.clocks import MonotonicClock
from hal.errors import FrameTimeout
from hal.types import ColourImage, Intrinsics, Pose
from tests.support.software_realsense import (
    COLOUR_FX,
    DEPTH_FX,
    DEPTH_LEFT_OF_COLOUR_M,
    FPS,
    HEIGHT,
    SERIAL,
    WIDTH,
    SoftwareRealsense,
)

rs = pytest.importorskip("pyrealsense2", reason="pyrealsense2 is not installed (extra 'realsense')")

PLAIN_DEPTH = np.full((HEIGHT, WIDTH), 2000, np.uint16)


@pytest.fixture
def device() -> SoftwareRealsense:
    return SoftwareRealsense(rs)


def colour_image(value: int) -> ColourImage:
    return np.full((HEIGHT, WIDTH, 3), value, np.uint8)


@pytest.fixture
def camera(device: SoftwareRealsense) -> Iterator[RealsenseCamera]:
    """Opened over the software device; its frame 0 has been sent and used up by the opening."""
    config = RealsenseCameraConfig(
        serial=SERIAL, width=WIDTH, height=HEIGHT, fps=FPS, gyro=True, latency_s=0.0
    )
    driver = RealsenseCamera(config, MonotonicClock(), device.vendor)
    with ExitStack() as stack:
        helper = stack.enter_context(ThreadPoolExecutor(1))
        opening = helper.submit(driver.__enter__)
        while not opening.done():  # librealsense drops what is sent before the pipeline runs
            device.send(0, colour_image(0), PLAIN_DEPTH)
        stack.callback(driver.__exit__, None, None, None)
        yield opening.result()


def test_frames_come_whole_in_order_with_their_content(
    device: SoftwareRealsense, camera: RealsenseCamera
) -> None:
    for number in range(1, 10):
        device.send(number, colour_image(number), PLAIN_DEPTH)
        frame = camera.read(1.0)
        assert frame.sequence == number
        assert np.all(frame.colour == number)
        assert np.all(frame.depth == 2000)
        assert frame.depth_scale_m == 0.001
        assert frame.intrinsics == Intrinsics(WIDTH, HEIGHT, COLOUR_FX, COLOUR_FX, 320.0, 240.0)


def test_capture_times_increase_and_are_never_in_the_future(
    device: SoftwareRealsense, camera: RealsenseCamera
) -> None:
    before_ns = 0
    for number in range(1, 10):
        device.send(number, colour_image(number), PLAIN_DEPTH)
        captured_ns = camera.read(1.0).captured_ns
        assert before_ns < captured_ns <= MonotonicClock().now_ns()
        before_ns = captured_ns


def test_depth_is_aligned_to_colour_as_our_own_registration_does_it(
    device: SoftwareRealsense, camera: RealsenseCamera
) -> None:
    depth = PLAIN_DEPTH.copy()
    depth[180:300, 260:380] = 1000
    device.send(1, colour_image(1), depth)
    aligned = camera.read(1.0).depth
    ours = DepthRegistration(
        Intrinsics(WIDTH, HEIGHT, DEPTH_FX, DEPTH_FX, 320.0, 240.0),
        Intrinsics(WIDTH, HEIGHT, COLOUR_FX, COLOUR_FX, 320.0, 240.0),
        Pose(np.eye(3), np.array([DEPTH_LEFT_OF_COLOUR_M, 0.0, 0.0])),
        0.001,
    )(depth)
    # They may differ where the box's rim and its shadow lie: two columns or rows on each side.
    assert np.mean(aligned != ours) < 0.006
    # (260 - 320) / 385 * 615 + 615 * 0.015 m / 1 m + 320 = 233.4: the left rim in colour.
    assert aligned[240, 230] != 1000
    assert aligned[240, 236] == ours[240, 236] == 1000


def test_silence_is_a_timeout_and_streaming_resumes(
    device: SoftwareRealsense, camera: RealsenseCamera
) -> None:
    with pytest.raises(FrameTimeout):
        camera.read(0.02)
    device.send(1, colour_image(1), PLAIN_DEPTH)
    assert camera.read(1.0).sequence == 1


def test_gyro_samples_come_with_the_frame(device: SoftwareRealsense, camera: RealsenseCamera) -> None:
    device.send_gyro(1, 10.0, (0.1, 0.2, 0.3))
    device.send_gyro(2, 15.0, (0.4, 0.5, 0.6))
    device.send(1, colour_image(1), PLAIN_DEPTH)
    gyro = camera.read(1.0).gyro
    assert gyro is not None
    np.testing.assert_allclose(gyro.rates_radps, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], atol=1e-6)
    np.testing.assert_array_equal(np.diff(gyro.stamps_ns), [5_000_000])


def test_can_be_closed_and_opened_again(device: SoftwareRealsense, camera: RealsenseCamera) -> None:
    camera.__exit__(None, None, None)
    with ThreadPoolExecutor(1) as helper:
        opening = helper.submit(camera.__enter__)
        while not opening.done():
            device.send(1, colour_image(1), PLAIN_DEPTH)
        device.send(2, colour_image(2), PLAIN_DEPTH)
        assert camera.read(1.0).sequence == 2
