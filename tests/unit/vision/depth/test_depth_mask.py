from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import DepthNoise, PerceptionConfig
from hal.compiled import compiled
from vision.depth.depth_mask import SurfaceDepth, surface_depth
from vision.depth.depth_noise import depth_sigma_m, depth_sigma_of

CONFIG = PerceptionConfig(min_depth_m=0.25, max_depth_m=10.0)
MIDDLE = np.array([[40.0, 30.0]])


def flat(millimetres: int) -> NDArray[np.uint16]:
    return np.full((60, 80), millimetres, np.uint16)


def at_middle(depth: NDArray[np.uint16], pixels: NDArray[np.float64] = MIDDLE) -> SurfaceDepth:
    return surface_depth(depth, 0.001, pixels, CONFIG)


@compiled("float64", DepthNoise)
def one_sigma_m(depth_m: float, noise: DepthNoise) -> float:
    return depth_sigma_of(depth_m, noise)


def test_sigma_grows_with_the_square_of_depth() -> None:
    noise = DepthNoise(floor_m=0.01, quadratic_per_m=0.005)
    np.testing.assert_allclose(depth_sigma_m(np.array([0.0, 2.0, 10.0]), noise), [0.01, 0.03, 0.51])
    assert one_sigma_m(10.0, noise) == pytest.approx(0.51)
    # The default is a real RealSense: 19 cm at 5 m.
    assert depth_sigma_m(np.array([5.0]), DepthNoise())[0] == pytest.approx(0.19, abs=0.005)


def test_an_end_on_one_surface_has_one_depth() -> None:
    found = at_middle(flat(2345))
    np.testing.assert_allclose(found.near_m, [2.345], rtol=1e-6)
    np.testing.assert_allclose(found.far_m, [2.345], rtol=1e-6)


def test_the_nearer_surface_at_an_edge_and_what_lies_behind() -> None:
    depth = flat(4000)
    depth[:, :41] = 2000  # the edge runs through the point
    found = at_middle(depth)
    np.testing.assert_allclose(found.near_m, [2.0], rtol=1e-6)
    np.testing.assert_allclose(found.far_m, [4.0], rtol=1e-6)
    # Also where the edge pixel itself already shows the background.
    depth[:, :41] = 4000
    depth[:, :39] = 2000
    np.testing.assert_allclose(at_middle(depth).near_m, [2.0], rtol=1e-6)


def test_far_surface_may_lie_beyond_the_depth_limit() -> None:
    """Else the texture of a distant wall would be that of the tree before it, and the tree would go away."""
    depth = flat(14_000)
    depth[:, :41] = 6000
    found = at_middle(depth)
    np.testing.assert_allclose(found.near_m, [6.0], rtol=1e-6)
    np.testing.assert_allclose(found.far_m, [14.0], rtol=1e-6)
    # What is nearer than the limit does not count what is beyond, however little: noise of 0.1 m.
    depth[:, 41:], depth[:, :41] = 10_050, 9950
    np.testing.assert_allclose(at_middle(depth).near_m, [9.95], rtol=1e-6)


def test_a_corner_of_a_body_is_the_body() -> None:
    depth = flat(4000)
    depth[:31, :41] = 2000
    np.testing.assert_allclose(at_middle(depth).near_m, [2.0], rtol=1e-6)


def test_single_near_pixels_are_no_surface() -> None:
    depth = flat(4000)
    depth[30, 40] = 1000
    depth[27, 43] = 900
    np.testing.assert_allclose(at_middle(depth).near_m, [4.0], rtol=1e-6)


@pytest.mark.parametrize("millimetres", [0, 200, 10_050, 65_535])
def test_outside_the_depth_mask_nothing_is_known(millimetres: int) -> None:
    found = at_middle(flat(millimetres))
    assert np.isnan(found.near_m).all()
    assert np.isnan(found.far_m).all()


def test_the_limit_is_10_metres() -> None:
    np.testing.assert_allclose(at_middle(flat(9990)).near_m, [9.99], rtol=1e-6)


def test_with_a_small_unit_depth_ends_where_16_bits_do() -> None:
    """65535 units of 0.1 mm are 6.55 m or anything beyond."""
    found = [surface_depth(flat(raw), 1e-4, MIDDLE, CONFIG).near_m[0] for raw in (65_000, 65_535)]
    assert found[0] == pytest.approx(6.5)
    assert np.isnan(found[1])


def test_holes_do_not_pull_the_depth_towards_zero() -> None:
    depth = flat(3000)
    depth[::2] = 0
    np.testing.assert_allclose(at_middle(depth).near_m, [3.0], rtol=1e-6)
    lonely = flat(0)
    lonely[30, 40] = 3000
    assert np.isnan(at_middle(lonely).near_m).all()


def test_points_at_the_rim_and_none_at_all() -> None:
    rim = np.array([[0.0, 0.0], [79.0, 59.0]])
    np.testing.assert_allclose(at_middle(flat(1500), rim).near_m, [1.5, 1.5], rtol=1e-6)
    assert at_middle(flat(1500), np.empty((0, 2))).near_m.shape == (0,)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (79.0, 59.0), (85.0, -4.0)])
def test_close_to_the_border_depth_is_read_within_the_image(corner: tuple[float, float]) -> None:
    """The 13 px around the point that lie within the image, and nothing of the opposite side."""
    depth = flat(9000)
    depth[:13, :13] = depth[-13:, -13:] = depth[:13, -13:] = 2000
    found = at_middle(depth, np.array([corner]))
    np.testing.assert_allclose(found.near_m, [2.0], rtol=1e-6)
    np.testing.assert_allclose(found.far_m, [2.0], rtol=1e-6)
