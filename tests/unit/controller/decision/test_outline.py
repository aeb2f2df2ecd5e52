"""How far beside the way something stands, by its outline in depth: what is seen corner-on, beside a bend."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig, Margins
from config.robot import Body, Robot
from controller.decision.corridor import Corridor
from controller.decision.decision import Decision
from controller.decision.lateral_margin import LateralMargin
from controller.decision.limits import Motion
from controller.decision.outline import Outline, outline_of
from controller.decision.situation import Situation
from controller.decision.standing_limits import StandingLimits
from controller.decision.surfaces import Surfaces
from controller.decision.world_model import WorldModel
from controller.path.path import OnPath, Path
from hal.types import FloatArray, PlanarPose
from tests.support.decision_bench import MOUNT, STEP_NS, Bench, obstacle
from tests.support.floor_bodies import arc_path, box, line_path
from tests.support.scenes import free_space
from vision.scene import FreeSpace, Obstacle

# A square of 0.424 m, 3 m ahead, 1 m to the left, one side along the way: looking 45 degrees aside, a robot
# sees it as a box of 0.6 m.
SIDE_M = 0.3 * math.sqrt(2.0)
NEAR_X_M, NEAR_Y_M = 3.0 - 0.5 * SIDE_M, 1.0 - 0.5 * SIDE_M
EDGE = np.linspace(0.0, SIDE_M, 15)[:, None]
FRONT_FACE = np.array([NEAR_X_M, NEAR_Y_M]) + EDGE * [0.0, 1.0]
SIDE_FACE = np.array([NEAR_X_M, NEAR_Y_M]) + EDGE * [1.0, 0.0]
CORNER_ON = np.concatenate((FRONT_FACE[::-1], SIDE_FACE[1:]))
HALF_BAND_M = 0.01
BODY = Body(width_m=0.8, length_m=1.0, rear_m=0.5)


def outline(
    points_m: FloatArray, view_deg: float, first_band: int = 20, seen_m: FloatArray | None = None
) -> Outline:
    """Of the box seen in direction view_deg, beside a way of which the robot takes 0.4 m to either side."""
    one = replace(
        box(3.0, 1.0, half_view_m=0.3, half_across_m=0.3), view_rad=np.array([math.radians(view_deg)])
    )
    count = len(points_m)
    bands, half_band_m = np.arange(first_band, first_band + count), np.full(count, HALF_BAND_M)
    seen = Surfaces(
        np.full(80, 9.0) if seen_m is None else seen_m, bands, points_m[:, 0], half_band_m, points_m
    )
    corridor = Corridor(line_path(), BODY)
    return outline_of(one, 0, seen.of(one)[:, 0], seen, corridor, (0.0, 8.0), depth_m=0.3)


def test_the_side_that_is_seen_decides() -> None:
    """The box's corner would be 0.176 m from the corridor."""
    found = outline(CORNER_ON, 45.0)
    assert found.whole
    assert found.clearance_m == pytest.approx(NEAR_Y_M - 0.4 - HALF_BAND_M, abs=1e-9)


def test_behind_a_flat_face_the_body_goes_on() -> None:
    """A face across the view towards the way, on the near side of the box: 0.3 m behind it, along the view,
    the body may end."""
    behind_m = 0.3 * math.sin(math.radians(45.0))
    flat = np.array([NEAR_X_M - behind_m, NEAR_Y_M + behind_m]) + EDGE * [1.0, 1.0]
    assert outline(flat, -45.0).clearance_m == pytest.approx(NEAR_Y_M - 0.4 - HALF_BAND_M, abs=1e-9)


def test_an_outline_with_a_gap_is_not_whole() -> None:
    assert not outline(np.concatenate((CORNER_ON[:10], CORNER_ON[16:])), 45.0).whole
    front = outline(CORNER_ON[:12], 45.0)
    assert not front.whole
    assert front.clearance_m == pytest.approx(CORNER_ON[11, 1] - 0.4 - HALF_BAND_M)
    assert outline(CORNER_ON[:0], 45.0) == Outline(math.inf, whole=False)
    assert outline(np.add(CORNER_ON, (0.0, 1.5)), 45.0) == Outline(math.inf, whole=False)


def test_an_outline_behind_the_box_is_of_something_else() -> None:
    """What is too low for depth would begin 0.3 m before the middle of its box."""
    behind = np.array([0.14, 0.14])  # 0.2 m along the view
    assert not outline(CORNER_ON + behind, 45.0).whole
    assert outline(CORNER_ON + 0.5 * behind, 45.0).whole


