"""Bodies out of view: kept while they are hidden, dropped when their place is seen again or was left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.decision.bodies import no_bodies
from controller.decision.out_of_view import OutOfView
from tests.support.floor_bodies import box
from tests.support.recall import ALL_SEEN, BANDS, FRAME_NS, NOTHING_SEEN, VIEW, Recall

PALLET = box(5.0, 0.0, top_m=0.15)


def test_tall_body_does_not_sink_below_the_view() -> None:
    recall = Recall()
    recall.see(box(5.0, 0.0, top_m=1.7), 3.2)
    assert recall.see(None, 3.6, free=ALL_SEEN) == []


def test_body_that_vanishes_far_away_is_dropped() -> None:
    recall = Recall()
    recall.see(PALLET, 1.0)
    assert recall.see(None, 1.1, free=ALL_SEEN) == []


def test_body_seen_too_briefly_is_not_kept() -> None:
    recall = Recall()
    recall.see(replace(PALLET, age_s=np.array([0.2])), 3.2)
    assert recall.see(None, 3.6) == []


def test_remembered_body_is_forgotten_once_it_is_passed() -> None:
    recall = Recall()
    recall.see(PALLET, 3.2)
    recall.see(None, 3.6)
    assert recall.see(None, 6.0) == [1]
    assert recall.see(None, 6.9) == []


def test_remembered_body_is_forgotten_when_its_place_is_seen_again() -> None:
    recall = Recall()
    recall.see(PALLET, 3.2)
    for _ in range(100):  # for ten seconds
        assert recall.see(None, 3.6) == [1]
    assert recall.see(None, 2.0, free=ALL_SEEN) == []


def test_body_that_is_seen_again_is_not_counted_twice() -> None:
    recall = Recall()
    recall.see(PALLET, 3.2)
    recall.see(None, 3.6)
    assert recall.see(PALLET, 3.4) == []


def test_feet_of_a_person_who_is_still_seen_are_no_body_of_their_own() -> None:
    person = box(5.0, 0.0, number=2, top_m=1.7)
    recall = Recall()
    recall.see(PALLET.joined(person), 3.2)
    assert recall.see(person, 3.6) == []


def test_standing_body_beside_the_view_is_kept() -> None:
    beside = box(5.0, 0.5, top_m=1.7)
    recall = Recall()
    recall.see(beside, 3.5)
    assert recall.see(None, 3.8) == [1]


def test_mover_out_of_view_is_extrapolated_for_two_seconds() -> None:
    recall = Recall()
    recall.see(box(5.0, 0.9, 0.0, -0.5), 3.5)
    assert recall.see(None, 3.7) == [1]
    assert recall.memory.update(
        recall.before,
        replace(no_bodies(0), captured_ns=recall.now_ns),
        replace(VIEW, x_m=3.7),
        False,
        NOTHING_SEEN,
    ).xy_m[0].tolist() == pytest.approx([5.0, 0.85])
    # By dead reckoning it walks back into view after a while, and is not there.
    remembered = [recall.see(None, 4.4) for _ in range(25)]
    assert remembered[0] == [1]
    assert remembered[-1] == []


def test_mover_that_left_the_view_towards_the_path_is_kept_longer() -> None:
    """Beside the view's edge, walking slowly towards the path: for more than the 2 s of who walks away."""
    recall = Recall()
    recall.see(box(2.0, 2.5, 0.0, -0.3), 0.0)
    for _ in range(40):
        kept = recall.see(None, 0.0, standing=True)
    assert kept == [1]
    for _ in range(25):
        kept = recall.see(None, 0.0, standing=True)
    assert kept == []


def test_mover_that_walks_away_is_not_kept_longer() -> None:
    recall = Recall()
    recall.see(box(2.0, 2.5, 0.0, 0.3), 0.0)
    for _ in range(19):
        assert recall.see(None, 0.0) == [1]
    for _ in range(2):
        kept = recall.see(None, 0.0)
    assert kept == []


@pytest.mark.parametrize(("aside_mps", "kept"), [(0.1, [1]), (0.2, []), (0.35, [])])
def test_mover_that_leaves_aslant_is_not_kept_longer(aside_mps: float, kept: list[int]) -> None:
    """After 4 s: who goes almost along the path could still cut in."""
    recall = Recall()
    recall.see(box(2.0, 2.5, 0.5, aside_mps), 0.0)
    for _ in range(40):
        found = recall.see(None, 0.0)
    assert found == kept


def test_how_long_it_was_not_seen_is_counted() -> None:
    memory, before = OutOfView(1.5), box(2.0, 2.5, 0.0, -0.3)
    seen = replace(no_bodies(0), captured_ns=FRAME_NS)
    kept = memory.update(before, seen, VIEW, False, NOTHING_SEEN)
    assert kept.unseen_s.tolist() == pytest.approx([0.1])


def test_at_the_edge_of_the_view_nobody_is_missed() -> None:
    """Predicted 10 cm inside the edge: it may as well be outside."""
    recall = Recall()
    recall.see(box(2.4, 1.0 - 0.1, 0.01, -0.01), 0.0)
    assert recall.see(None, 0.0) == [1]


# Half a metre ahead of the nose, measured as creeping back in though it walks out; 0.3 m deep, 0.4 m wide.
LEAVING = replace(
    box(1.0, 0.2, -0.1, -0.1, top_m=1.7), half_view_m=np.array([0.15]), half_across_m=np.array([0.2])
)


