import numpy as np
import pytest

from vision.numerics.order import median, quantile


@pytest.mark.parametrize(
    ("values", "expected"),
    [([4.0], 4.0), ([3.0, 1.0], 2.0), ([9.0, 1.0, 2.0], 2.0), ([4.0, 1.0, 9.0, 2.0], 3.0)],
)
def test_median_by_hand(values: list[float], expected: float) -> None:
    assert median(np.array(values)) == expected


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_median_of_rows_is_that_of_numpy_and_keeps_single_precision(count: int) -> None:
    values = np.random.default_rng(count).normal(size=(3, count)).astype(np.float32)
    found = median(values)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.median(values, axis=1))


@pytest.mark.parametrize(("share", "expected"), [(0.0, 1.0), (0.25, 2.0), (0.5, 3.0), (0.9, 7.4), (1.0, 9.0)])
def test_quantile_by_hand(share: float, expected: float) -> None:
    assert quantile(np.array([9.0, 2.0, 1.0, 5.0, 3.0]), share) == pytest.approx(expected)


def test_quantile_of_one_value_is_that_value() -> None:
    assert quantile(np.array([2.5]), 0.97) == 2.5
