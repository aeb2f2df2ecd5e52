"""A stand-in for the module pyrealsense2 that follows a script, also a bad one.

Only what hal/cameras/realsense.py uses. Time passes on a SimulatedClock: waiting for a frame takes the clock
to when that frame arrives, or to the end of the wait. The frames: fake_realsense_frames.py.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import StrEnum
from types import SimpleNamespace

import numpy as np

from hal.clocks import NS_PER_MS, SimulatedClock
from tests.support.fake_realsense_frames import FPS, HEIGHT, WIDTH, FakeFrameset, FakeGyro

SERIAL = "000000000001"


class FakeOption(StrEnum):
    auto_exposure_priority = "auto_exposure_priority"
    global_time_enabled = "global_time_enabled"
    visual_preset = "visual_preset"
    exposure = "exposure"
    laser_power = "laser_power"


class FakeSensor:
    def __init__(self, supported: set[str]) -> None:
        self._supported = supported
        self.options: dict[str, float] = {}

    def supports(self, option: str) -> bool:
        return option in self._supported

    def set_option(self, option: str, value: float) -> None:
        if value < 0.0:
            raise RuntimeError("out of range")
        self.options[option] = value

    def get_depth_scale(self) -> float:
        return float(np.float32(0.001))


@dataclass
class FakeStream:
    """A video or gyro stream profile."""

    name: str
    pixel_format: str
    size: tuple[int, int] = (WIDTH, HEIGHT)
    rate: int = FPS
    intrinsics: SimpleNamespace = field(
        default_factory=lambda: SimpleNamespace(
            width=WIDTH,
            height=HEIGHT,
            fx=615.0,
            fy=614.0,
            ppx=321.5,
            ppy=238.5,
            coeffs=[0.0] * 5,
            model="none",
        )
    )
    # Column by column: x to y, y to -x, so that mixing rows up with columns shows.
    rotation: tuple[float, ...] = (0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)

    def as_video_stream_profile(self) -> FakeStream:
        return self

    def width(self) -> int:
        return self.size[0]

    def height(self) -> int:
        return self.size[1]

    def fps(self) -> int:
        return self.rate

    def format(self) -> str:
        return self.pixel_format

    def stream_name(self) -> str:
        return self.name

    def get_intrinsics(self) -> SimpleNamespace:
        return self.intrinsics

    def get_extrinsics_to(self, other: FakeStream) -> SimpleNamespace:
        return SimpleNamespace(rotation=list(self.rotation), translation=[0.0, 0.0, 0.0])


@dataclass
class FakeDevice:
    serial: str = SERIAL
    connected: bool = True
    sensors: list[FakeSensor] = field(
        default_factory=lambda: [FakeSensor({"global_time_enabled"}), FakeSensor({"auto_exposure_priority"})]
    )
    depth_sensor: FakeSensor = field(
        default_factory=lambda: FakeSensor({"visual_preset", "exposure", "global_time_enabled"})
    )
    colour_sensor: FakeSensor = field(default_factory=lambda: FakeSensor({"exposure"}))

    def get_info(self, key: str) -> str:
        return {"serial_number": self.serial, "name": "D435I (fake)"}[key]

    def query_sensors(self) -> list[FakeSensor]:
        return self.sensors

    def is_connected(self) -> bool:
        return self.connected

    def first_depth_sensor(self) -> FakeSensor:
        return self.depth_sensor

    def first_color_sensor(self) -> FakeSensor:
        return self.colour_sensor


class FakeConfig:
    def __init__(self) -> None:
        self.serial: str | None = None
        self.streams: list[tuple[object, ...]] = []

    def enable_device(self, serial: str) -> None:
        self.serial = serial

    def enable_stream(self, *what: object) -> None:
        self.streams.append(what)


class FakeGyroQueue:
    def __init__(self, capacity: int, keep_frames: bool) -> None:
        self.samples: deque[FakeGyro] = deque(maxlen=capacity)

    def poll_for_frame(self) -> FakeGyro | None:
        return self.samples.popleft() if self.samples else None


class FakePipeline:
    def __init__(self, vendor: FakeRealsense) -> None:
        self._vendor = vendor
        self.running = False

    def start(self, config: FakeConfig, queue: FakeGyroQueue | None = None) -> SimpleNamespace:
        refusal = self._vendor.refuse_gyro if queue is not None else self._vendor.refuse_video
        if refusal:
            raise RuntimeError(refusal)
        self.running = True
        self._vendor.pipelines.append(self)
        self._vendor.configs.append(config)
        if queue is not None:
            self._vendor.gyro_queue = queue
        return SimpleNamespace(
            get_device=lambda: self._vendor.device, get_stream=lambda kind: self._vendor.streams[kind]
        )

    def stop(self) -> None:
        if not self._vendor.device.connected:
            raise RuntimeError("device is gone")
        self.running = False

    def try_wait_for_frames(self, timeout_ms: int) -> tuple[bool, FakeFrameset | None]:
        if not self.running:
            raise RuntimeError("try_wait_for_frames cannot be called before start()")
        return self._vendor.wait(timeout_ms)


class FakeAlign:
    def __init__(self, stream: str) -> None:
        assert stream == "color"

    def process(self, frames: FakeFrameset) -> FakeFrameset:
        return frames


class FakeRealsense:
    """What ``import pyrealsense2`` would give. events: what the camera does, in order; then silence."""

    stream = SimpleNamespace(color="color", depth="depth", gyro="gyro")
    format = SimpleNamespace(bgr8="bgr8", z16="z16", motion_xyz32f="motion_xyz32f")
    option = FakeOption
    camera_info = SimpleNamespace(serial_number="serial_number", name="name")
    config = FakeConfig
    align = FakeAlign
    frame_queue = FakeGyroQueue

    def __init__(self, clock: SimulatedClock, events: list[FakeFrameset | FakeGyro | RuntimeError]) -> None:
        self._clock = clock
        self.events = deque(events)
        self.device = FakeDevice()
        self.devices = [self.device]
        self.streams = {
            "color": FakeStream("Color", "bgr8"),
            "depth": FakeStream("Depth", "z16"),
            "gyro": FakeStream("Gyro", "motion_xyz32f", rate=200),
        }
        self.refuse_video = self.refuse_gyro = ""
        self.pipelines: list[FakePipeline] = []
        self.configs: list[FakeConfig] = []
        self.gyro_queue = FakeGyroQueue(1, False)

    def context(self) -> SimpleNamespace:
        return SimpleNamespace(query_devices=lambda: self.devices)

    def pipeline(self, context: object) -> FakePipeline:
        return FakePipeline(self)

    def _has_been_replaced(self) -> bool:
        """The original keeps one frameset: one that nobody fetched is gone when the next one arrives."""
        after = next((event for event in self.events if not isinstance(event, FakeGyro)), None)
        return isinstance(after, FakeFrameset) and after.arrival_ms * NS_PER_MS <= self._clock.now_ns()

    def wait(self, timeout_ms: int) -> tuple[bool, FakeFrameset | None]:
        deadline_ns = self._clock.now_ns() + timeout_ms * NS_PER_MS
        while self.events:
            event = self.events[0]
            if isinstance(event, RuntimeError):
                self.events.popleft()
                raise event
            if isinstance(event, FakeGyro):
                self.gyro_queue.samples.append(event)
                self.events.popleft()
                continue
            if event.arrival_ms * NS_PER_MS > deadline_ns:
                break
            self.events.popleft()
            if not self._has_been_replaced():
                self._clock.sleep_until_ns(round(event.arrival_ms * NS_PER_MS))
                return True, event
        self._clock.sleep_until_ns(deadline_ns)
        return False, None
