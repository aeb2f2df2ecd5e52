"""Velocities in sigmas, along the line of sight and across, against values computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from vision.motion.line_of_sight import decompose

UP = np.array([0.0, -1.0, 0.0])


def test_split_by_hand() -> None:
    """Along x, y, z: 0.3, 0.4, 0.5 m/s with variances 0.0091, 0.0391, 0.2491 and 0.0009 added to each."""
    velocity = np.array([[[0.3, 0.4, 0.5]]])
    doubt = np.diag([0.0091, 0.0391, 0.2491])[None, None]
    # 0.09 / 0.01 + 0.16 / 0.04 + 0.25 / 0.25
    ahead = decompose(velocity, doubt, np.array([[0.0, 0.0, 1.0]]), None)
    assert ahead.total[0, 0] == pytest.approx(14.0)
    assert ahead.along[0, 0] == pytest.approx(1.0)
    assert ahead.across[0, 0] == pytest.approx(13.0)
    aside = decompose(velocity, doubt, np.array([[1.0, 0.0, 0.0]]), None)
    assert aside.along[0, 0] == pytest.approx(9.0)
    assert aside.across[0, 0] == pytest.approx(5.0)


def test_of_what_goes_across_the_level_part_by_hand() -> None:
    """Along z, level or obliquely downwards, that is x. Straight down nothing is."""
    velocity, doubt = np.array([[[0.3, 0.4, 0.5]]]), np.diag([0.0091, 0.0391, 0.2491])[None, None]
    for sight in ([0.0, 0.0, 1.0], [0.0, 0.6, 0.8]):
        assert decompose(velocity, doubt, np.array([sight]), UP).level[0, 0] == pytest.approx(9.0)
    assert decompose(velocity, doubt, np.array([[1.0, 0.0, 0.0]]), UP).level[0, 0] == pytest.approx(1.0)
    assert decompose(velocity, doubt, np.array([[0.0, 1.0, 0.0]]), UP).level[0, 0] == 0.0
    ahead = decompose(velocity, doubt, np.array([[0.0, 0.0, 1.0]]), None)
    assert ahead.level[0, 0] == ahead.across[0, 0]  # without a floor nothing is level


def test_many_velocities_are_split_at_once_as_one_by_one() -> None:
    """Two of each of two tracks: the parts along their lines of sight, with variance, and what is left."""
    velocity = np.array([[[0.3, 0.4, 0.5], [0.0, 0.0, 1.0]], [[-0.1, 0.2, 0.0], [1.0, 2.0, 2.0]]])
    doubt = np.array([[0.04 * np.eye(3), 0.09 * np.eye(3)], [0.01 * np.eye(3), 0.25 * np.eye(3)]])
    sight = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    together = decompose(velocity, doubt, sight, UP)
    np.testing.assert_allclose(together.value, [[0.5, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(together.variance, [[0.04, 0.09], [0.01, 0.25]])
    np.testing.assert_allclose(together.rest[1], [[-0.1, 0.2, 0.0], [0.0, 2.0, 2.0]])
    for k in range(2):
        alone = decompose(velocity[k : k + 1], doubt[k : k + 1], sight, UP)
        np.testing.assert_allclose(together.along[k], alone.along[0])
        np.testing.assert_allclose(together.across[k], alone.across[0])
        np.testing.assert_allclose(together.total[k], alone.total[0])
        np.testing.assert_allclose(together.level[k], alone.level[0])


def test_squared_sigmas_are_those_of_a_general_solver() -> None:
    """Whatever is correlated with whatever, seen from aside and from above."""
    rng = np.random.default_rng(8)
    root = rng.normal(size=(5, 3, 3))
    doubt, velocity, sight = root @ root.transpose(0, 2, 1), rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
    sight /= np.linalg.norm(sight, axis=1)[:, None]
    found = decompose(velocity[None], doubt[None], sight, UP)
    floor = 0.0009 * np.eye(3)
    for k in range(5):
        total = velocity[k] @ np.linalg.solve(doubt[k] + floor, velocity[k])
        assert found.total[0, k] == pytest.approx(total)
        # Across: in the plane that two vectors at right angles to the line of sight span.
        plane = np.linalg.svd(sight[k : k + 1])[2][1:]
        inside = plane @ (doubt[k] + floor) @ plane.T
        across = plane @ velocity[k]
        assert found.across[0, k] == pytest.approx(across @ np.linalg.solve(inside, across))
        np.testing.assert_allclose(found.rest[0, k], plane.T @ across, atol=1e-12)


def test_no_tracks_give_nothing_to_split() -> None:
    found = decompose(np.empty((4, 0, 3)), np.empty((4, 0, 3, 3)), np.empty((0, 3)), UP)
    assert found.level.shape == (4, 0)
    assert found.rest.shape == (4, 0, 3)
