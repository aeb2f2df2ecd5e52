"""Fragments that move, that stand, and that move together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import FloatArray
from vision.detection import unknown_residuals
from vision.motion.moving_fragments import cluster, long_static, moving_candidates
from vision.motion.velocities import EndResiduals


def seen(static_chi2: tuple[float, float], usable: tuple[bool, bool] = (True, True)) -> EndResiduals:
    """Two ends of one fragment."""
    return replace(unknown_residuals(2), static_chi2=np.array(static_chi2), usable=np.array(usable))


def test_long_static_are_those_whose_ends_have_both_lain_still_for_a_while() -> None:
    old, young = np.array([0.27]), np.array([0.24])
    assert not long_static(seen((99.0, 99.0)), old)[0]
    assert long_static(seen((6.0, 0.5)), old)[0]
    assert not long_static(seen((6.0, 0.5)), young)[0]
    assert not long_static(seen((0.5, 6.1)), old)[0]
    assert not long_static(seen((6.0, 0.5), (True, False)), old)[0]


@pytest.mark.parametrize(
    ("chi2", "usable", "frames", "expected"),
    [
        ((9.0, 9.6), (True, True), 2, True),
        ((9.0, 9.6), (True, True), 1, False),
        ((9.0, 9.4), (True, True), 2, False),
        ((6.0, 99.0), (True, True), 2, False),
        ((99.0, 99.0), (False, True), 2, False),
    ],
)
def test_a_candidate_is_missed_by_both_its_ends(
    chi2: tuple[float, float], usable: tuple[bool, bool], frames: int, expected: bool
) -> None:
    """Each by more than 6, together by more than 18.5, and not in the first two frames."""
    assert moving_candidates(seen(chi2, usable), np.array([frames])).tolist() == [expected]


def grouped(position_m: list[list[float]], velocity: list[list[float]] | None = None) -> list[int]:
    count = len(position_m)
    speeds: FloatArray = np.zeros((count, 3)) if velocity is None else np.array(velocity)
    covariance = np.tile(0.01 * np.eye(3), (count, 1, 1))
    group = cluster(np.array(position_m).reshape(-1, 3), speeds, covariance, np.full(count, 0.1))
    return [int(first) for first in group]


def test_a_chain_of_neighbours_is_one_group_named_after_its_first() -> None:
    """0.4 m apart each, in any order; what is 0.6 m from the next one is by itself."""
    chain = [
        [0.8, 0.0, 4.0],
        [5.0, 0.0, 4.0],
        [0.0, 0.0, 4.0],
        [1.2, 0.0, 4.0],
        [0.4, 0.0, 4.0],
        [1.8, 0.0, 4.0],
    ]
    assert grouped(chain) == [0, 1, 0, 0, 0, 5]


def test_neighbours_may_be_farther_apart_upwards_and_along_the_view() -> None:
    assert grouped([[0.0, 0.0, 4.0], [0.0, 0.83, 4.0]]) == [0, 0]
    assert grouped([[0.0, 0.0, 4.0], [0.0, 0.84, 4.0]]) == [0, 1]
    # 0.5 m and 0.1 m of either.
    assert grouped([[0.0, 0.0, 4.0], [0.0, 0.0, 4.69]]) == [0, 0]
    assert grouped([[0.0, 0.0, 4.0], [0.0, 0.0, 4.71]]) == [0, 1]


def test_fragments_with_different_velocities_are_in_different_groups() -> None:
    """By more than 0.5 m/s and two sigmas of both, 0.28, across or upwards."""
    here = [[0.0, 0.0, 4.0], [0.1, 0.0, 4.0]]
    assert grouped(here, [[0.0, 0.0, 0.0], [0.78, 0.0, 9.0]]) == [0, 0]
    assert grouped(here, [[0.0, 0.0, 0.0], [0.79, 0.0, 0.0]]) == [0, 1]
    assert grouped(here, [[0.0, -0.4, 0.0], [0.0, 0.39, 0.0]]) == [0, 1]


def test_groups_of_no_end_and_of_one_end() -> None:
    assert grouped([]) == []
    assert grouped([[0.0, 0.0, 4.0]]) == [0]
