"""The simulated camera: what one picture costs, and what a whole exposure with the sensor's noise does."""

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
    """picture: colour and exact depth. exposure: the picture with colour and depth noise, as a frame.

    faces: in the view of a typical picture, those that nearer ones hide included.
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
    """Each picture twice: by renderer, which must draw the camera's world, and within an exposure.

    The camera's clock must start at zero. The first picture, which prepares the textures, is not counted.
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
