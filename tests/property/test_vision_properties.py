from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from config.perception import FragmentSettings, MotionSettings, PerceptionConfig
from hal.types import CameraMount, FloatArray, Intrinsics, Pose, RgbdFrame
from tests.support.grids import grid_of, plane
from tests.support.point_motion import matrices, project, static_miss
from vision.bodies.judgement import judge
from vision.bodies.motion_evidence import MotionEvidence
from vision.camera.floor import FloorFinder
from vision.camera.lens import rays, rotation_from_vector, vector_from_rotation
from vision.motion.velocities import EndResiduals, normal_equations
from vision.numerics import kalman
from vision.perception import Perception
from vision.scene import Scene

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
    motion = EndResiduals(
        static_m=static,
        ray=ray,
        lag_s=np.full(count, lag_s),
        residual_m=static_miss(static, ray),
        covariance=np.tile([1e-6, 2e-7, 2e-6], (count, 1)),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, np.nan),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.full(count, lag_s),
        static_chi2=np.zeros(count),
        usable=np.ones(count, np.bool_),
    )
    equations = normal_equations(motion, rng.uniform(0.1, 1.0, count))
    found = np.linalg.solve(matrices(equations).sum(axis=0), equations[6:9].sum(axis=1))
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


@settings(deadline=None)
@given(
    pitch_deg=st.floats(5.0, 38.0),
    roll_deg=st.floats(-20.0, 20.0),
    height_m=st.floats(0.3, 2.0),
    seed=seeds,
)
def test_any_floor_in_view_is_found_through_the_noise_of_a_stereo_camera(
    pitch_deg: float, roll_deg: float, height_m: float, seed: int
) -> None:
    pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
    up = np.array([-math.cos(pitch) * math.sin(roll), -math.cos(pitch) * math.cos(roll), -math.sin(pitch)])
    depth_m = plane(up, height_m)
    noise = np.random.default_rng(seed).normal(0.0, 0.002, depth_m.shape)
    seen = np.divide(1.0, depth_m, out=np.zeros_like(depth_m), where=depth_m > 0.0) + noise
    measured = np.divide(1.0, seen, out=np.zeros_like(seen), where=(depth_m > 0.0) & (seen > 0.1))
    floor = FloorFinder().find(grid_of(measured))
    assert floor is not None
    assert abs(floor.camera_height_m / height_m - 1.0) < 0.05
    assert floor.up @ up > math.cos(math.radians(2.0))


@given(
    seed=seeds,
    normal=st.tuples(angles, angles, angles),
    dt_s=st.floats(0.001, 0.5),
    density=st.floats(0.0, 2.0),
)
def test_a_predicted_covariance_is_symmetric_and_positive_and_level_speed_stays(
    seed: int, normal: tuple[float, float, float], dt_s: float, density: float
) -> None:
    up = np.array([normal[0], normal[1] - 1.0, normal[2]])
    up /= np.linalg.norm(up)
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 6, 6))
    covariance = root @ root.transpose(0, 2, 1) + 0.01 * np.eye(6)
    state = rng.normal(size=(3, 6))
    moved, spread = kalman.predict(state, covariance, dt_s, density, up)
    np.testing.assert_allclose(spread, spread.transpose(0, 2, 1), rtol=1e-9, atol=1e-9)
    assert (np.linalg.eigvalsh(spread) > 0.0).all()
    level = np.eye(3) - np.outer(up, up)
    np.testing.assert_allclose(moved[:, 3:] @ level, state[:, 3:] @ level, atol=1e-9)
    assert (np.abs(moved[:, 3:] @ up) <= np.abs(state[:, 3:] @ up) + 1e-12).all()


def any_evidence(seed: int, count: int, trusted: bool) -> MotionEvidence:
    rng = np.random.default_rng(seed)

    def covariances() -> FloatArray:
        root = rng.normal(size=(count, 3, 3)) * rng.choice([0.0, 0.05, 1.0], (count, 1, 1))
        result: FloatArray = root @ root.transpose(0, 2, 1)
        return result

    sight = rng.normal(size=(count, 3))
    return MotionEvidence(
        sight=sight / np.linalg.norm(sight, axis=1)[:, None],
        distance_m=rng.uniform(0.0, 10.0, count),
        depth_sigma_m=rng.uniform(0.0, 0.8, count),
        velocity=rng.normal(0.0, 1.0, (count, 3)),
        covariance=covariances(),
        own_velocity=rng.normal(0.0, 1.0, (count, 3)),
        own_covariance=covariances(),
        surface_velocity=rng.normal(0.0, 1.0, (count, 3)),
        surface_covariance=covariances(),
        ends=rng.integers(0, 40, count),
        agreement=rng.uniform(0.0, 1.0, count),
        restless=rng.random(count) < 0.5,
        restless_s=rng.uniform(0.0, 1.0, count),
        arriving_s=rng.uniform(0.0, 0.3, count),
        arrived=rng.integers(0, 40, count),
        cells=rng.integers(40, 200, count),
        keeps_area=rng.random(count) < 0.7,
        size_m=rng.uniform(0.0, 4.0, count),
        velocity_measured_s=rng.uniform(0.0, 1.0, count),
        rim_mps=rng.normal(0.0, 1.0, count),
        rim_sigmas=rng.uniform(0.0, 6.0, count),
        rim_s=rng.uniform(0.0, 0.3, count),
        approach_mps=rng.uniform(0.0, 2.0, count),
        approach_s=rng.uniform(0.0, 0.3, count),
        view_radps=rng.uniform(0.0, 1.0, count),
        growth_mps=rng.uniform(0.0, 1.0, count),
        advances=rng.random(count) < 0.5,
        border_is_guess=rng.random(count) < 0.5,
        up=np.array([0.0, -1.0, 0.0]) if rng.random() < 0.5 else None,
        trusted=trusted,
        reckoned=bool(rng.random() < 0.5),
        borne_out=float(rng.uniform(0.2, 1.0)),
    )


@given(seed=seeds, count=st.integers(0, 12), trusted=st.booleans(), dt_s=st.floats(0.0, 0.2))
def test_a_verdict_is_finite_within_bounds_and_not_raised_without_trust(
    seed: int, count: int, trusted: bool, dt_s: float
) -> None:
    rng = np.random.default_rng(seed)
    evidence, moving = rng.uniform(0.0, 1.5, count), rng.random(count) < 0.5
    verdict = judge(any_evidence(seed, count, trusted), evidence, moving, dt_s, MotionSettings())
    assert ((verdict.evidence >= 0.0) & (verdict.evidence <= 1.5)).all()
    assert ((verdict.confidence >= 0.0) & (verdict.confidence <= 1.0)).all()
    assert not (verdict.moving & (verdict.evidence == 0.0)).any()
    assert not (verdict.moving & ~moving & (verdict.evidence < 1.0)).any()
    if not trusted:
        assert (verdict.evidence <= evidence).all()