def test_mover_whose_place_is_seen_free_is_pushed_beside_the_view() -> None:
    """Its inner side beside the view, as far ahead as its back: 0.74 m from the camera, 0.5 to the side."""
    recall = Recall()
    recall.recall(LEAVING, 0.0, ALL_SEEN, standing=True)
    kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.99, 0.5 * 0.74 + 0.2])
    assert kept.velocity_mps[0].tolist() == [0.0, 0.0]
    assert kept.unseen_s.tolist() == [0.0]


def test_on_the_right_as_on_the_left() -> None:
    recall = Recall()
    mirrored = replace(LEAVING, xy_m=LEAVING.xy_m * (1, -1), velocity_mps=LEAVING.velocity_mps * (1, -1))
    recall.recall(mirrored, 0.0, ALL_SEEN, standing=True)
    kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.99, -0.5 * 0.74 - 0.2])


def test_outwards_it_goes_on() -> None:
    recall = Recall()
    outwards = replace(LEAVING, velocity_mps=np.array([[-0.1, 0.3]]))
    recall.recall(outwards, 0.0, ALL_SEEN, standing=True)
    kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.99, 0.5 * 0.74 + 0.2])
    assert kept.velocity_mps[0].tolist() == pytest.approx([-0.1, 0.3])


@pytest.mark.parametrize(("sigma_mps", "along_mps"), [(0.1, 0.4), (0.5, 0.0)])
def test_along_the_way_it_goes_on_if_that_is_known(sigma_mps: float, along_mps: float) -> None:
    recall = Recall()
    along = replace(LEAVING, velocity_mps=np.array([[0.4, -0.05]]), covariance=np.eye(2)[None] * sigma_mps**2)
    recall.recall(along, 0.0, ALL_SEEN, standing=True)
    kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.velocity_mps[0].tolist() == pytest.approx([along_mps, 0.0])


def test_approaching_mover_may_be_a_little_late() -> None:
    """At 0.8 m/s, and for 0.3 m and a little more it may only be late; then it has not come."""
    recall = Recall()
    coming = replace(LEAVING, xy_m=np.array([[1.0, 0.65]]), velocity_mps=np.array([[0.0, -0.8]]))
    recall.recall(coming, 0.0, ALL_SEEN, standing=True)
    for _ in range(4):
        kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([1.0, 0.33])
    assert kept.velocity_mps[0].tolist() == pytest.approx([0.0, -0.8])
    for _ in range(3):
        kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([1.0, 0.5 * 0.75 + 0.2])
    assert kept.velocity_mps[0].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("speed_mps", [0.8, 1.3])
def test_unseen_body_is_not_assumed_to_have_passed_before_the_robot(speed_mps: float) -> None:
    """Long unseen, it may be late by more than the view is wide there: it stays this side of the middle."""
    recall = Recall()
    far = replace(
        LEAVING, xy_m=np.array([[1.0, 3.5 * speed_mps]]), velocity_mps=np.array([[0.0, -speed_mps]])
    )
    recall.recall(far, 0.0, ALL_SEEN)
    for _ in range(45):
        kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.ids.tolist() == [1]
    assert kept.xy_m[0].tolist() == pytest.approx([1.0, 0.1])
    assert kept.velocity_mps[0].tolist() == pytest.approx([0.0, -speed_mps])


@pytest.mark.parametrize(("sigma_mps", "y_m"), [(0.05, 0.34), (0.15, 0.5 * 0.74 + 0.2)])
def test_only_who_clearly_comes_may_be_late(sigma_mps: float, y_m: float) -> None:
    """At 0.1 m/s, known to so much."""
    recall = Recall()
    near_edge = replace(LEAVING, xy_m=np.array([[1.0, 0.35]]), covariance=np.eye(2)[None] * sigma_mps**2)
    recall.recall(near_edge, 0.0, ALL_SEEN, standing=True)
    kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.99, y_m])


@pytest.mark.parametrize("known_m", [0.5, float("nan")])
def test_body_may_still_be_where_nothing_was_seen(known_m: float) -> None:
    """Not through the whole of where it was expected, or not known how far."""
    recall = Recall()
    free = replace(ALL_SEEN, known_m=np.full(20, known_m))
    recall.recall(LEAVING, 0.0, free, standing=True)
    kept = recall.recall(None, 0.0, free, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.99, 0.19])
    assert kept.velocity_mps[0].tolist() == pytest.approx([-0.1, -0.1])
    assert kept.unseen_s.tolist() == pytest.approx([0.1])


def test_body_is_excluded_only_where_the_view_is_seen_through_without_a_gap() -> None:
    recall = Recall()
    gap = np.where(BANDS < -0.35, 0.0, 8.0)
    free = replace(ALL_SEEN, known_m=gap)
    recall.recall(replace(LEAVING, xy_m=np.array([[1.0, 0.1]])), 0.0, free, standing=True)
    kept = recall.recall(None, 0.0, free, standing=True)
    assert kept.xy_m[0].tolist() == pytest.approx([0.99, 0.35 * 0.74 + 0.2])


def test_the_longer_it_is_unseen_beside_the_view_the_less_is_known_of_its_velocity() -> None:
    recall = Recall()
    recall.recall(LEAVING, 0.0, ALL_SEEN, standing=True)
    for _ in range(16):
        kept = recall.recall(None, 0.0, ALL_SEEN, standing=True)
    assert np.diagonal(kept.covariance[0]).tolist() == pytest.approx([0.16, 0.16])
