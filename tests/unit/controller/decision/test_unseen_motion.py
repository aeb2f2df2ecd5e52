"""How bodies that are out of view, or about to leave it, are judged to move."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.decision.bodies import Bodies
from controller.decision.unseen_motion import hardly_stood, velocities_agree, with_measured_velocity
from controller.decision.unseen_position import extrapolated
from controller.decision.view_edges import view_from
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import box

MOUNT = CameraMount(0.45, 0.0, 0.60, 0.0)
LOOKING_LEFT = view_from(PlanarPose(1.0, 2.0, math.pi / 2), MOUNT, edge_tan=0.5, near_m=1.3, up_tan=math.inf)
# Faster than this, a measurement is a mistake.
MISTAKEN_MPS = 3.0


def judged_standing(measured_mps: tuple[float, float], tracked_s: float = 0.7) -> Bodies:
    """Measured with 0.1 m/s of standard deviation along x, and 0.2 m/s along y."""
    return replace(
        box(3.0, 1.0),
        measured_mps=np.array([measured_mps]),
        covariance=np.diag([0.01, 0.04])[None],
        tracked_s=np.array([tracked_s]),
    )


@pytest.mark.parametrize(
    ("measured_mps", "tracked_s", "moves"),
    [
        ((0.51, 0.0), 0.7, True),  # more than 5 sigma
        ((0.49, 0.0), 0.7, False),
        ((0.0, 1.01), 0.7, True),
        ((0.0, 0.99), 0.7, False),
        ((0.51, 0.0), 0.49, False),  # hardly measured
        ((0.51, 0.0), 1.0, False),  # the verdict can be trusted
        ((3.01, 0.0), 0.7, False),
    ],
)
def test_what_surely_moves_before_the_verdict_gets_its_measured_velocity(
    measured_mps: tuple[float, float], tracked_s: float, moves: bool
) -> None:
    body = with_measured_velocity(judged_standing(measured_mps, tracked_s), MISTAKEN_MPS)
    assert body.moving.tolist() == [moves]
    assert body.velocity_mps.tolist() == [list(measured_mps) if moves else [0.0, 0.0]]


def test_it_hardly_stood_if_it_was_measured_as_moving_by_3_3_sigma() -> None:
    assert hardly_stood(judged_standing((0.34, 0.0))).tolist() == [True]
    assert hardly_stood(judged_standing((0.32, 0.0))).tolist() == [False]
    assert hardly_stood(replace(judged_standing((0.34, 0.0)), moving=np.array([True]))).tolist() == [False]


def test_the_spread_along_the_motion_counts_with_its_correlation() -> None:
    """Along the diagonal the variance is 0.01 + c: 0.35 m/s is 3.5 sigma without, and 2.5 with c = 0.01."""
    diagonal = replace(judged_standing((0.35 * math.sqrt(0.5),) * 2), covariance=0.01 * np.eye(2)[None])
    assert hardly_stood(diagonal).tolist() == [True]
    assert hardly_stood(replace(diagonal, covariance=np.full((1, 2, 2), 0.01))).tolist() == [False]


def test_velocities_agree_within_two_sigma_of_their_difference() -> None:
    """Of 0.1 m/s each: 0.283 m/s on each axis."""
    body = box(0.0, 0.0, 1.0, 0.0)
    seen = box(0.0, 0.0, 1.28, 0.28, number=2).joined(box(0.0, 0.0, 1.0, 0.29, number=3))
    assert velocities_agree(body, seen).tolist() == [[True, False]]
    assert velocities_agree(body, replace(seen, tracked_s=np.full(2, 0.5))).tolist() == [[False, False]]


def test_a_mover_that_was_not_seen_to_cross_the_axis_stays_on_its_side() -> None:
    """Before a camera at (1.0, 2.45) that looks along y; its axis is x = 1."""
    passes = box(1.0, 4.0, 0.0, 0.5, half_view_m=0.1, number=1)
    comes = box(1.3, 4.0, -1.0, 0.0, number=2)
    unsure = box(1.05, 4.0, -0.09, 0.0, number=3)
    behind = box(1.3, 2.0, -1.0, 0.0, number=4)
    bodies = passes.joined(comes).joined(unsure).joined(behind)
    xy_m = extrapolated(bodies, 0.5, LOOKING_LEFT)
    assert xy_m[0].tolist() == pytest.approx([1.0, 4.25])
    assert xy_m[1].tolist() == pytest.approx([1.1, 4.0])
    assert xy_m[2].tolist() == pytest.approx([1.005, 4.0])
    assert xy_m[3].tolist() == pytest.approx([0.8, 2.0])
