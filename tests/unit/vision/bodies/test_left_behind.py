"""Furniture that has become part of a mover's track is static again once the mover has left it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray
from tests.support.detections import detection, track
from tests.support.grids import grid_of, labelled, nearest, no_depth, plate, wall
from tests.support.walker import moving, walker, way_m
from vision.bodies import left_behind
from vision.bodies.arrivals import ViewMemory
from vision.bodies.cutting import cut_out
from vision.bodies.tracks import Tracks
from vision.depth import regions

CONFIG = PerceptionConfig()
BACK = wall(8.0)
TABLE = plate(4.0, (-0.9, -0.02), (0.3, 0.5))
NOW_NS = 2_000_000_000


def parted(
    before_m: FloatArray,
    now_m: FloatArray,
    of_mover: NDArray[np.bool_],
    speed_mps: float,
    ago_s: float = 1.0,
    moves: bool = True,
) -> tuple[Tracks, NDArray[np.int32], NDArray[np.int32]]:
    """What is left of a track with these cells that goes to the right, if before_m was seen ago_s ago.

    Returns the tracks, and the labels as they were and as they are.
    """
    memory, seen = ViewMemory(CONFIG.depth_noise), detection(grid_of(now_m), 1)
    seen = replace(seen, captured_ns=NOW_NS)
    memory.remember(grid_of(before_m), seen.pose, NOW_NS - int(ago_s * 1e9))
    tracks, labels = Tracks(), labelled(of_mover)
    tracks.start(np.array([[0.0, 0.0, 4.0]]), 0.2, 1.5, 1.0, 0)
    tracks.state[0, 3:] = (speed_mps, 0.0, 0.0)
    tracks.moving[:] = moves
    measured = regions.measure(seen.grid, labels, 1)
    cuts = left_behind.cuts(tracks, seen, now_m > 0, labels, measured, memory, CONFIG)
    after, _ = cut_out(tracks, seen, labels, measured, cuts, CONFIG.motion.max_speed_mps)
    return tracks, labels, after


def past_the_table(**changes: Any) -> tuple[Tracks, NDArray[np.int32], NDArray[np.int32]]:
    """He stands at the right end of a table that was there without him a second ago."""
    here = plate(4.0, (0.0, 0.45), (-0.6, 1.0))
    scene = nearest(here, TABLE, BACK)
    return parted(nearest(TABLE, BACK), scene, (here > 0) | (TABLE > 0), **{"speed_mps": 1.2, **changes})


def test_the_table_that_somebody_leaves_is_a_static_track_of_its_own() -> None:
    tracks, _, labels = past_the_table()
    assert len(tracks) == 2
    assert tracks.evidence.tolist() == [1.0, 0.0]
    table = labels == 2
    # Where the table was seen, and a cell around it.
    around = cv2.dilate((TABLE > 0).astype(np.uint8), np.ones((3, 3), np.uint8))
    assert not (table & (around == 0)).any()
    # 0.96 to 1.2 m left of his own parts, a second ago, he may have been himself.
    assert 0.5 < np.count_nonzero(table & (TABLE > 0)) / np.count_nonzero(TABLE) < 0.7
    np.testing.assert_allclose(tracks.state[1, 2], 4.0, atol=0.05)


@pytest.mark.parametrize(
    "changes",
    [
        {"speed_mps": 0.35},  # 0.4 m have to be left in a second
        {"ago_s": 0.3},  # no view of about a second ago
        {"ago_s": 1.6},
        {"moves": False},
    ],
)
def test_nothing_is_parted_from_who_may_still_be_there(changes: dict[str, Any]) -> None:
    tracks, before, labels = past_the_table(**changes)
    assert (labels == before).all()
    assert len(tracks) == 1


def test_nothing_is_parted_from_what_is_no_wider_than_a_person() -> None:
    narrow = plate(4.0, (-0.2, 0.2), (0.3, 0.5))
    here = plate(4.0, (0.15, 0.55), (-0.6, 1.0))
    _, before, labels = parted(
        nearest(narrow, BACK), nearest(here, narrow, BACK), (here > 0) | (narrow > 0), 1.2
    )
    assert (labels == before).all()


@pytest.mark.parametrize("off", [1.0, 0.85, 1.2])
def test_a_long_vehicle_that_drives_along_its_own_side_stays_one(off: float) -> None:
    """Much of its side was vehicle a second ago as well; its speed may be known badly."""
    now, before = plate(4.0, (-1.0, 1.0), (-0.2, 0.8)), plate(4.0, (-1.5, 0.5), (-0.2, 0.8))
    _, labels_before, labels = parted(nearest(before, BACK), nearest(now, BACK), now > 0, 0.5 * off)
    assert (labels == labels_before).all()


def test_who_cannot_be_told_from_the_wall_behind_him_is_not_left_behind() -> None:
    """Nearly all of the track has stayed: that is no furniture, but depth that tells nothing."""
    here = plate(4.0, (-0.5, 0.5), (-0.6, 1.0))
    _, before, labels = parted(wall(4.05), nearest(here, wall(4.05)), here > 0, 1.2)
    assert (labels == before).all()


def test_a_person_20_cm_before_a_wall_is_not_part_of_it() -> None:
    here, crate = plate(3.0, (0.0, 0.45), (-0.6, 1.0)), plate(3.2, (-0.7, 0.0), (0.0, 0.4))
    back = wall(3.2)
    tracks, _, labels = parted(back, nearest(here, back), (here > 0) | (crate > 0), 1.2)
    assert len(tracks) == 2
    assert not (labels[here > 0] == 2).any()
    assert (labels[crate > 0] == 2).mean() > 0.6


def test_who_takes_up_a_table_as_it_comes_into_view_leaves_it_behind() -> None:
    """Depth shows the table only when he touches it, so it becomes part of him, 2 m wide."""
    table = plate(4.0, (-0.7, 1.3), (0.2, 0.6))
    views = [nearest(walker(-0.9 + way_m(k)), table if k >= 12 else no_depth(), BACK) for k in range(70)]
    percepts = track(views)
    for percept in percepts[40:]:
        (mover,) = moving(percept)
        np.testing.assert_allclose(mover.velocity_mps, [0.8, 0.0, 0.0], atol=0.12)
    assert mover.extent_m[0] < 0.6
    np.testing.assert_allclose(mover.position_m[0], -0.9 + way_m(69), atol=0.05)
