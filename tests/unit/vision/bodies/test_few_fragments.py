"""Which bodies have too few fragments, so that the next frame looks at them more closely."""

from __future__ import annotations

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.types import FloatArray
from tests.support.detections import START_NS, detection
from tests.support.grids import grid_of, no_depth
from vision.bodies.few_fragments import bodies_needing_fragments
from vision.bodies.tracks import Tracks
from vision.fragments.attention import NeedsFragments

CONFIG = PerceptionConfig()


def tracks(places: list[tuple[float, float, float]]) -> Tracks:
    made = Tracks()
    made.start(np.array(places), 0.2, 1.5, 0.0, START_NS)
    made.seen_ns[:], made.cells[:], made.sightings[:] = START_NS, 99, 99
    made.bbox_px[:] = np.arange(len(places))[:, None]
    return made


def asked_for(made: Tracks) -> NeedsFragments:
    return bodies_needing_fragments(made, detection(grid_of(no_depth())), CONFIG.depth_noise)


@pytest.mark.parametrize(
    ("moving", "fragments", "more"),
    [(False, 3, True), (False, 4, False), (True, 1, True), (True, 2, False)],
)
def test_bodies_with_too_few_fragments_want_more(moving: bool, fragments: int, more: bool) -> None:
    made = tracks([(0.0, 0.0, 4.0)])
    made.moving[0], made.fragments[0] = moving, fragments
    assert len(asked_for(made).ids) == more


def test_only_of_what_is_seen_large_enough_and_near() -> None:
    made = tracks([(0.0, 0.0, 4.0), (0.0, 0.0, 4.0), (0.0, 0.0, 4.0), (5.0, 0.0, 8.0)])
    made.seen_ns[1] -= 33_000_000
    made.cells[2] = 11
    assert asked_for(made).ids.tolist() == [1]


def test_new_ones_and_suspects_are_urgent() -> None:
    made = tracks([(0.0, 0.0, 4.0)] * 3)
    made.sightings[1], made.evidence[2] = 5, 0.1
    assert asked_for(made).urgent.tolist() == [False, True, True]


def test_the_gate_grows_with_depth_and_with_the_bodys_own() -> None:
    made = tracks([(0.0, 0.0, 2.0), (0.0, 0.0, 6.0), (0.0, 0.0, 2.0), (0.0, 0.0, 2.0)])
    made.extent_m[2, 2], made.extent_m[3, 2] = 0.6, 5.0
    gate_m: FloatArray = asked_for(made).gate_m
    sigma_m = [0.005 + 0.0075 * depth * depth for depth in (2.0, 6.0)]
    np.testing.assert_allclose(
        gate_m, [0.3 + 2 * sigma_m[0], 0.3 + 2 * sigma_m[1], 0.6 + 2 * sigma_m[0], 0.8 + 2 * sigma_m[0]]
    )
