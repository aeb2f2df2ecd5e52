"""Fragments that disagree: when they are believed, and how far."""

from __future__ import annotations

import numpy as np
import pytest

from vision.motion import limbs
from vision.motion.least_squares import BodyVelocities


def body(ends: int, agreement: float, contradicts_static: float = 1.0) -> BodyVelocities:
    return BodyVelocities(
        velocity_mps=np.array([[1.0, 0.0, 0.0]]),
        covariance=1e-4 * np.eye(3)[None],
        ends=np.array([ends], np.intp),
        agreement=np.array([agreement]),
        contradicts_static=np.array([contradicts_static]),
    )


@pytest.mark.parametrize(
    ("ends", "agreement", "believed"),
    [(0, 0.0, False), (1, 1.0, False), (2, 1.0, True), (10, 0.2, True), (5, 0.2, False), (40, 0.1, True)],
)
def test_ends_that_agree_are_believed(ends: int, agreement: float, believed: bool) -> None:
    """Two of them at least, and a fifth of all or four."""
    assert limbs.believable(body(ends, agreement, contradicts_static=0.0)).tolist() == [believed]


def test_ends_that_disagree_are_believed_if_many_deny_that_it_stands() -> None:
    assert limbs.believable(body(6, 0.0, contradicts_static=0.7)).all()
    assert not limbs.believable(body(5, 0.0)).any()
    assert not limbs.believable(body(12, 0.0, contradicts_static=0.65)).any()
    assert limbs.restless(body(6, 1.0, contradicts_static=0.7)).all()
    assert not limbs.restless(body(6, 1.0, contradicts_static=0.65)).any()


def test_a_rigid_body_that_stands_has_no_limbs() -> None:
    assert limbs.variance(body(12, 1.0), np.zeros(1))[0] == 0.0


def test_disagreeing_ends_increase_the_velocity_variance() -> None:
    """Half of them: 0.5 m/s, however many, where the others stand."""
    assert limbs.variance(body(12, 0.5, contradicts_static=0.5), np.zeros(1))[0] == pytest.approx(0.25)


def test_variance_by_limbs_falls_with_the_number_of_ends() -> None:
    """All deny that they stand and disagree, as when somebody starts to walk: 1 m/s over their root."""
    assert limbs.variance(body(8, 0.0, contradicts_static=1.0), np.zeros(1))[0] == pytest.approx(1.0)
    assert limbs.variance(body(40, 0.0, contradicts_static=1.0), np.zeros(1))[0] == pytest.approx(0.2)


def test_one_fragment_on_a_walker_may_be_a_shank() -> None:
    """0.6 of 1.5 m/s over two agreeing ends, and over eight of them."""
    walking = np.array([1.5])
    assert limbs.variance(body(2, 1.0), walking)[0] == pytest.approx(0.9**2 / 2)
    assert limbs.variance(body(8, 1.0), walking)[0] == pytest.approx(0.9**2 / 8)
