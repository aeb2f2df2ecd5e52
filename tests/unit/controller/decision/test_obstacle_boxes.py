"""Obstacles of the optical frame as boxes on the floor, and the impossible ones."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.decision.obstacle_boxes import bodies_of
from controller.decision.situation import SceneError
from hal.geometry import camera_in_floor
from hal.types import CameraMount, FloatArray, PlanarPose
from tests.support.scenes import GOOD, STILL, free_space
from vision.scene import Obstacle, Scene

MOUNT = CameraMount(0.45, 0.0, 0.60, math.radians(4.0))
POSE = PlanarPose(2.0, 1.0, math.pi / 2)


def seen(
    floor_m: tuple[float, float, float] = (2.0, 6.0, 0.5),
    velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0),
    extent_m: tuple[float, float, float] = (0.6, 1.0, 0.2),
    moving: bool = False,
    number: int = 7,
) -> Obstacle:
    """Given in floor axes, for a camera on a robot at POSE."""
    camera = camera_in_floor(POSE, MOUNT).inverse()
    return Obstacle(
        id=number,
        bbox_px=(0.0, 0.0, 1.0, 1.0),
        position_m=camera.apply(np.array([floor_m]))[0],
        extent_m=np.array(extent_m),
        velocity_mps=camera.rotation @ np.array(velocity_mps),
        velocity_cov=camera.rotation @ np.diag([0.04, 0.09, 0.01]) @ camera.rotation.T,
        moving=moving,
        score=0.9,
        fragments=5,
        age_s=1.0,
        unseen_s=0.0,
    )


def scene(*obstacles: Obstacle) -> Scene:
    return Scene(5, 1, obstacles, free_space(), STILL, GOOD, POSE)


def test_a_box_stands_where_it_was_seen() -> None:
    bodies = bodies_of(scene(seen(moving=True, velocity_mps=(0.3, -1.0, 0.0))), POSE, MOUNT, depth_m=0.5)
    assert bodies.ids.tolist() == [7]
    # Its visible surface is 0.2 m deep, so the body is taken to reach 0.15 m further back, along y here.
    assert bodies.xy_m[0].tolist() == pytest.approx([2.0, 6.0 + 0.15])
    assert (bodies.half_view_m[0], bodies.half_across_m[0]) == pytest.approx((0.25, 0.3))
    assert bodies.velocity_mps[0].tolist() == pytest.approx([0.3, -1.0])
    assert bodies.covariance[0].ravel().tolist() == pytest.approx([0.04, 0.0, 0.0, 0.09])
    assert bodies.top_m[0] == pytest.approx(1.0)
    assert bodies.captured_ns == 5


def test_standing_obstacle_has_no_velocity() -> None:
    bodies = bodies_of(scene(seen(velocity_mps=(0.1, 0.1, 0.0))), POSE, MOUNT, depth_m=0.5)
    assert bodies.velocity_mps.tolist() == [[0.0, 0.0]]


def test_scene_without_obstacles_gives_no_bodies() -> None:
    assert len(bodies_of(scene(), POSE, MOUNT, 0.5)) == 0


def test_two_obstacles_of_one_id_are_refused() -> None:
    """What is kept of obstacles from scene to scene is kept by id."""
    with pytest.raises(SceneError, match="several obstacles have the id 6"):
        bodies_of(scene(seen(number=7), seen(number=6), seen(number=6)), POSE, MOUNT, 0.5)


BAD_VECTORS: list[FloatArray] = [np.array([math.nan, 0.0, 0.0]), np.array([0.0, math.inf, 0.0])]


@pytest.mark.parametrize("name", ["position_m", "extent_m", "velocity_mps"])
@pytest.mark.parametrize("value", [*BAD_VECTORS, np.array([0.0, 0.0, 1e6])])
def test_impossible_vectors_are_refused(name: str, value: FloatArray) -> None:
    vectors = {part: getattr(seen(), part) for part in ("position_m", "extent_m", "velocity_mps")}
    vectors[name] = value
    broken = replace(
        seen(),
        position_m=vectors["position_m"],
        extent_m=vectors["extent_m"],
        velocity_mps=vectors["velocity_mps"],
    )
    with pytest.raises(SceneError, match="obstacle 7 is impossible"):
        bodies_of(scene(seen(number=6), broken), POSE, MOUNT, 0.5)


@pytest.mark.parametrize(
    "broken",
    [
        replace(seen(), extent_m=np.array([-0.1, 1.0, 1.0])),
        replace(seen(), velocity_cov=np.full((3, 3), math.nan)),
        replace(seen(), velocity_cov=np.diag([1.0, -1.0, 1.0])),
        replace(seen(), age_s=math.nan),
        replace(seen(), age_s=-1.0),
    ],
)
def test_other_impossible_obstacles_are_refused(broken: Obstacle) -> None:
    with pytest.raises(SceneError, match="obstacle 7 is impossible"):
        bodies_of(scene(broken), POSE, MOUNT, 0.5)