def test_an_outline_that_may_go_on_outside_of_the_view_is_not_whole() -> None:
    assert not outline(CORNER_ON, 45.0, first_band=0).whole
    assert outline(CORNER_ON, 45.0, first_band=1).whole
    assert not outline(CORNER_ON, 45.0, first_band=80 - len(CORNER_ON)).whole


@pytest.mark.parametrize(
    ("beside", "whole"),
    [
        ([0.0, 0.0, 9.0], False),  # nothing was measured beside it
        ([0.0, 9.0, 9.0], True),  # but for the shadow of what stands nearer
        ([2.0, 9.0, 9.0], False),  # something nearer hides its end
        ([0.0, 2.0, 9.0], False),
        ([3.3, 3.3, 3.3], True),
    ],
)
@pytest.mark.parametrize("end", [-1, 1])
def test_beside_both_ends_something_farther_has_to_be_seen(
    beside: list[float], whole: bool, end: int
) -> None:
    seen_m = np.full(80, 9.0)
    edge = 20 if end < 0 else 20 + len(CORNER_ON) - 1
    seen_m[[edge + end, edge + 2 * end, edge + 3 * end]] = beside
    assert outline(CORNER_ON, 45.0, seen_m=seen_m).whole == whole


BEND = arc_path(4.0, 80.0)  # to the left
# Outside of the bend, corner-on to a robot that has not begun to turn.
CRATE_X_M, CRATE_Y_M, HALF_DIAGONAL_M = 2.9, -0.1, 0.4
TANGENTS = np.linspace(-0.66, 0.66, 80)
HALF_BAND = float(TANGENTS[1] - TANGENTS[0]) / 2.0


def crate(width_m: float = 2.0 * HALF_DIAGONAL_M, y_m: float = CRATE_Y_M) -> Obstacle:
    """Its box as the camera sees it: as deep as what is seen of it."""
    near = obstacle(CRATE_X_M - 0.5 * HALF_DIAGONAL_M, y_m, size_m=(width_m, 0.8))
    return replace(near, extent_m=np.array([width_m, 0.8, HALF_DIAGONAL_M]))


def depth(corner_on: bool) -> FreeSpace:
    """Of the crate, or of a box that fills its box."""
    space = free_space(bands=80)
    nearest_m = np.full(80, math.inf)
    for band, tangent in enumerate(TANGENTS.tolist()):
        x_m = np.linspace(0.5, 4.0, 3501)
        off_m = np.abs(-(x_m - MOUNT.forward_m) * tangent - CRATE_Y_M)
        front_m = CRATE_X_M - HALF_DIAGONAL_M + (off_m if corner_on else 0.0)
        hit = (off_m <= HALF_DIAGONAL_M) & (x_m >= front_m) & (x_m <= CRATE_X_M)
        if hit.any():
            nearest_m[band] = x_m[hit][0] - MOUNT.forward_m
    return FreeSpace(TANGENTS, HALF_BAND, nearest_m, np.minimum(nearest_m, space.known_m[0]))


def look(bench: Bench, one: Obstacle, seen: FreeSpace, path: Path = BEND) -> Decision:
    """At the beginning of the bend, for ten frames."""
    for _ in range(10):
        bench.now_ns += STEP_NS
        pose, on_path = PlanarPose(0.0, 0.0, 0.0), OnPath(0.0, 0.0, 0.0)
        decision = bench.maker.step(
            Situation(bench.scene(one, free=seen), path, pose, on_path, 0.4, 0.0, bench.now_ns)
        )
    return decision


@pytest.mark.parametrize(("beside_m", "blocks"), [(0.12, False), (0.04, True), (-0.02, True)])
def test_on_a_straight_path_depth_corrects_a_box_that_only_reaches_into_the_margin(
    beside_m: float, blocks: bool
) -> None:
    """A box 0.6 m wide and beside_m beside the swept width. Depth shows 6 cm less of it on both sides, as
    mixed pixels do: that is outside of the margin of 0.15 m, inside it, or not looked at."""
    middle_m = 0.5 * Body().width_m + beside_m + 0.3
    one = obstacle(3.0, middle_m, size_m=(0.6, 1.0))
    ahead_m = 3.0 - MOUNT.forward_m
    shown = np.abs(-TANGENTS * ahead_m - middle_m) < 0.24
    nearest_m = np.where(shown, ahead_m, math.inf)
    seen = FreeSpace(TANGENTS, HALF_BAND, nearest_m, np.minimum(nearest_m, 9.0))
    assert (look(Bench(), one, seen, line_path()).reason.rule == "static") == blocks


