from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from hal.types import FloatArray, Intrinsics
from sim.rendering.depth_noise import BAND_ROWS, DepthSensor
from sim.rendering.raster import Float32Image

K = Intrinsics(320, 240, 305.0, 305.0, 159.5, 119.5)
CLEAN = SimulatedCameraConfig(depth_noise="none", hole_ratio=0.0, depth_edges=False)
NOISY = CLEAN.model_copy(update={"depth_noise": "realsense"})


def wall(z_m: float) -> Float32Image:
    return np.full((K.height, K.width), 1.0 / z_m, np.float32)


def shadows(sensor: DepthSensor, inverse_depth: Float32Image) -> NDArray[np.bool_]:
    """Of a whole image, band by band."""
    bands = range(0, len(inverse_depth), BAND_ROWS)
    return np.concatenate([sensor.shadows(inverse_depth[first : first + BAND_ROWS]) for first in bands])


def measured(config: SimulatedCameraConfig, z_m: float, frames: int = 24) -> FloatArray:
    sensor = DepthSensor(config, K, seed=3)
    images = [sensor.measure(wall(z_m), frame) for frame in range(frames)]
    return np.stack(images).astype(np.float64) * 0.001


def test_without_noise_depth_is_exact_in_steps_of_a_millimetre() -> None:
    assert np.abs(measured(CLEAN, 2.3456, frames=1) - 2.346).max() < 1e-9


@pytest.mark.parametrize(("model", "z_m", "sigma_m"), [
    ("realsense", 1.0, 0.0075), ("realsense", 2.0, 0.030), ("realsense", 4.0, 0.120),
    ("paper", 2.0, 0.002), ("paper", 9.0, 0.0405),
])  # fmt: skip
def test_sigma_grows_with_the_square_of_the_distance(model: str, z_m: float, sigma_m: float) -> None:
    config = CLEAN.model_copy(update={"depth_noise": model})
    depth = measured(config, z_m)
    assert depth.std() == pytest.approx(sigma_m, rel=0.06)
    assert depth.mean() == pytest.approx(z_m, rel=0.002)


def test_the_papers_camera_has_5_cm_at_10_m() -> None:
    config = CLEAN.model_copy(update={"depth_noise": "paper", "depth_max_m": 12.0})
    assert measured(config, 10.0).std() == pytest.approx(0.05, rel=0.06)


def test_noise_is_alike_at_neighbours_and_unalike_far_away() -> None:
    noise = measured(NOISY, 2.0) - 2.0
    power = (noise * noise).mean()
    correlation = {lag: (noise[:, :, :-lag] * noise[:, :, lag:]).mean() / power for lag in (1, 5, 30)}
    # As measured on a real camera: about 0.9, 0.4 to 0.7, and nothing.
    assert 0.82 < correlation[1] < 0.95
    assert 0.4 < correlation[5] < 0.7
    assert abs(correlation[30]) < 0.08


def test_noise_of_one_frame_is_half_that_of_the_next() -> None:
    noise = measured(NOISY, 2.0, frames=40) - 2.0
    power = (noise * noise).mean()
    assert (noise[:-1] * noise[1:]).mean() / power == pytest.approx(0.5, abs=0.08)
    assert (noise[:-2] * noise[2:]).mean() / power == pytest.approx(0.0, abs=0.08)


def test_holes_have_their_share_and_move() -> None:
    config = CLEAN.model_copy(update={"hole_ratio": 0.05})
    lost = measured(config, 2.0) == 0.0
    assert lost.mean() == pytest.approx(0.05, abs=0.01)
    assert (lost[0] != lost[1]).any()
    # They are blobs, not single pixels.
    assert (lost[:, :, 1:] & lost[:, :, :-1]).mean() / lost.mean() > 0.6


@pytest.mark.parametrize(("z_m", "valid"), [(0.29, False), (0.31, True), (9.9, True), (10.1, False)])
def test_outside_its_range_it_measures_nothing(z_m: float, valid: bool) -> None:
    assert (measured(CLEAN, z_m, frames=1) > 0).all() == valid


def test_pixels_without_a_surface_have_no_depth() -> None:
    sensor = DepthSensor(NOISY, K, seed=3)
    assert not sensor.measure(np.zeros((K.height, K.width), np.float32), 0).any()


def test_the_shadow_beside_a_near_thing_is_as_wide_as_the_disparities_differ() -> None:
    scene = wall(5.0)
    scene[:, 150:200] = 1.0 / 1.0
    config = CLEAN.model_copy(update={"depth_edges": True})
    depth = DepthSensor(config, K, seed=3).measure(scene, 0)
    # 305 px * 0.05 m * (1/1 - 1/5) = 12.2 px, to the left of the near thing only, less one px of tolerance.
    lost = np.flatnonzero(depth[100] == 0)
    assert lost[-1] == 149
    assert 10 <= len(lost) <= 13
    assert (np.diff(lost) == 1).all()


def test_slanted_surfaces_cast_no_shadow_on_themselves() -> None:
    floor = np.repeat(np.linspace(0.1, 1.6, K.height, dtype=np.float32)[:, None], K.width, axis=1)
    side = np.repeat(np.linspace(0.1, 1.6, K.width, dtype=np.float32)[None], K.height, axis=0)
    config = CLEAN.model_copy(update={"depth_edges": True})
    for surface in (floor, side, side[:, ::-1]):
        assert not shadows(DepthSensor(config, K, seed=3), np.ascontiguousarray(surface)).any()


def test_same_seed_and_frame_give_the_same_bytes() -> None:
    config = SimulatedCameraConfig()
    one, two, other = (DepthSensor(config, K, seed) for seed in (5, 5, 6))
    one.measure(wall(3.0), 4)
    assert one.measure(wall(2.0), 7).tobytes() == two.measure(wall(2.0), 7).tobytes()
    assert one.measure(wall(2.0), 7).tobytes() != other.measure(wall(2.0), 7).tobytes()
    assert one.measure(wall(2.0), 7).tobytes() != one.measure(wall(2.0), 8).tobytes()


def test_shadows_are_those_of_the_nearest_thing_anywhere_to_the_right() -> None:
    generator = np.random.default_rng(4)
    inverse = np.full((K.height, K.width), 0.15, np.float32)
    for _ in range(30):
        u, v, wide, tall = generator.integers(0, (300, 220, 60, 60)).tolist()
        inverse[v : v + tall, u : u + wide] = generator.uniform(0.2, 3.2)
    seen_at = np.arange(K.width) - np.float32(305.0 * 0.05) * inverse
    right_of = np.minimum.accumulate(seen_at[:, ::-1], axis=1)[:, ::-1]
    config = CLEAN.model_copy(update={"depth_edges": True})
    assert np.array_equal(shadows(DepthSensor(config, K, seed=3), inverse), seen_at > right_of + 1.0)
