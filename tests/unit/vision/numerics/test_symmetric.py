"""Inverses of symmetric 3x3 matrices."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vision.numerics.symmetric import inverse, inverse_entries, whole


def test_inverse_by_hand() -> None:
    """Determinant 1; the inverse is [[1, 0, -1], [0, 1, 0], [-1, 0, 2]]."""
    entries = np.array([[2.0], [0.0], [1.0], [1.0], [0.0], [1.0]])
    np.testing.assert_allclose(whole(entries)[..., 0], [[2, 0, 1], [0, 1, 0], [1, 0, 1]])
    np.testing.assert_allclose(inverse_entries(entries)[:, 0], [1, 0, -1, 1, 0, 2])


@given(seed=st.integers(0, 2**32 - 1), shape=st.sampled_from([(1,), (7,), (4, 3)]))
def test_a_covariance_times_its_inverse_is_the_unit_matrix(seed: int, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(*shape, 3, 3))
    covariance = root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(3)
    found = inverse(covariance)
    assert found.shape == covariance.shape
    np.testing.assert_allclose(found @ covariance, np.broadcast_to(np.eye(3), found.shape), atol=1e-9)
