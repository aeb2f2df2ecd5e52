from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.plant import PlantConfig
from hal.types import PlanarPose
from sim.plant import TrackedPlant

MS = 1_000_000
S = 1000 * MS


def test_speed_follows_with_first_order_lag() -> None:
    """Far from the acceleration limit, after one time constant: 1 - 1/e of the step."""
    plant = TrackedPlant(PlantConfig(lag_s=0.1, max_accel_mps2=50.0))
    plant.command(0.5, 0.0)
    plant.advance_to(100 * MS)
    v_mps, w_radps = plant.twist
    assert v_mps == pytest.approx(0.5 * (1.0 - math.exp(-1.0)), rel=1e-9)
    assert w_radps == 0.0


def test_distance_of_a_first_order_step() -> None:
    """Integral of v (1 - exp(-t/T)): v (t - T (1 - exp(-t/T)))."""
    plant = TrackedPlant(PlantConfig(lag_s=0.1, max_accel_mps2=50.0))
    plant.command(0.5, 0.0)
    plant.advance_to(1 * S)
    expected_m = 0.5 * (1.0 - 0.1 * (1.0 - math.exp(-10.0)))
    assert plant.pose.x_m == pytest.approx(expected_m, abs=1e-5)
    assert plant.track_travel_m == pytest.approx((expected_m, expected_m), abs=1e-5)


def test_acceleration_is_limited() -> None:
    plant = TrackedPlant(PlantConfig(lag_s=0.01, max_accel_mps2=2.0))
    plant.command(10.0, 0.0)
    plant.advance_to(500 * MS)
    assert plant.twist[0] == pytest.approx(1.0)
    assert plant.pose.x_m == pytest.approx(0.25, abs=1e-6)


def test_slip_turns_the_body_less_than_the_tracks_say() -> None:
    plant = TrackedPlant(PlantConfig(slip_factor=1.25))
    plant.command(0.0, 0.5)
    plant.advance_to(5 * S)
    assert plant.track_twist == pytest.approx((0.0, 0.5))
    assert plant.twist == pytest.approx((0.0, 0.4))
    left_m, right_m = plant.track_travel_m
    assert right_m == -left_m > 0.0
    told_rad = (right_m - left_m) / 0.555
    assert plant.pose.heading_rad == pytest.approx(told_rad / 1.25)


def test_a_full_circle_comes_back() -> None:
    plant = TrackedPlant(PlantConfig(lag_s=0.001, max_accel_mps2=50.0, slip_factor=1.0), PlanarPose(2, 1, 0))
    plant.command(0.5, 0.5)
    plant.advance_to(round(2 * math.pi / 0.5 * S))
    pose = plant.pose
    assert (pose.x_m, pose.y_m) == pytest.approx((2.0, 1.0), abs=0.01)
    assert pose.heading_rad == pytest.approx(0.0, abs=0.02)


def test_starts_where_and_when_it_is_put() -> None:
    plant = TrackedPlant(PlantConfig(), PlanarPose(1.0, 2.0, 3.0), start_ns=7 * S)
    plant.command(1.0, 0.0)
    plant.advance_to(3 * S)
    assert plant.pose == PlanarPose(1.0, 2.0, 3.0)
    assert plant.now_ns == 7 * S


def test_heading_is_told_wrapped() -> None:
    plant = TrackedPlant(PlantConfig(), PlanarPose(0.0, 0.0, 4.0))
    assert plant.pose.heading_rad == pytest.approx(4.0 - 2.0 * math.pi)


@settings(max_examples=30)
@given(st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_how_time_is_cut_hardly_matters(cuts_ms: list[int]) -> None:
    """Whole milliseconds are substeps of their own: any cut along them gives the very same numbers."""
    cut, whole = TrackedPlant(PlantConfig()), TrackedPlant(PlantConfig())
    for plant in (cut, whole):
        plant.command(0.7, 0.4)
    now_ns = 0
    for cut_ms in cuts_ms:
        now_ns += cut_ms * MS
        cut.advance_to(now_ns)
    whole.advance_to(now_ns)
    assert cut.pose == whole.pose
    assert cut.twist == whole.twist
