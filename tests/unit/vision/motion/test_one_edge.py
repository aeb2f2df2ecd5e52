"""Fragments on one straight edge: their ends may slide along it, so they tell the motion across it only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.point_motion import static_miss
from vision.motion import one_edge
from vision.motion.least_squares import BodyVelocities, body_velocities, fragment_velocities
from vision.motion.velocities import EndResiduals

FOCAL_PX = 500.0
LAG_S = 0.25
PX_M = 4.0 / FOCAL_PX  # one pixel, 4 m away
HORIZONTAL = np.stack((np.linspace(-0.5, 0.5, 6), np.zeros(6)), axis=1)


def ends_4m_away(at_m: FloatArray, went_m: FloatArray) -> EndResiduals:
    """Ends at (N, 2) right and down that went (N, 2) in 0.25 s, known to 4 mm."""
    count = len(at_m)
    static = np.column_stack((at_m, np.full(count, 4.0)))
    ray = (at_m + went_m) / 4.0
    return EndResiduals(
        static_m=static,
        ray=ray,
        lag_s=np.full(count, LAG_S),
        residual_m=static_miss(static, ray),
        covariance=np.tile([16e-6, 0.0, 16e-6], (count, 1)),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, np.nan),
        depth_step_sigma_m=np.full(count, 0.05),
        depth_lag_s=np.full(count, LAG_S),
        static_chi2=np.square(went_m).sum(axis=1) / 16e-6,
        usable=np.ones(count, np.bool_),
    )


def before_and_after(at_m: FloatArray, went_m: FloatArray) -> tuple[BodyVelocities, BodyVelocities]:
    """Of one body with these ends."""
    motion, owner = ends_4m_away(at_m, np.broadcast_to(went_m, at_m.shape)), np.zeros(len(at_m), np.intp)
    per_end = fragment_velocities(motion, 1.5).per_end
    body = body_velocities(motion, per_end, owner, 1, np.zeros((1, 3)), 1.5)
    return body, one_edge.without_way_along(body, motion, owner, FOCAL_PX)


def sigma_mps(body: BodyVelocities, direction: tuple[float, float, float]) -> float:
    return float(np.sqrt(direction @ body.covariance[0] @ np.array(direction)))


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, 135.0])
def test_ends_that_slide_along_their_edge_tell_nothing(angle_deg: float) -> None:
    """All six agree on 0.4 m/s along the edge, and contradict standing still."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    edge = HORIZONTAL @ np.array([[c, s], [-s, c]])
    before, after = before_and_after(edge, np.array([0.1 * c, 0.1 * s]))
    assert before.agreement[0] == before.contradicts_static[0] == 1.0
    assert after.contradicts_static == 0.0
    assert sigma_mps(before, (c, s, 0.0)) < 0.1
    assert sigma_mps(after, (c, s, 0.0)) == pytest.approx(3.0, rel=0.05)
    assert sigma_mps(after, (0.0, 0.0, 1.0)) == pytest.approx(3.0, rel=0.2)
    # Across it they are as precise as before.
    across = (-s, c, 0.0)
    assert sigma_mps(after, across) == pytest.approx(sigma_mps(before, across), rel=0.01)
    np.testing.assert_array_equal(after.velocity_mps, before.velocity_mps)


def test_motion_across_the_edge_contradicts_standing_still() -> None:
    _, after = before_and_after(HORIZONTAL, np.array([0.0, 0.1]))
    assert after.contradicts_static == 1.0
    assert sigma_mps(after, (0.0, 1.0, 0.0)) < 0.1


def test_the_doubt_about_their_depth_is_part_of_it() -> None:
    """As far across the edge as one sigma of depth takes them, the ends do not contradict standing still."""
    motion = ends_4m_away(HORIZONTAL, np.tile([0.0, 0.1], (6, 1)))
    body = body_velocities(
        motion, fragment_velocities(motion, 1.5).per_end, np.zeros(6, np.intp), 1, np.zeros((1, 3)), 1.5
    )
    unsure = replace(motion, depth_effect=np.tile([0.0, 0.1], (6, 1)))
    after = one_edge.without_way_along(body, unsure, np.zeros(6, np.intp), FOCAL_PX)
    assert after.contradicts_static == 0.0


@pytest.mark.parametrize(("apart_px", "one_edge_only"), [(3.0, True), (6.0, False)])
def test_two_sides_of_a_pole_are_two_edges(apart_px: float, one_edge_only: bool) -> None:
    """Their ends lie half of that from the middle."""
    sides = HORIZONTAL + np.array([[0.0, 0.5], [0.0, -0.5]] * 3) * apart_px * PX_M
    before, after = before_and_after(sides, np.array([0.1, 0.0]))
    assert (after is not before) == one_edge_only


def test_ends_close_to_each_other_are_no_edge() -> None:
    """A spot of 6 by 3 px."""
    spot = np.array([[-3.0, 1.5], [3.0, -1.5], [-3.0, -1.5], [3.0, 1.5]]) * PX_M
    before, after = before_and_after(spot, np.array([0.1, 0.0]))
    assert after is before


def test_a_single_fragment_is_left_to_others() -> None:
    before, after = before_and_after(HORIZONTAL[:2], np.array([0.1, 0.0]))
    assert after is before


