import numpy as np
import pytest
from numpy.typing import NDArray

from hal.compiled import compiled
from vision.numerics.order import indices_of, median, median_of_positive, quantile, variance_ratio


@compiled("float32[::1]")
def positive_median(values: NDArray[np.float32]) -> float:
    return median_of_positive(values)


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


@pytest.mark.parametrize(
    "values", [[0.0], [3.0, 1.0], [0.0, 0.0, 2.0], [1e-30, 7.0, 7.0, 9.0], [3e38, 1e-3, np.inf]]
)
def test_median_of_positive_values_is_that_of_numpy(values: list[float]) -> None:
    given = np.array(values, np.float32)
    assert positive_median(given) == np.median(given.astype(float))


@pytest.mark.parametrize("count", [2, 33, 1000, 1001])
def test_median_of_many_positive_values_with_equal_ones_among_them(count: int) -> None:
    given = np.round(np.random.default_rng(count).exponential(0.1, count), 3).astype(np.float32)
    assert positive_median(given) == np.median(given.astype(float))


@pytest.mark.parametrize(("share", "expected"), [(0.0, 1.0), (0.25, 2.0), (0.5, 3.0), (0.9, 7.4), (1.0, 9.0)])
def test_quantile_by_hand(share: float, expected: float) -> None:
    assert quantile(np.array([9.0, 2.0, 1.0, 5.0, 3.0]), share) == pytest.approx(expected)


def test_quantile_of_one_value_is_that_value() -> None:
    assert quantile(np.array([2.5]), 0.97) == 2.5


@pytest.mark.parametrize("sigma", [0.5, 1.0, 2.0])
def test_residuals_tell_their_variance_though_half_of_them_are_outliers(sigma: float) -> None:
    """A third of chi-square with 2 degrees of freedom is below -2 ln(2/3) = 0.811."""
    residuals = np.random.default_rng(1).normal(scale=sigma, size=(20000, 2))
    chi2 = np.square(residuals).sum(axis=1)
    assert variance_ratio(chi2) == pytest.approx(sigma**2, rel=0.03)
    assert sigma**2 < variance_ratio(np.concatenate((chi2, np.full(20000, 1e3)))) < 3.0 * sigma**2


def test_variance_ratio_by_hand() -> None:
    assert variance_ratio(np.array([9.0, 1.622, 100.0, 0.1])) == pytest.approx(2.0)


def test_indices_in_an_ascending_array_and_minus_one_for_what_is_not_in_it() -> None:
    ordered, values = np.array([2, 5, 9]), np.array([9, 1, 2, 6, 10, 5])
    assert indices_of(ordered, values).tolist() == [2, -1, 0, -1, -1, 1]
    assert indices_of(ordered[:0], values).tolist() == [-1] * 6
    assert indices_of(ordered, values[:0]).tolist() == []
