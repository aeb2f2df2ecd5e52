from __future__ import annotations

import math

import pytest

from controller.bench.figures import Durations, median_ratio


def test_median_and_p99_by_hand() -> None:
    durations = Durations.of([1_000_000 * value for value in range(1, 102)])
    assert durations.count == 101
    assert durations.median_ms == pytest.approx(51.0)
    assert durations.p99_ms == pytest.approx(100.0)


def test_median_of_an_even_count_lies_between_the_middle_two() -> None:
    assert Durations.of([1_000_000, 2_000_000, 4_000_000, 100_000_000]).median_ms == pytest.approx(3.0)


def test_p99_is_interpolated() -> None:
    # Rank 0.99 * (2 - 1) between 10 and 20 ms.
    assert Durations.of([20_000_000, 10_000_000]).p99_ms == pytest.approx(19.9)


def test_nothing_measured_is_not_zero() -> None:
    with pytest.raises(ValueError, match="nothing was measured"):
        Durations.of([])


def test_durations_are_written_in_milliseconds() -> None:
    assert Durations.of([1_234_567]).as_json() == {"count": 1, "median_ms": 1.2346, "p99_ms": 1.2346}


def test_median_ratio_is_taken_pair_by_pair() -> None:
    # Ratios 2, 2, 4: a slow moment that hits both of a pair does not show.
    assert median_ratio([20, 2000, 40], [10, 1000, 10]) == pytest.approx(2.0)


def test_median_ratio_leaves_out_what_took_no_time() -> None:
    assert median_ratio([20, 30], [0, 10]) == pytest.approx(3.0)


def test_median_ratio_of_nothing_is_unknown() -> None:
    assert math.isnan(median_ratio([20], [0]))


def test_median_ratio_needs_pairs() -> None:
    with pytest.raises(ValueError, match="shorter"):
        median_ratio([1, 2], [1])