def test_ends_that_disagree_do_not_hide_an_edge() -> None:
    """A seventh end, elsewhere, stands still. It counts among those that do not contradict."""
    at_m = np.concatenate((HORIZONTAL, [[0.0, -0.6]]))
    went_m = np.concatenate((np.tile([0.1, 0.0], (6, 1)), [[0.0, 0.0]]))
    before, after = before_and_after(at_m, went_m)
    assert before.agreement == pytest.approx(6 / 7)
    assert after.contradicts_static == 0.0
    went_m[:6] = [0.0, 0.1]
    _, after = before_and_after(at_m, went_m)
    assert after.contradicts_static == pytest.approx(6 / 7)


def test_ends_off_the_edge_contradict_as_before() -> None:
    """Two limbs beside a seam: they swing along it, but they are not on it."""
    at_m = np.concatenate((HORIZONTAL, [[-0.3, 0.6], [0.3, 0.6]]))
    went_m = np.concatenate((np.tile([0.1, 0.0], (6, 1)), np.tile([0.14, 0.0], (2, 1))))
    before, after = before_and_after(at_m, went_m)
    assert before.agreement == pytest.approx(6 / 8)
    assert after.contradicts_static == pytest.approx(2 / 8)


@pytest.mark.parametrize(("chi2_far", "contradicts"), [(13.0, 0.0), (14.0, 1.0)])
def test_what_did_not_contradict_before_does_not_now(chi2_far: float, contradicts: float) -> None:
    """Across the edge by 25 sigmas of the near surface, but of static_chi2 the far one says so."""
    motion = replace(ends_4m_away(HORIZONTAL, np.tile([0.0, 0.1], (6, 1))), static_chi2=np.full(6, chi2_far))
    owner = np.zeros(6, np.intp)
    body = body_velocities(motion, fragment_velocities(motion, 1.5).per_end, owner, 1, np.zeros((1, 3)), 1.5)
    assert one_edge.without_way_along(body, motion, owner, FOCAL_PX).contradicts_static == contradicts


@pytest.mark.parametrize(("across_px", "contradicts"), [(3.2, 0.0), (3.4, 1.0)])
@pytest.mark.parametrize("angle_deg", [30.0, -50.0])
def test_an_aslant_edge_beside_the_centre_known_better_across_than_along(
    angle_deg: float, across_px: float, contradicts: float
) -> None:
    """One pixel across the edge and ten along it: 3.29 sigmas across are 10.8 of chi-square."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    edge = HORIZONTAL @ np.array([[c, s], [-s, c]]) + [1.5, 0.8]
    motion = ends_4m_away(edge, np.tile(np.array([-s, c]) * across_px * PX_M, (6, 1)))
    along, across = (10.0 * PX_M) ** 2, PX_M**2
    entries = [c * c * along + s * s * across, c * s * (along - across), s * s * along + c * c * across]
    motion = replace(motion, covariance=np.tile(entries, (6, 1)))
    owner = np.zeros(6, np.intp)
    body = body_velocities(motion, fragment_velocities(motion, 1.5).per_end, owner, 1, np.zeros((1, 3)), 1.5)
    after = one_edge.without_way_along(body, motion, owner, FOCAL_PX)
    assert after.contradicts_static == contradicts
    sight = np.array([1.5, 0.8, 4.0]) / np.linalg.norm([1.5, 0.8, 4.0])
    added = after.covariance[0] - body.covariance[0]
    # 3 m/s each along the sight and along the edge, whose directions are not quite at right angles.
    assert np.trace(added) == pytest.approx(2 * 3.0**2, rel=1e-3)
    assert sight @ added @ sight >= 3.0**2
    normal = np.cross(sight, [c, s, 0.0])
    assert normal @ added @ normal == pytest.approx(0.0, abs=1e-3)


def test_other_bodies_and_ends_of_none_are_left_alone() -> None:
    """Beside a body on one edge: one with corners, and an edge that belongs to no body."""
    corners = np.array([[1.0, -0.3], [1.4, 0.3], [1.0, 0.3], [1.4, -0.3]])
    at_m = np.concatenate((HORIZONTAL, corners, HORIZONTAL - 1.0))
    motion = ends_4m_away(at_m, np.tile([0.1, 0.0], (len(at_m), 1)))
    owner = np.array([0] * 6 + [1] * 4 + [-1] * 6)
    before = body_velocities(
        motion, fragment_velocities(motion, 1.5).per_end, owner, 2, np.zeros((2, 3)), 1.5
    )
    after = one_edge.without_way_along(before, motion, owner, FOCAL_PX)
    np.testing.assert_array_equal(after.covariance[1], before.covariance[1])
    np.testing.assert_array_equal(after.contradicts_static, [0.0, 1.0])


def test_ends_that_are_not_usable_say_nothing() -> None:
    """Two of them would bend the edge."""
    at_m = np.concatenate((HORIZONTAL, [[0.0, 0.5], [0.2, 0.5]]))
    motion = ends_4m_away(at_m, np.tile([0.1, 0.0], (8, 1)))
    motion = replace(motion, usable=np.arange(8) < 6)
    owner = np.zeros(8, np.intp)
    body = body_velocities(motion, fragment_velocities(motion, 1.5).per_end, owner, 1, np.zeros((1, 3)), 1.5)
    assert one_edge.without_way_along(body, motion, owner, FOCAL_PX).contradicts_static == 0.0
