"""Measures the simulated camera: one picture, and a whole exposure with the sensor's noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controller.bench.figures import Durations
from controller.bench.reel import Tick
from hal.clocks import NS_PER_S
from sim.rendering.camera import SimulatedCamera
from sim.rendering.render import Renderer


@dataclass(frozen=True, slots=True)
class RendererFigures:
    """Figures of the renderer.

    width, height: of the picture, in pixels.
    faces: median number of faces in view, including those hidden by nearer ones.
    picture: colour and exact depth.
    exposure: the picture with colour and depth noise, as a frame.
    """

    width: int
    height: int
    faces: float
    picture: Durations
    exposure: Durations

    def as_json(self) -> dict[str, object]:
        """Plain values."""
        return {
            "width": self.width,
            "height": self.height,
            "faces": self.faces,
            "picture": self.picture.as_json(),
            "exposure": self.exposure.as_json(),
        }


def measure_renderer(
    camera: SimulatedCamera, renderer: Renderer, frames: int, stopwatch_ns: Callable[[], int], tick: Tick
) -> RendererFigures:
    """Render each picture twice: by renderer, and by the camera within an exposure.

    renderer: must render the camera's world.
    camera: its clock must start at zero.
    The first picture prepares the textures and is not counted.
    """
    picture_ns: list[int] = []
    exposure_ns: list[int] = []
    faces: list[int] = []
    for _ in range(frames + 1):
        stamp_ns = camera.next_capture_ns
        pose = camera.camera_pose(stamp_ns)
        started_ns = stopwatch_ns()
        picture = renderer.render(stamp_ns / NS_PER_S, pose)
        drawn_ns = stopwatch_ns()
        camera.read(timeout_s=1.0)
        exposed_ns = stopwatch_ns()
        picture_ns.append(drawn_ns - started_ns)
        exposure_ns.append(exposed_ns - drawn_ns)
        faces.append(len(picture.drawn))
        tick()
    size = camera.intrinsics
    return RendererFigures(
        size.width,
        size.height,
        float(np.median(faces[1:])),
        Durations.of(picture_ns[1:]),
        Durations.of(exposure_ns[1:]),
    )
