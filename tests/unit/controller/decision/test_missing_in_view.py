"""Bodies that go missing in the middle of the view: kept until their place is seen, if they surely stood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.floor_bodies import box
from tests.support.recall import ALL_SEEN, BANDS, NOTHING_SEEN, Recall
from vision.scene import FreeSpace


def seen_to(nearest_m: float, known_m: float) -> FreeSpace:
    return FreeSpace(BANDS, 0.025, np.full(20, nearest_m), np.full(20, known_m))


@pytest.mark.parametrize(
    ("free", "kept"),
    [
        (NOTHING_SEEN, [1]),
        (seen_to(1.0, 1.0), [1]),
        (seen_to(np.inf, 3.5), [1]),
        (seen_to(3.5, 3.4), []),
        (seen_to(7.0, 6.9), []),
        (ALL_SEEN, []),
    ],
    ids=[
        "no depth",
        "something nearer",
        "floor in part",
        "a surface there",
        "a surface behind",
        "free floor",
    ],
)
def test_standing_body_missed_in_the_view_is_kept_until_its_place_is_seen(
    free: FreeSpace, kept: list[int]
) -> None:
    """3.6 m ahead of the camera, as thin as a fork of a pallet jack."""
    recall = Recall()
    recall.see(box(5.0, 0.0, top_m=0.08, half_across_m=0.04), 1.0)
    for _ in range(30):
        assert recall.see(None, 1.0 + 1e-3, free=free) == kept


@pytest.mark.parametrize(
    ("seen_s", "measured_mps", "kept"),
    [(1.1, 0.2, [1]), (0.9, 0.2, []), (1.1, 0.4, [])],
    ids=["stood", "seen for a moment only", "measured as moving"],
)
def test_body_that_did_not_surely_stand_is_not_kept_in_the_view(
    seen_s: float, measured_mps: float, kept: list[int]
) -> None:
    """A limb of somebody who walks by is judged standing for a moment."""
    recall, fork = Recall(), box(5.0, 0.0, top_m=0.08, half_across_m=0.04, age_s=seen_s)
    recall.see(replace(fork, measured_mps=np.array([[0.0, measured_mps]])), 1.0)
    assert recall.see(None, 1.0 + 1e-3) == kept


def test_distant_missing_body_does_not_count() -> None:
    recall = Recall()
    recall.see(box(8.0, 0.0), 1.0)
    assert recall.see(None, 1.1) == []
