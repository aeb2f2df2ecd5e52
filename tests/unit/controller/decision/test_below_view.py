"""Low bodies that sink below the view: kept until their place is seen, unless they go away themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.floor_bodies import box
from tests.support.recall import ALL_SEEN, Recall

PALLET = box(5.0, 0.0, top_m=0.15)
# It moves at 0.14 m/s with 0.1 m/s of noise.
HARDLY_MOVING = replace(
    box(1.0, 0.2, -0.1, -0.1, top_m=0.2), half_view_m=np.array([0.15]), half_across_m=np.array([0.2])
)


def test_a_low_pallet_sinks_below_the_view() -> None:
    recall = Recall()
    assert recall.see(PALLET, 3.2) == []
    assert recall.see(None, 3.6) == [1]
    assert recall.see(None, 3.8, standing=True) == [1]


def test_body_that_vanishes_while_the_robot_stands_is_dropped() -> None:
    recall = Recall()
    for _ in range(2):
        recall.see(PALLET, 3.6, standing=True)
    assert recall.see(None, 3.6, standing=True) == []


def test_body_that_the_stopping_robot_loses_from_view_is_not_forgotten_at_rest() -> None:
    """It was last seen before the stop; until it is given up as missing, perception predicts it."""
    recall = Recall()
    recall.see(PALLET, 3.2)
    for unseen_s in (0.1, 0.2, 0.3):
        predicted = replace(PALLET, unseen_s=np.array([unseen_s]))
        assert recall.see(predicted, 3.6, standing=unseen_s > 0.15) == []
    for _ in range(100):
        assert recall.see(None, 3.6, standing=True) == [1]


def test_body_too_low_for_the_near_view_may_still_be_there() -> None:
    recall, low = Recall(), replace(HARDLY_MOVING, velocity_mps=np.array([[-0.3, -0.3]]))
    recall.recall(low, 0.0, ALL_SEEN, standing=True)
    kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.97, 0.17])


def test_what_has_stopped_before_it_sinks_below_the_view_is_not_forgotten() -> None:
    """Still judged moving, as verdicts take some frames, and measured at 0.14 m/s with 0.1 m/s of noise."""
    recall = Recall()
    recall.recall(HARDLY_MOVING, 0.0, ALL_SEEN)
    for _ in range(100):  # for ten seconds
        kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.moving.tolist() == [False]
    assert kept.xy_m[0].tolist() == pytest.approx([1.0, 0.2])


@pytest.mark.parametrize(
    ("speed_mps", "sigma_mps", "tracked_s"), [(0.3, 0.4, 5.0), (0.14, 0.1, 0.2), (0.42, 0.1, 5.0)]
)
def test_what_may_still_move_is_not_taken_to_rest_below_the_view(
    speed_mps: float, sigma_mps: float, tracked_s: float
) -> None:
    """A foot at the lower edge, whose velocity is hardly known; a new track; and what surely moves."""
    recall = Recall()
    low = box(1.0, 0.2, 0.0, speed_mps, top_m=0.2, sigma_mps=sigma_mps)
    recall.recall(replace(low, tracked_s=np.array([tracked_s])), 0.0, ALL_SEEN)
    assert recall.recall(None, 0.0, ALL_SEEN).moving.tolist() == [True]
    for _ in range(100):  # for ten seconds
        kept = recall.see(None, 0.0, standing=True, free=ALL_SEEN)
    assert kept == []


def test_body_last_seen_in_the_first_scene_of_a_standstill_is_kept() -> None:
    """The robot may still have rolled when that scene was captured."""
    recall = Recall()
    recall.see(PALLET, 3.2)
    recall.see(PALLET, 3.6, standing=True)
    assert recall.see(None, 3.6, standing=True) == [1]
