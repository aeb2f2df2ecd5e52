"""The simulated RGB-D camera: frames of a world, due at fixed times of the clock that it is given."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Self

from config.camera import SimulatedCameraConfig
from config.own_parts import OwnPart
from hal.api import Clock
from hal.clocks import NS_PER_S
from hal.errors import DeviceRefused, FrameTimeout
from hal.geometry import camera_in_floor
from hal.types import CameraMount, ColourImage, Intrinsics, PlanarPose, Pose, RgbdFrame
from sim.rendering.colour_noise import ColourSensor
from sim.rendering.depth_noise import DEPTH_SCALE_M, DepthSensor
from sim.rendering.own_parts import OwnPartsPainter
from sim.rendering.render import Picture, Renderer
from sim.world import World

BodyPoseAt = Callable[[int], PlanarPose]


class SimulatedCamera:
    """A FrameSource. World time zero is start_ns of the clock; frame k is due k / fps later."""

    def __init__(
        self,
        world: World,
        config: SimulatedCameraConfig,
        mount: CameraMount,
        clock: Clock,
        body_pose: BodyPoseAt,
        start_ns: int | None = None,
        own_parts: Sequence[OwnPart] = (),
    ) -> None:
        """body_pose: the true pose of the robot on the floor at a time of the clock. own_parts: of the robot,
        which the camera sees."""
        self._config = config
        self._mount = mount
        self._clock = clock
        self._body_pose = body_pose
        self._start_ns = clock.now_ns() if start_ns is None else start_ns
        self._index = 0
        self._intrinsics = intrinsics_of(config)
        self._renderer = Renderer(world, self._intrinsics)
        self._depth = DepthSensor(config, self._intrinsics, world.seed)
        self._sensor = ColourSensor(self._intrinsics, world.seed)
        self._own = OwnPartsPainter(own_parts, mount, self._intrinsics) if own_parts else None
        self._picture: Picture | None = None
        self._is_closed = False

    def __enter__(self) -> Self:
        self._is_closed = False
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_closed = True

    @property
    def intrinsics(self) -> Intrinsics:
        """The pinhole camera of both images."""
        return self._intrinsics

    @property
    def next_capture_ns(self) -> int:
        """When the next frame will be exposed."""
        return self._start_ns + round(self._index * NS_PER_S / self._config.fps)

    @property
    def start_ns(self) -> int:
        """Time zero of the world, on the clock."""
        return self._start_ns

    @property
    def last_picture(self) -> Picture | None:
        """The noiseless picture of the last frame, for evaluation. Valid until the next read."""
        return self._picture

    def read(self, timeout_s: float) -> RgbdFrame:
        """Wait for the next exposure and draw it. Raises FrameTimeout if it is not due in time, DeviceRefused
        once closed.

        Exposures that were missed since the last read are lost, as with a real camera; sequence shows the
        gap.
        """
        if self._is_closed:
            raise DeviceRefused("simulated camera: is closed; read it inside a with block")
        missed_ns = self._clock.now_ns() - self.next_capture_ns
        if missed_ns > 0:
            self._index += int(missed_ns * self._config.fps / NS_PER_S)
        due_ns = self.next_capture_ns
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        if due_ns > deadline_ns:
            self._clock.sleep_until_ns(deadline_ns)
            raise FrameTimeout(f"simulated camera: no frame is due within {timeout_s:.3f} s")
        self._clock.sleep_until_ns(due_ns)
        frame = self._expose(due_ns)
        self._index += 1
        return frame

    def lose_frame(self) -> None:
        """Lose the next frame; the gap in the sequence numbers shows it."""
        self._index += 1

    def camera_pose(self, stamp_ns: int) -> Pose:
        """The true pose of the optical frame in the floor's frame, with vibration."""
        amplitude = math.radians(self._config.vibration_deg)
        phase = 2.0 * math.pi * self._config.vibration_hz * (stamp_ns - self._start_ns) / NS_PER_S
        mount = replace(self._mount, pitch_rad=self._mount.pitch_rad + amplitude * math.sin(phase))
        return camera_in_floor(self._body_pose(stamp_ns), mount)

    def _expose(self, stamp_ns: int) -> RgbdFrame:
        t_s = (stamp_ns - self._start_ns) / NS_PER_S
        self._picture = self._renderer.render(t_s, self.camera_pose(stamp_ns))
        if self._own is not None:
            self._own.draw(self._picture)
        return RgbdFrame(
            colour=self._colour(self._picture.colour),
            depth=self._depth.measure(self._picture.inverse_depth, self._index),
            depth_scale_m=DEPTH_SCALE_M,
            captured_ns=stamp_ns,
            device_s=t_s,
            sequence=self._index,
            intrinsics=self._intrinsics,
        )

    def _colour(self, clean: ColourImage) -> ColourImage:
        if self._config.colour_noise:
            return self._sensor.expose(clean, self._index)
        return clean.copy()


def intrinsics_of(config: SimulatedCameraConfig) -> Intrinsics:
    """The intrinsics of a configured camera."""
    return Intrinsics(config.width, config.height, config.fx, config.fy, config.cx, config.cy)
