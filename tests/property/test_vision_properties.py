from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import CameraMount, FloatArray, Intrinsics, Pose, RgbdFrame
from vision.lens import project, rays, rotation_from_vector, vector_from_rotation
from vision.perception import Perception
from vision.scene import Scene
from vision.velocities import PointMotion, normal_equations, static_miss

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))

speeds = st.floats(-2.0, 2.0)
angles = st.floats(-0.3, 0.3)
triples = st.tuples(speeds, speeds, speeds).map(np.array)
seeds = st.integers(0, 2**32 - 1)
cameras = st.builds(
    Intrinsics,
    st.just(640),
    st.just(480),
    st.floats(200, 900),
    st.floats(200, 900),
    st.floats(250, 390),
    st.floats(180, 300),
)


@given(
    velocity=triples,
    lag_s=st.floats(0.02, 0.5),
    turn=st.tuples(angles, angles, angles).map(np.array),
    way=triples.map(lambda v: 0.2 * v),
    seed=seeds,
    count=st.integers(3, 40),
)
def test_any_translation_over_ground_is_recovered_from_exact_projections(
    velocity: FloatArray, lag_s: float, turn: FloatArray, way: FloatArray, seed: int, count: int
) -> None:
    """The camera turns and goes; the points go with one velocity; the equations return just that."""
    rng = np.random.default_rng(seed)
    before = rays(rng.uniform((0, 0), (640, 480), (count, 2)), Intrinsics(640, 480, 610, 610, 320, 240))
    points = before * rng.uniform(3.0, 8.0, count)[:, None]
    points[:3] = [[-1.0, 0.0, 4.0], [1.0, 0.5, 4.0], [0.0, -0.7, 5.0]]
    camera = Pose(rotation_from_vector(turn), way)
    static = camera.inverse().apply(points)
    now = camera.inverse().apply(points + velocity * lag_s)
    ray = now[:, :2] / now[:, 2:]
    motion = PointMotion(
        static_m=static,
        ray=ray,
        lag_s=np.full(count, lag_s),
        miss_m=static_miss(static, ray),
        covariance=np.tile([1e-6, 2e-7, 2e-6], (count, 1)),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, np.nan),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.full(count, lag_s),
        static_chi2=np.zeros(count),
        usable=np.ones(count, np.bool_),
    )
    equations = normal_equations(motion, rng.uniform(0.1, 1.0, count))
    found = np.linalg.solve(equations.matrix.sum(axis=0), equations.rhs.sum(axis=0))
    np.testing.assert_allclose(found, camera.rotation.T @ velocity, atol=1e-6)


@given(camera=cameras, seed=seeds)
def test_projecting_a_ray_gives_its_pixel_back(camera: Intrinsics, seed: int) -> None:
    rng = np.random.default_rng(seed)
    pixels = rng.uniform((-50, -50), (700, 530), (20, 2))
    depth = rng.uniform(0.1, 50.0, 20)
    np.testing.assert_allclose(project(rays(pixels, camera) * depth[:, None], camera), pixels, atol=1e-8)


@given(vector=st.tuples(angles, angles, angles).map(np.array))
def test_rotation_vectors_and_rotations_are_each_others_inverse(vector: FloatArray) -> None:
    rotation = rotation_from_vector(10.0 * vector / max(1.0, float(np.linalg.norm(vector)) * 4.0))
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    again = rotation_from_vector(vector_from_rotation(rotation))
    np.testing.assert_allclose(again, rotation, atol=1e-8)


def garbage(seed: int, width: int, height: int, kind: str, sequence: int, stamp_ns: int) -> RgbdFrame:
    rng = np.random.default_rng([seed, sequence])
    shape = (height, width)
    colour = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
    if kind == "blocks":
        colour = np.repeat(np.repeat(colour[::16, ::16], 16, axis=0), 16, axis=1)[:height, :width]
    depth = rng.integers(0, 65536, shape).astype(np.uint16)
    if kind == "holes":
        depth[rng.random(shape) < 0.7] = 0
    elif kind == "extremes":
        depth = rng.choice(np.array([0, 1, 250, 10_000, 65_535], np.uint16), shape)
    elif kind == "blocks":
        depth = np.repeat(np.repeat(depth[::16, ::16] // 8, 16, axis=0), 16, axis=1)[:height, :width]
    camera = Intrinsics(width, height, 0.95 * width, 0.95 * width, width / 2, height / 2)
    return RgbdFrame(np.ascontiguousarray(colour), depth, 0.001, stamp_ns, 0.0, sequence, camera)


def assert_finite(scene: Scene) -> None:
    for one in scene.obstacles:
        for values in (one.bbox_px, one.position_m, one.extent_m, one.velocity_mps, one.velocity_cov):
            assert np.isfinite(values).all()
        assert (np.linalg.eigvalsh(one.velocity_cov) > 0).all()
        assert 0.0 <= one.score <= 1.0
    space = scene.free_space
    assert np.isfinite(space.bearing_tan).all()
    assert np.isfinite(space.known_m).all()
    assert (space.nearest_m > 0).all()  # false for NaN too
    assert (space.known_m >= 0).all()
    motion = scene.ego_motion.motion
    np.testing.assert_allclose(motion.rotation @ motion.rotation.T, np.eye(3), atol=1e-9)
    assert np.isfinite(motion.translation_m).all()
    assert scene.ego_motion.sigma_translation_m >= 0
    assert 0.0 <= scene.health.valid_depth_ratio <= 1.0


@settings(max_examples=25, deadline=None)
@given(
    seed=seeds,
    width=st.integers(64, 170),
    height=st.integers(48, 130),
    kinds=st.lists(st.sampled_from(["noise", "holes", "extremes", "blocks"]), min_size=3, max_size=5),
    gaps_ns=st.lists(st.sampled_from([33_000_000, 1, 0, -5_000_000, 400_000_000, 900_000_000]), min_size=5),
    mounted=st.booleans(),
)
def test_garbage_never_makes_a_scene_that_is_not_finite(
    seed: int, width: int, height: int, kinds: list[str], gaps_ns: list[int], mounted: bool
) -> None:
    mount = CameraMount(0.1, 0.0, 0.5, 0.1) if mounted else None
    eyes = Perception(SMALL, mount, 0.8, 0.05)
    stamp_ns = 10_000_000_000
    for k, kind in enumerate(kinds):
        frame = garbage(seed, width, height, kind, k, stamp_ns)
        percept = eyes.perceive(frame, None, None)
        assert_finite(percept.scene)
        assert np.isfinite(percept.fragments.ends_px).all()
        stamp_ns += gaps_ns[k]
