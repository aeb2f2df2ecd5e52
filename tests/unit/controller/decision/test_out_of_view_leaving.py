"""Who leaves the view without a verdict, and who comes into it where somebody else was expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.robot import Limits, Robot
from controller.decision.bodies import Bodies, no_bodies
from controller.decision.leaving_movers import LeavingMovers
from controller.decision.out_of_view import OutOfView
from controller.decision.view_edges import view_from
from controller.decision.world_model import WorldModel
from controller.path.path import OnPath
from hal.types import CameraMount, PlanarPose
from tests.support.decision_bench import MOUNT, PATH, obstacle
from tests.support.floor_bodies import box
from tests.support.scenes import GOOD, STILL, free_space
from vision.scene import FreeSpace, Scene

EDGE = 0.5
HERE = PlanarPose(0.0, 0.0, 0.0)
VIEW = view_from(HERE, CameraMount(0.4, 0.0, 0.60, 0.0), EDGE, near_m=1.3, up_tan=np.inf)
FRAME_NS = 100_000_000
NOTHING_SEEN = FreeSpace(np.zeros(1), EDGE, np.full(1, np.inf), np.zeros(1))
# On the left edge of the view, 4 m ahead of the camera.
AT_EDGE = box(4.4, 2.1, sigma_mps=0.1)


def new_memory(max_obstacle_speed_mps: float = 1.5) -> OutOfView:
    return OutOfView(max_obstacle_speed_mps)


def measured(bodies: Bodies, left_mps: float, unseen_s: float = 0.0) -> Bodies:
    """Standing by the verdict, whatever was measured."""
    return replace(bodies, measured_mps=np.array([[0.05, left_mps]]), unseen_s=np.array([unseen_s]))


def expected(bodies: Bodies, left_mps: float = 0.0) -> Bodies:
    """No longer seen: what perception says of it now is no measurement."""
    return measured(bodies, left_mps, unseen_s=0.1)


def after(*scenes: Bodies) -> Bodies:
    """The bodies of the last of some scenes."""
    leaving = LeavingMovers()
    return [leaving.marked(scene, VIEW) for scene in scenes][-1]


def test_approaching_body_that_leaves_the_view_counts_as_moving() -> None:
    """A verdict takes some frames, of which there are no more."""
    found = after(measured(AT_EDGE, -0.4), expected(AT_EDGE), expected(AT_EDGE))
    assert found.moving.tolist() == [True]
    assert found.velocity_mps[0].tolist() == [0.05, -0.4]
    # It has just set off, and may reach a walking speed.
    assert np.hypot(*(found.velocity_mps + found.innovation_mps)[0]) == pytest.approx(1.2)


def test_on_the_right_as_on_the_left() -> None:
    mirrored = replace(AT_EDGE, xy_m=AT_EDGE.xy_m * (1, -1))
    assert after(measured(mirrored, 0.4), expected(mirrored)).moving.tolist() == [True]


def narrow(bodies: Bodies) -> Bodies:
    """What is still in view of somebody at its edge."""
    return replace(bodies, half_across_m=np.array([0.03]))


def test_leaving_body_that_was_never_wider_than_a_strip_is_not_moving() -> None:
    coming = measured(narrow(AT_EDGE), -0.4)
    assert after(coming, expected(narrow(AT_EDGE))).moving.tolist() == [False]
    assert after(AT_EDGE, coming, expected(narrow(AT_EDGE))).moving.tolist() == [True]


AHEAD, YOUNG = box(4.4, 0.5), box(4.4, 2.1, sigma_mps=0.1, age_s=0.4)
KNOWN = replace(AT_EDGE, tracked_s=np.array([0.4]))
EXACT = replace(AT_EDGE, covariance=np.zeros((1, 2, 2)))
CRATE, RACK = box(4.4, 2.1, sigma_mps=0.1, top_m=1.1), box(4.4, 2.1, sigma_mps=0.1, top_m=2.3)
EXACT_CRATE = replace(CRATE, covariance=np.zeros((1, 2, 2)))


def later(bodies: Bodies, frames: int) -> Bodies:
    return replace(bodies, captured_ns=frames * FRAME_NS)


@pytest.mark.parametrize(
    "scenes",
    [
        pytest.param((measured(AT_EDGE, -0.24), expected(AT_EDGE)), id="noise may be as much"),
        pytest.param((measured(CRATE, -0.32), expected(CRATE)), id="noise of a crate may be as much"),
        pytest.param((measured(RACK, -0.32), expected(RACK)), id="noise of a rack may be as much"),
        pytest.param((measured(EXACT, -0.14), expected(EXACT)), id="hardly moves"),
        pytest.param((measured(EXACT_CRATE, -0.19), expected(EXACT_CRATE)), id="a crate hardly moves"),
        pytest.param((measured(AT_EDGE, 0.4), expected(AT_EDGE)), id="walks away"),
        pytest.param((measured(AT_EDGE, -0.4),), id="is still seen"),
        pytest.param((measured(AHEAD, -0.4), expected(AHEAD)), id="only missed in the middle of the view"),
        pytest.param((measured(YOUNG, -0.4), expected(YOUNG)), id="was hardly seen"),
        pytest.param((measured(KNOWN, -0.4), expected(KNOWN)), id="only its place was seen for long"),
        pytest.param((measured(AT_EDGE, 0.0), expected(AT_EDGE, -0.4)), id="what is not seen proves nothing"),
        pytest.param(
            (measured(AT_EDGE, -0.4), later(measured(AT_EDGE, 0.0), 3), later(expected(AT_EDGE), 4)),
            id="stood for long enough before it was seen last",
        ),
        pytest.param(
            (measured(RACK, -0.4), later(measured(RACK, 0.0), 1), later(expected(RACK), 2)),
            id="a rack that stood when it was seen last",
        ),
    ],
)
def test_all_others_stay_what_perception_says(scenes: tuple[Bodies, ...]) -> None:
    found = after(*scenes)
    assert found.moving.tolist() == [False]
    assert found.velocity_mps[0].tolist() == [0.0, 0.0]


def test_body_as_tall_as_a_person_sets_off_sooner_than_a_crate_or_a_rack() -> None:
    """Noise makes many things beside the view seem to creep, but few of them are as tall."""
    for body, least_mps in ((AT_EDGE, 0.26), (CRATE, 0.34), (RACK, 0.34), (EXACT, 0.16), (EXACT_CRATE, 0.21)):
        assert after(measured(body, -least_mps), expected(body)).moving.tolist() == [True]


def test_one_more_measurement_does_not_stop_a_body_that_has_just_set_off() -> None:
    """At the edge of the view there is little left of him to be measured."""
    creeps = later(measured(AT_EDGE, -0.1), 2)
    found = after(measured(AT_EDGE, -0.4), creeps, later(expected(AT_EDGE), 3), later(expected(AT_EDGE), 9))
    assert found.moving.tolist() == [True]
    assert found.velocity_mps[0].tolist() == [0.05, -0.4]


def test_mover_that_leaves_the_view_keeps_its_averaged_velocity() -> None:
    walker = replace(box(4.4, 2.1, 0.0, -0.5), measured_mps=np.array([[0.0, -0.9]]), unseen_s=np.array([0.1]))
    second = replace(AT_EDGE, ids=np.array([2]))
    found = after(walker.joined(measured(second, -0.4)), walker.joined(expected(second)))
    assert found.velocity_mps.tolist() == [[0.0, -0.5], [0.05, -0.4]]


def kept_beside(newcomer: Bodies, remembered: Bodies) -> list[int]:
    """The ids of who is still reckoned with, after a newcomer came into view where it was expected."""
    memory = new_memory()
    memory.update(remembered, no_bodies(FRAME_NS), VIEW, True, NOTHING_SEEN)
    newcomer = replace(newcomer, captured_ns=2 * FRAME_NS)
    kept = memory.update(no_bodies(FRAME_NS), newcomer, VIEW, True, NOTHING_SEEN)
    return [int(one) for one in kept.ids]


EXPECTED = box(2.5, 1.2, 0.0, -0.5, sigma_mps=0.1)


def test_body_seen_with_the_expected_velocity_replaces_the_expected_one() -> None:
    assert kept_beside(box(2.5, 1.1, 0.0, -0.7, number=2, age_s=0.6), EXPECTED) == []


@pytest.mark.parametrize(
    "newcomer",
    [
        pytest.param(box(2.5, 1.1, 0.0, -1.0, number=2, age_s=0.6), id="goes twice as fast"),
        pytest.param(box(2.5, 1.1, 0.4, -0.5, number=2, age_s=0.6), id="goes elsewhere"),
        pytest.param(box(2.5, 1.1, number=2), id="stands"),
        pytest.param(box(2.5, 1.1, 0.0, -0.5, number=2, age_s=0.5), id="too young to tell"),
        pytest.param(
            replace(box(2.5, 1.1, 0.0, -0.5, number=2), tracked_s=np.array([0.4])),
            id="only its place was seen for long",
        ),
    ],
)
def test_another_body_in_its_place_does_not_erase_a_remembered_one(newcomer: Bodies) -> None:
    """Two walk one behind the other: when one of them is seen again, the other is still there."""
    assert kept_beside(newcomer, EXPECTED) == [1]


def test_standing_body_is_replaced_by_any_body_seen_in_its_place() -> None:
    assert kept_beside(box(2.5, 1.1, 0.0, -1.0, number=2), box(2.5, 1.2)) == []


@pytest.mark.parametrize(
    ("left_mps", "age_s", "kept_s"), [(0.6, 0.9, 2.0), (0.4, 0.9, 60.0), (0.6, 1.1, 60.0)]
)
def test_body_that_certainly_moved_is_not_kept_as_standing(
    left_mps: float, age_s: float, kept_s: float
) -> None:
    """Before the nose, below the view: what stands there is waited for. 6 sigmas of velocity are no noise, 4
    may be; and after a second the verdict knows better."""
    memory, pallet = new_memory(), box(1.6, 0.1, top_m=0.1, sigma_mps=0.1, age_s=age_s)
    before, kept = measured(pallet, left_mps), []
    for number in range(1, round(kept_s * 10) + 3):
        seen = replace(no_bodies(0), captured_ns=number * FRAME_NS)
        kept.append(len(memory.update(before, seen, VIEW, number > 1, NOTHING_SEEN)))
        before = seen
    assert kept[: round(kept_s * 10) - 1] == [1] * (round(kept_s * 10) - 1)
    assert kept[-1] == (0 if kept_s == 2.0 else 1)


def out_of_view_after(seconds: float, left_mps: float, sigma_mps: float, fastest_mps: float = 1.5) -> Bodies:
    """Of what was measured so below the view, standing by the verdict; fastest_mps: the greatest speed of any
    obstacle."""
    memory, pallet = new_memory(fastest_mps), box(1.6, 0.1, top_m=0.1, sigma_mps=sigma_mps, age_s=0.9)
    before = measured(pallet, left_mps)
    for number in range(1, round(seconds * 10) + 1):
        seen = replace(no_bodies(0), captured_ns=number * FRAME_NS)
        found = memory.update(before, seen, VIEW, number > 1, NOTHING_SEEN)
        before = seen
    return found


def test_body_that_certainly_moved_goes_on_with_its_measured_velocity() -> None:
    found = out_of_view_after(0.5, left_mps=0.6, sigma_mps=0.1)
    assert found.velocity_mps[0].tolist() == [0.05, 0.6]
    assert found.xy_m[0].tolist() == pytest.approx([1.6 + 0.025, 0.1 + 0.3])


@pytest.mark.parametrize(
    ("left_mps", "age_s", "kept"), [(0.6, 0.6, True), (0.4, 0.6, False), (0.6, 0.4, False), (0.6, 1.1, False)]
)
def test_body_that_certainly_moved_goes_on_though_the_robot_stands(
    left_mps: float, age_s: float, kept: bool
) -> None:
    """What stands and vanishes then has gone by itself; who was going is somewhere."""
    pallet = measured(box(1.6, 0.1, top_m=0.1, sigma_mps=0.1, age_s=age_s), left_mps)
    memory = new_memory()
    memory.update(no_bodies(-2 * FRAME_NS), no_bodies(-FRAME_NS), VIEW, True, NOTHING_SEEN)
    memory.update(no_bodies(-FRAME_NS), pallet, VIEW, True, NOTHING_SEEN)
    found = memory.update(pallet, no_bodies(FRAME_NS), VIEW, True, NOTHING_SEEN)
    assert found.moving.tolist() == [True] * kept


@pytest.mark.parametrize(("fastest_mps", "left_mps"), [(1.5, 2.4), (1.0, 1.6), (2.5, 4.0)])
def test_however_certainly_nobody_goes_as_fast_as_a_mistake(fastest_mps: float, left_mps: float) -> None:
    """Which is 1.6 times as fast as any obstacle."""
    for measured_mps, goes in ((left_mps - 0.1, True), (left_mps + 0.1, False)):
        found = out_of_view_after(0.5, measured_mps, sigma_mps=0.1, fastest_mps=fastest_mps)
        assert found.moving.tolist() == [goes]


@pytest.mark.parametrize(("fastest_mps", "goes"), [(1.5, True), (1.0, False)])
def test_how_fast_any_obstacle_is_the_robots_limits_say(fastest_mps: float, goes: bool) -> None:
    """Of a pallet that sinks below the view while it is measured at 2 m/s, standing by the verdict."""
    robot = Robot(limits=Limits(max_obstacle_speed_mps=fastest_mps))
    known = WorldModel(PATH, robot, MOUNT, DecisionConfig(), 0.0)
    sinking = replace(
        obstacle(1.6, 0.1, size_m=(0.5, 0.1), age_s=0.9), velocity_mps=np.array([-2.0, 0.0, 0.0])
    )
    for number, seen in enumerate([(sinking,), ()]):
        scene = Scene(number * FRAME_NS, number, seen, free_space(), STILL, GOOD, HERE)
        known.update(scene, HERE, OnPath(0.0, 0.0, 0.0), 1.0, number * FRAME_NS)
    assert known.remembered.tolist() == [True]
    assert known.bodies.moving.tolist() == [goes]


def test_new_track_where_something_stood_needs_its_own_time_of_measurement() -> None:
    pallet = measured(box(1.6, 0.1, top_m=0.1, sigma_mps=0.1, age_s=0.6), 0.6)
    renumbered = replace(pallet, tracked_s=np.array([0.4]))
    for before, goes in ((pallet, True), (renumbered, False)):
        seen = replace(no_bodies(0), captured_ns=FRAME_NS)
        found = new_memory().update(before, seen, VIEW, False, NOTHING_SEEN)
        assert found.moving.tolist() == [goes]


def test_however_certainly_hardly_any_speed_is_no_going() -> None:
    assert out_of_view_after(0.5, left_mps=0.18, sigma_mps=0.02).moving.tolist() == [False]
    assert out_of_view_after(0.5, left_mps=0.22, sigma_mps=0.02).moving.tolist() == [True]