def test_a_crate_seen_corner_on_beside_a_bend_is_passed() -> None:
    assert look(Bench(), crate(), depth(corner_on=True)).reason.rule != "static"
    assert look(Bench(), crate(), depth(corner_on=False)).reason.rule == "static"


def cut(seen: FreeSpace) -> FreeSpace:
    """As if the view ended a little to the right of the crate's middle."""
    inside = seen.bearing_tan < 0.06
    arrays = (seen.bearing_tan, seen.nearest_m, seen.known_m)
    bearing, nearest, known = (array[inside] for array in arrays)
    return FreeSpace(bearing, seen.half_width_tan, nearest, known)


def test_body_seen_whole_is_passed_while_it_leaves_the_view() -> None:
    """What is left of it in view could be the edge of something larger."""
    part, seen = crate(HALF_DIAGONAL_M, CRATE_Y_M + 0.5 * HALF_DIAGONAL_M), depth(corner_on=True)
    bench = Bench()
    look(bench, crate(), seen)
    assert look(bench, part, cut(seen)).reason.rule != "static"
    assert look(Bench(), part, cut(seen)).reason.rule == "static"


def test_body_beside_a_band_without_depth_may_extend_into_it() -> None:
    """The same, where the image is wider than what depth is measured of."""
    part, seen = crate(HALF_DIAGONAL_M, CRATE_Y_M + 0.5 * HALF_DIAGONAL_M), cut(depth(corner_on=True))
    last = np.arange(len(seen.nearest_m)) >= len(seen.nearest_m) - 2
    nearest_m, known_m = np.where(last, math.inf, seen.nearest_m), np.where(last, 0.0, seen.known_m)
    blind = FreeSpace(seen.bearing_tan, seen.half_width_tan, nearest_m, known_m)
    assert look(Bench(), part, blind).reason.rule == "static"


def test_body_that_moved_meanwhile_has_to_be_seen_whole_again() -> None:
    """Nothing else stands there, so that no outline is taken while it goes."""
    part, seen = crate(HALF_DIAGONAL_M, CRATE_Y_M + 0.5 * HALF_DIAGONAL_M), depth(corner_on=True)
    bench = Bench()
    look(bench, crate(), seen)
    look(bench, replace(crate(), moving=True, velocity_mps=np.array([0.3, 0.0, 0.3])), seen)
    assert look(bench, part, cut(seen)).reason.rule == "static"


def test_robot_stops_for_a_part_that_shows_on_the_path_later() -> None:
    """The crate was the end of something longer, which goes on into the way."""
    part, seen = crate(HALF_DIAGONAL_M, CRATE_Y_M + 0.5 * HALF_DIAGONAL_M), depth(corner_on=True)
    bench = Bench()
    look(bench, crate(), seen)
    assert look(bench, part, cut(depth(corner_on=False))).reason.rule == "static"


def test_on_another_path_what_stands_is_placed_anew_without_a_new_scene() -> None:
    """As for a governor that gets another command between two frames; beside the line it is aside."""
    bench, path = Bench(), arc_path(3.0, 80.0)
    look(bench, obstacle(2.2, 1.0, size_m=(0.4, 0.8)), free_space(bands=80), line_path())
    before = bench.maker._known
    assert before is not None
    known = WorldModel(path, Robot(), MOUNT, DecisionConfig(), 0.0)
    known.take_over(before)
    assert known.surfaces is before.surfaces
    assert known.health is before.health
    assert known.view == before.view
    standing = StandingLimits(DecisionConfig(), Robot().limits, LateralMargin(Margins()))
    motion = Motion(0.4, 0.0, 0.2)
    assert standing.limits(before, 0.0, motion, 0.0) == []
    (limit,) = standing.limits(known, 0.0, motion, 0.0)
    assert limit.reason.rule == "static"


def test_outline_seen_along_one_path_does_not_count_for_another() -> None:
    part, seen = crate(HALF_DIAGONAL_M, CRATE_Y_M + 0.5 * HALF_DIAGONAL_M), depth(corner_on=True)
    bench = Bench()
    look(bench, crate(), seen)
    assert look(bench, part, cut(seen), arc_path(4.0, 81.0)).reason.rule == "static"
