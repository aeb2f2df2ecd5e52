"""A body that lies beside the place where it was first seen has moved, whatever of it was seen in between."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from config.perception import DepthNoise
from hal.types import FloatArray
from tests.support.detections import detection
from tests.support.grids import grid_of, labelled, nearest, plate
from vision.bodies import sightings
from vision.bodies.tracks import Tracks
from vision.depth import regions

DEPTH_M, HALF_WIDTH_M = 3.0, 0.2
FRAMES = 30

Shown = Callable[[int], FloatArray]


def feet_m(frame: int) -> float:
    """How far down the body is visible: its area changes by more than a third from frame to frame."""
    return 0.6 if frame % 2 else 0.1


def displaced_in(body: Shown, nearer: Shown | None = None) -> list[int]:
    """The frames in which the only track is displaced. body: depth of it in a frame; nearer: of another."""
    tracks, frames = Tracks(), []
    tracks.start(np.array([[-0.9, 0.0, DEPTH_M]]), 0.2, 1.5, 0.0, 0)
    for frame in range(FRAMES):
        tracks.predict(1.0 / 30.0, 0.12, None)
        depth_m = body(frame) if nearer is None else nearest(body(frame), nearer(frame))
        grid, labels = grid_of(depth_m), labelled(depth_m == DEPTH_M)
        measured = regions.with_occlusion(grid, labels, regions.measure(grid, labels, 1))
        sightings.update_from_surfaces(tracks, detection(grid, frame), measured, DepthNoise())
        frames += [frame] if tracks.displaced[0] else []
    return frames


def person_at(x_m: float, frame: int) -> FloatArray:
    return plate(DEPTH_M, (x_m - HALF_WIDTH_M, x_m + HALF_WIDTH_M), (-0.6, feet_m(frame)))


def test_who_walks_is_displaced_once_he_is_beside_his_former_place() -> None:
    """1.2 m/s, 0.4 m wide: 0.7 m are left behind after 18 frames."""
    frames = displaced_in(lambda frame: person_at(-0.9 + 0.04 * frame, frame))
    assert frames
    assert 17 <= frames[0] <= 21
    assert frames == list(range(frames[0], FRAMES))


def test_what_stands_is_not_however_much_of_it_is_seen() -> None:
    assert displaced_in(lambda frame: person_at(-0.9, frame)) == []


def test_what_is_seen_elsewhere_all_at_once_is_something_else() -> None:
    assert displaced_in(lambda frame: person_at(-0.9 if frame < 10 else 0.0, frame)) == []


def test_a_rest_beside_something_nearer_that_goes_by_is_not() -> None:
    """A wide board stands, and a nearer one that goes by leaves less and less of it to see."""
    frames = displaced_in(
        lambda frame: plate(DEPTH_M, (-1.1, 0.9), (-0.6, 0.6)),
        lambda frame: plate(1.0, (-1.0, -0.36 + 0.015 * frame), (-1.0, 1.0)),
    )
    assert frames == []
