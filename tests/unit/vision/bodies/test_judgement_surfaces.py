"""What a body's surface and its free rims prove, each by itself (tests/support/judging.py)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.support.judging import (
    ACROSS,
    ALONG,
    SETTINGS,
    Speed,
    by_rim,
    by_surface,
    covariance,
    rises,
    surface,
)
from vision.bodies.judgement import judge


def test_a_surface_seen_long_enough_without_a_break_proves_by_itself() -> None:
    assert rises(by_surface(ACROSS, 0.25))
    assert not rises(by_surface(ACROSS, 0.2))
    deep = {"depth_sigma_m": np.array([0.19])}
    assert rises(by_surface(ALONG, 0.5, **deep))
    assert not rises(by_surface(ALONG, 0.45, **deep))  # noise of depth is shared by neighbours: longer


def test_a_displacement_far_beyond_depth_noise_proves_motion_as_soon_along_as_across() -> None:
    assert rises(by_surface(ALONG, 0.3, depth_sigma_m=np.array([0.059])))  # 0.24 m, more than 4 sigmas
    assert not rises(by_surface(ALONG, 0.3, depth_sigma_m=np.array([0.061])))
    assert not rises(by_surface(ALONG, 0.2, depth_sigma_m=np.array([0.01])))


def test_free_rims_that_go_one_way_long_enough_prove_motion() -> None:
    assert rises(by_rim())
    assert rises(by_rim(-0.8))
    assert not rises(by_rim(rim_s=0.1))
    assert not rises(by_rim(0.2))  # slower than 0.21 m/s
    assert not rises(by_rim(keeps_area=np.array([False])))  # its outline jumps with its area
    assert not rises(by_rim(2.5))  # faster than anything


def test_free_rims_of_one_frame_prove_a_motion_that_the_filter_shows_too() -> None:
    # 0.64 / 0.0789 = 8.1, more than half of 16.
    knows: dict[str, Any] = {"rim_s": 0.0, "covariance": covariance(0.078)}
    assert rises(by_rim(**knows))
    assert rises(by_rim(**knows, rim_sigmas=np.array([2.6])))
    assert not rises(by_rim(**knows, rim_sigmas=np.array([2.4])))
    assert not rises(by_rim(**{**knows, "covariance": covariance(0.08)}))  # 7.9
    assert not rises(by_rim(0.2, **knows))  # slower than 0.21 m/s
    assert not rises(by_rim(**knows, size_m=np.array([2.3])))
    assert not rises(replace(by_rim(**knows), velocity=np.array([ALONG])))


def test_free_rims_prove_nothing_for_what_is_large_or_that_a_new_viewpoint_explains() -> None:
    assert rises(by_rim(size_m=np.array([2.1])))
    assert not rises(by_rim(size_m=np.array([2.3])))
    assert rises(by_rim(view_radps=np.array([1.4])))  # 0.5 * 0.8 m * 1.4 rad/s = 0.56 m/s, and 0.21
    assert not rises(by_rim(view_radps=np.array([1.6])))


@pytest.mark.parametrize(("looks", "proves"), [(2, False), (3, True)])
@pytest.mark.parametrize("velocity", [ACROSS, ALONG])
def test_a_surface_proves_only_after_three_looks_however_few_frames_there_are(
    velocity: Speed, looks: int, proves: bool
) -> None:
    dt_s = 0.4
    seen = by_surface(velocity, looks * dt_s)
    rising = judge(seen, np.array([0.0]), np.array([False]), dt_s, SETTINGS).evidence[0] > 0.0
    assert rising == proves


def test_a_surface_proves_only_if_it_is_compact() -> None:
    assert rises(by_surface(ACROSS, 1.0, size_m=np.array([2.1])))
    assert not rises(by_surface(ACROSS, 1.0, size_m=np.array([2.3])))


def test_a_surface_proves_only_beyond_its_doubt() -> None:
    assert not rises(by_surface(ACROSS, 1.0, **surface(ACROSS, 0.042)))


def test_a_surface_of_a_few_cells_proves_nothing_along_the_line_of_sight() -> None:
    assert rises(by_surface(ALONG, 1.0, cells=np.array([48])))
    assert not rises(by_surface(ALONG, 1.0, cells=np.array([47])))
    assert rises(by_surface(ACROSS, 1.0, cells=np.array([20])))


def test_a_new_viewpoint_makes_the_middle_of_a_static_surface_wander() -> None:
    # 0.21 + 0.5 * 1.4 rad/s * 0.8 m = 0.77, with 1.6 rad/s 0.85: faster than 0.8 m/s
    assert rises(by_surface(ACROSS, 1.0, view_radps=np.array([1.4])))
    assert not rises(by_surface(ACROSS, 1.0, view_radps=np.array([1.6])))


def test_a_surface_that_comes_to_be_seen_makes_its_middle_wander_too() -> None:
    assert rises(by_surface(ACROSS, 1.0, growth_mps=np.array([0.55])))
    assert not rises(by_surface(ACROSS, 1.0, growth_mps=np.array([0.62])))
