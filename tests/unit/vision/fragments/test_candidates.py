"""Which ends can be followed, what is known of their depth and how sure one step of them is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import RgbdFrame
from tests.support.painted import VGA
from vision.depth.depth_mask import SurfaceDepth
from vision.fragments.candidates import depth_along, new_fragments, on_one_surface, trackable_segments

CONFIG = PerceptionConfig()
NOBODY = np.empty((0, 2, 2), np.float32)
Ends = NDArray[np.float32]


def chequers(strength: int = 180) -> NDArray[np.uint8]:
    """Cells of 40 px: corners at their multiples; those farther right and down are stronger."""
    row, column = np.indices((12, 16))
    bright = np.where((row + column) % 2 == 0, 20 + (row + column) * strength // 30, 20)
    return np.kron(bright, np.ones((40, 40), np.int64)).astype(np.uint8)


def between(*corners: tuple[int, int]) -> Ends:
    """Segments from corner to corner, given by pairs of them, both by numbers of cells."""
    return (40.0 * np.array(corners, np.float32)).reshape(-1, 2, 2)


def found(
    segments_px: Ends, present_px: Ends = NOBODY, min_distance_px: float = 12.0, least: float = 0.0
) -> Ends:
    """Ends of those that are left, as numbers of cells."""
    ends, tensor = trackable_segments(chequers(), segments_px, present_px, min_distance_px, least)
    assert tensor.shape == (len(ends), 2, 3)
    result: Ends = np.rint(ends / 40.0)
    return result


def test_the_best_held_ones_come_first() -> None:
    ends = found(between((2, 2), (3, 2), (8, 8), (9, 8), (5, 5), (6, 5)))
    np.testing.assert_array_equal(ends[:, 0], [(8, 8), (5, 5), (2, 2)])


def test_better_trackable_of_two_fragments_at_one_place_stays() -> None:
    """It is held as well as the weaker one of its ends is."""
    shared = between((4, 4), (8, 8), (8, 8), (12, 8))
    np.testing.assert_array_equal(found(shared), [[(8, 8), (12, 8)]])
    # A place is taken even by one that is left out itself, for its other end.
    chain = between((4, 4), (8, 8), (8, 8), (12, 8), (12, 8), (12, 9))
    np.testing.assert_array_equal(found(chain), [[(12, 8), (12, 9)]])


def test_candidate_beside_an_existing_fragment_is_dropped() -> None:
    segments = between((2, 2), (3, 2), (8, 8), (9, 8))
    ends, _ = trackable_segments(chequers(), segments, NOBODY, 12.0)
    for place in ends.reshape(-1, 2):
        present = np.array([[[400.0, 20.0], place]], np.float32)
        assert len(found(segments, present)) == 1


def test_both_ends_at_one_place_are_no_segment() -> None:
    one = between((4, 4), (4, 4))
    assert len(found(one, min_distance_px=0.0)) == 0


def test_ends_too_near_to_each_other_are_no_segment() -> None:
    level = between((4, 4), (5, 4))
    (ends,), _ = trackable_segments(chequers(), level, NOBODY, 0.0)
    distance_px = float(np.linalg.norm(ends[0] - ends[1]))
    assert 30.0 < distance_px < 50.0
    assert len(found(level, min_distance_px=distance_px - 0.01)) == 1
    assert len(found(level, min_distance_px=distance_px + 0.01)) == 0


def test_weakly_held_ones_are_left_out_where_that_is_asked_for() -> None:
    weak = trackable_segments(chequers(), between((2, 2), (3, 2)), NOBODY, 12.0)[1][0]
    smaller = np.linalg.eigvalsh([[[uu, uv], [uv, vv]] for uu, uv, vv in weak.astype(float)])[:, 0].min()
    both = between((2, 2), (3, 2), (8, 8), (9, 8))
    assert len(found(both, least=0.99 * smaller)) == 2
    assert len(found(both, least=1.01 * smaller)) == 1


def test_no_candidates_give_no_fragments() -> None:
    ends, tensor = trackable_segments(chequers(), NOBODY, between((2, 2), (3, 2)), 12.0)
    assert ends.shape == (0, 2, 2)
    assert tensor.shape == (0, 2, 3)
    assert on_one_surface(np.empty((0, 5)), CONFIG).shape == (0,)


def frame(depth: NDArray[np.uint16]) -> RgbdFrame:
    return RgbdFrame(np.zeros((480, 640, 3), np.uint8), depth, 0.001, 0, 0.0, 0, VGA)


def test_depth_along_a_segment_goes_from_end_to_end() -> None:
    depth = np.tile(np.arange(1000, 1640, dtype=np.uint16), (480, 1))
    segments = np.array([[[100.0, 50.0], [300.0, 50.0]], [[300.0, 90.0], [100.0, 50.0]]], np.float32)
    near_m = depth_along(segments, frame(depth), CONFIG).near_m
    expected = np.array([1.1, 1.15, 1.2, 1.25, 1.3])
    np.testing.assert_allclose(near_m, [expected, expected[::-1]], atol=0.005)


NAN = float("nan")


@pytest.mark.parametrize(
    ("near_m", "good"),
    [
        ([2.0, 2.0, 2.0, 2.0, 2.0], True),
        # Inverse depth runs straight, depth itself does not: 1/2 to 1/4 by sixteenths.
        ([2.0, 16 / 7, 16 / 6, 16 / 5, 4.0], True),
        ([2.0, 2.5, 3.0, 3.5, 4.0], False),
        ([2.0, 2.0, 2.3, 2.0, 2.0], False),
        # One hole, not at an end and not two.
        ([2.0, 2.0, NAN, 2.0, 2.0], True),
        ([2.0, NAN, NAN, 2.0, 2.0], False),
        ([NAN, 2.0, 2.0, 2.0, 2.0], False),
        ([2.0, 2.0, 2.0, 2.0, NAN], False),
        ([2.0, NAN, 2.3, 2.0, 2.0], False),
        ([NAN] * 5, False),
    ],
)
def test_depth_along_a_segment_decides_whether_it_is_on_one_surface(near_m: list[float], good: bool) -> None:
    # The gate at 2 m: 0.05 + 3 (0.005 + 0.0075 * 4) = 0.155.
    assert on_one_surface(np.array([near_m]), CONFIG).tolist() == [good]


def covariance(tensor: list[float], sigma_px: float = 0.15) -> list[float]:
    """xx, xy, yy of the second of two segments, at its second end."""
    ends = np.zeros((3, 2, 2), np.float32)
    held = np.full((3, 2, 3), 1e4, np.float32)
    held[2, 1] = tensor
    depth = np.arange(15.0).reshape(3, 5)
    settings = FragmentSettings(pixel_sigma_px=sigma_px)
    new = new_fragments(np.array([0, 2]), ends, held, SurfaceDepth(depth, depth + 0.5, depth), settings)
    np.testing.assert_array_equal(new.near_m, [[0, 4], [10, 14]])
    np.testing.assert_array_equal(new.far_m, [[0.5, 4.5], [10.5, 14.5]])
    for part in (new.ends_px, new.near_m, new.far_m, new.pixel_cov):
        assert part.dtype == np.float32
    result: list[float] = new.pixel_cov[1, 1].tolist()
    return result


def test_the_covariance_of_one_step_by_hand() -> None:
    """36 over the eigenvalues, of which noise and, from the smaller one, stairs are taken off."""
    along, across = 36.0 / (3220.0 - 220.0 - 0.05 * 5000.0), 36.0 / (5220.0 - 220.0)
    assert covariance([5220.0, 0.0, 3220.0]) == pytest.approx(
        [across + 0.0225, 0.0, along + 0.0225], rel=1e-5
    )
    assert covariance([3220.0, 0.0, 5220.0]) == pytest.approx(
        [along + 0.0225, 0.0, across + 0.0225], rel=1e-5
    )
    # The same turned by 45 degrees.
    mean, half = 0.5 * (along + across), 0.5 * (across - along)
    assert covariance([4220.0, 1000.0, 4220.0]) == pytest.approx(
        [mean + 0.0225, half, mean + 0.0225], rel=1e-5
    )


def test_end_without_gradient_has_a_sigma_of_three_and_a_half_pixels() -> None:
    assert covariance([0.0, 0.0, 0.0], sigma_px=1.0) == pytest.approx([13.0, 0.0, 13.0])
    strong = 36.0 / (1e5 - 220.0)
    assert covariance([1e5, 0.0, 0.0]) == pytest.approx([strong + 0.0225, 0.0, 12.0225], rel=1e-4)


def test_new_fragments_of_none() -> None:
    depth = np.empty((0, 5))
    none = new_fragments(
        np.empty(0, np.intp),
        NOBODY,
        np.empty((0, 2, 3), np.float32),
        SurfaceDepth(depth, depth, depth),
        CONFIG.fragments,
    )
    assert none.ends_px.shape == (0, 2, 2)
    assert none.pixel_cov.shape == (0, 2, 3)
    assert none.near_m.shape == none.far_m.shape == (0, 2)
