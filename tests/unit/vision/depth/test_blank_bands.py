"""Bands of the view in which nothing was measured: somebody right before the lens, and what is not that."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hal.types import CameraMount
from tests.support.painted import MOUNT, VGA, floor, wall
from tests.support.painted_scans import CENTRE, frame_of, inside, outside, space_of
from vision.scene import FreeSpace

DOWN = CameraMount(0.0, 0.0, 0.9, math.radians(25.0))
HORIZON = round(VGA.cy)


def seen_without(
    columns: slice, rows: slice, share: float = 1.0, mount: CameraMount = MOUNT
) -> tuple[FreeSpace, NDArray[np.bool_]]:
    """The scan of a floor and a wall of which a share of some pixels has no depth; and its blank bands."""
    frame = frame_of(floor() + wall(), mount)
    depth = frame.depth.copy()
    lost = np.zeros(depth.shape, np.bool_)
    lost[rows, columns] = np.random.default_rng(1).random(lost[rows, columns].shape) < share
    depth[lost] = 0
    space = space_of(replace(frame, depth=depth), mount)
    assert space.blank is not None
    return space, space.blank


def test_surface_right_before_the_lens_leaves_its_bands_blank() -> None:
    space, blank = seen_without(CENTRE, slice(None))
    assert blank[inside(space)].all()
    assert not blank[outside(space)].any()
    assert seen_without(slice(None), slice(None))[1].all()
    # Speckles on it are no data.
    speckled, blank = seen_without(CENTRE, slice(None), share=0.999)
    assert blank[inside(speckled)].all()


@pytest.mark.parametrize(
    "rows",
    [
        slice(0, 0),
        slice(HORIZON, None),  # a mat or a puddle as far as the wall
        slice(VGA.height - 80, None),
        slice(0, VGA.height - 60),  # a glass front
    ],
)
def test_a_hole_in_the_floor_or_behind_it_is_not_blank(rows: slice) -> None:
    assert not seen_without(CENTRE, rows)[1].any()


def test_a_camera_that_looks_down_tells_it_in_its_fanned_bands() -> None:
    middle = slice(240, 400)
    space, blank = seen_without(middle, slice(None), mount=DOWN)
    assert blank[np.abs(space.bearing_tan) < 0.05].all()
    assert not blank[np.abs(space.bearing_tan) > 0.3].any()
    assert not seen_without(middle, slice(VGA.height - 80, None), mount=DOWN)[1].any()


def test_depth_beyond_the_mask_does_not_leave_bands_blank() -> None:
    frame = frame_of(floor())
    depth = frame.depth.copy()
    depth[:, CENTRE] = 30000
    space = space_of(replace(frame, depth=depth))
    assert space.blank is not None
    assert not space.blank.any()
