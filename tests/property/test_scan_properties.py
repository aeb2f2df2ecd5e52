"""A scan of the free space that tells what cannot be, anywhere in it: a jerk-limited stop, and the reason."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot import Robot
from controller.decision.situation import SceneError
from controller.decision.surfaces import check_scan
from controller.shape import SpeedShaper
from hal.types import FloatArray
from tests.support.decision_bench import Bench
from tests.support.scenes import free_space
from vision.scene import NEVER_M, FreeSpace

FREE = free_space()
N = len(FREE.bearing_tan)
BELOW_0 = st.floats(max_value=0.0, exclude_max=True, allow_nan=False)
NO_NUMBER = st.sampled_from([math.nan, math.inf, -math.inf])


def changed(name: str, band: int, value: float) -> FreeSpace:
    """A free scan with one number changed; band counts for what is told of bands alone."""
    told: Any = value
    if isinstance(getattr(FREE, name), np.ndarray):
        told = getattr(FREE, name).copy()
        told[band] = value
    return replace(FREE, **{name: told})


def one_number(name: str, numbers: st.SearchStrategy[float]) -> st.SearchStrategy[tuple[str, FreeSpace]]:
    return st.builds(lambda band, value: (name, changed(name, band, value)), st.integers(0, N - 1), numbers)


IMPOSSIBLE = st.one_of(
    one_number("nearest_m", BELOW_0 | st.sampled_from([math.nan, -math.inf])),
    one_number("known_m", BELOW_0 | NO_NUMBER),
    one_number("bearing_tan", NO_NUMBER),
    one_number("half_width_tan", BELOW_0 | NO_NUMBER | st.just(0.0)),
    one_number("blind_m", BELOW_0 | NO_NUMBER),
    one_number("floor_from_m", BELOW_0 | NO_NUMBER),
    one_number("up_tan", st.sampled_from([math.nan, -math.inf])),
)


@given(IMPOSSIBLE)
def test_impossible_number_is_refused_with_its_name(told: tuple[str, FreeSpace]) -> None:
    name, scan = told
    with pytest.raises(SceneError, match=f"the scan of the free space is impossible: {name} "):
        check_scan(scan)


@settings(max_examples=20, deadline=None)
@given(IMPOSSIBLE)
def test_a_robot_that_drives_stops_within_its_limits_and_says_why(told: tuple[str, FreeSpace]) -> None:
    name, scan = told
    limits = Robot().limits
    bench, shaper = Bench(), SpeedShaper(limits, 0.02)
    for _ in range(250):
        shaper.step(1.0)
    bench.settle(v_mps=1.0)
    for _ in range(40):
        before_mps2 = shaper.a_mps2
        decision = bench.step(bench.scene(free=scan), shaper.v_mps, before_mps2)
        assert decision.target_speed_mps == 0.0
        assert decision.reason.rule == "camera"
        assert name in decision.reason.sentence
        shaped = shaper.step(decision.target_speed_mps, emergency=decision.emergency)
        assert shaped.fault == ""
        assert abs(shaped.a_mps2 - before_mps2) <= limits.emergency_jerk_mps3 * 0.02 + 1e-6
    assert shaper.v_mps < 1.0


distances = st.floats(0.0, 100.0)


@given(
    st.lists(st.tuples(distances | st.just(math.inf), distances), max_size=80),
    st.floats(1e-3, 0.5),
    st.floats(-2.0, 2.0),
    distances,
    st.floats(0.0, NEVER_M),
    st.floats(-2.0, 2.0) | st.just(math.inf),
)
def test_possible_scan_is_not_refused(
    bands: list[tuple[float, float]],
    half_width_tan: float,
    first_tan: float,
    blind_m: float,
    floor_from_m: float,
    up_tan: float,
) -> None:
    told: FloatArray = np.array(bands, np.float64).reshape(-1, 2)
    bearing = first_tan + 2.0 * half_width_tan * np.arange(len(bands), dtype=np.float64)
    nearest, known = told[:, 0].copy(), told[:, 1].copy()
    check_scan(FreeSpace(bearing, half_width_tan, nearest, known, blind_m, floor_from_m, up_tan))


@pytest.mark.parametrize("stretched", [0.0, -1.0, 0.8, 1.2])
def test_bands_that_do_not_stand_side_by_side_are_none(stretched: float) -> None:
    """Which band a place lies in is reckoned by their width: of others it would be another one."""
    with pytest.raises(SceneError, match="bearing_tan of band 1 is"):
        check_scan(replace(FREE, bearing_tan=stretched * FREE.bearing_tan))
    check_scan(replace(FREE, bearing_tan=1.05 * FREE.bearing_tan))
