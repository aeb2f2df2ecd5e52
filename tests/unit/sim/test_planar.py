from __future__ import annotations

import numpy as np
import pytest

from config.path import LineSpec, PathSpec
from config.scenario import (
    Beam,
    BodySpec,
    Column,
    Crate,
    Go,
    MotionPlan,
    Pallet,
    Person,
    Pole,
    RobotBody,
    Scenario,
    Shelf,
    Wall,
)
from sim.planar import PlanarWorld
from sim.world import World

MOTION = MotionPlan(
    start_s=1.0,
    start_jitter_s=0.5,
    steps=(
        Go(kind="go", x_m=4.0, y_m=1.0, speed_mps=1.2),
        Go(kind="go", x_m=4.0, y_m=4.0, speed_mps=0.4),
    ),
)
BODIES: tuple[BodySpec, ...] = (
    Crate(kind="crate", name="crate", x_m=1.0, y_m=2.0, heading_deg=20.0),
    Shelf(kind="shelf", name="shelf", x_m=5.0, y_m=-2.0),
    Column(kind="column", name="column", x_m=7.0, y_m=1.0),
    Pole(kind="pole", name="pole", x_m=8.0, y_m=1.0),
    Pallet(kind="pallet", name="pallet", x_m=9.0, y_m=1.0, load_height_m=0.5),
    Wall(kind="wall", name="wall", x_m=12.0, y_m=0.0, heading_deg=90.0),
    Beam(kind="beam", name="beam", x_m=10.0, y_m=0.0),
    Person(kind="person", name="walker", x_m=0.0, y_m=1.0, motion=MOTION),
    RobotBody(kind="robot", name="robot", x_m=0.5, y_m=-1.0, load_height_m=0.5, motion=MOTION),
    RobotBody(kind="robot", name="parked", x_m=14.0, y_m=-1.0),
)
SCENARIO = Scenario(
    name="all kinds",
    path=PathSpec(segments=(LineSpec(kind="line", length_m=10.0),)),
    bodies=BODIES,
)


@pytest.mark.parametrize("t_s", [0.0, 1.3, 2.7, 6.0, 30.0])
def test_is_the_world_seen_from_above(t_s: float) -> None:
    polygons, velocity = PlanarWorld(SCENARIO, seed=5).snapshot(t_s)
    plane = PlanarWorld(SCENARIO, seed=5)
    for k, state in enumerate(World(SCENARIO, seed=5).bodies(t_s)):
        corners = len(state.footprint_m)
        assert plane.names[k] == state.name
        assert polygons[k, :corners] == pytest.approx(state.footprint_m, abs=1e-3)
        assert polygons[k, corners:] == pytest.approx(
            np.tile(polygons[k, corners - 1], (len(polygons[k]) - corners, 1))
        )
        assert velocity[k] == pytest.approx(state.velocity_mps)
        assert tuple(plane.z_m[k]) == pytest.approx(state.z_m)
        assert plane.moves[k] == state.moves


def test_views_over_times_equal_the_view_at_each_time() -> None:
    plane = PlanarWorld(SCENARIO, seed=5)
    times = np.array([0.0, 1.7, 3.3])
    for body in range(len(plane)):
        series = plane.sample(times, body)
        for k, t_s in enumerate(times.tolist()):
            assert series[k] == pytest.approx(plane.snapshot(t_s)[0][body])


def test_precomputed_snapshots_equal_computed_ones() -> None:
    plane, plain = PlanarWorld(SCENARIO, seed=5), PlanarWorld(SCENARIO, seed=5)
    times = np.array([0.0, 1.7, 3.3, 500.0])
    plane.precompute(times)
    for t_s in (*times.tolist(), 2.2):
        for seen, expected in zip(plane.snapshot(t_s), plain.snapshot(t_s), strict=True):
            assert (seen == expected).all()


def test_end_is_when_the_last_mover_has_arrived() -> None:
    plane = PlanarWorld(SCENARIO, seed=5)
    before, after = plane.snapshot(plane.end_s - 0.2)[1], plane.snapshot(plane.end_s + 0.01)[1]
    assert np.abs(before).max() > 0.05
    assert np.abs(after).max() == 0.0
    assert PlanarWorld(SCENARIO.model_copy(update={"bodies": ()})).end_s == 0.0
