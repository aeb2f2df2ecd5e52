"""Edges, contours and segments on images of a few strokes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vision.fragments.contours import find_contours
from vision.fragments.edges import find_edges
from vision.fragments.segments import (
    SNAP_PX,
    find_segments,
    hough_segments,
    lengths_px,
    longest_first,
    smaller_eigenvalue,
    snap_to_corners,
)


def empty() -> NDArray[np.uint8]:
    return np.zeros((200, 300), np.uint8)


def stroke(length_px: int, row: int = 50, first: int = 20) -> NDArray[np.uint8]:
    """A straight edge whose two end pixels are length_px apart."""
    edges = empty()
    edges[row, first : first + length_px + 1] = 255
    return edges


def test_edges_lie_where_the_grey_level_steps() -> None:
    grey = empty()
    grey[:, 150:] = 120
    columns = np.flatnonzero(find_edges(grey, 100.0).any(axis=0))
    assert len(columns) == 1
    assert columns[0] in (149, 150)


def test_a_step_below_the_threshold_is_no_edge() -> None:
    grey = empty()
    grey[:, 150:] = 20  # a Sobel response of 80
    assert find_edges(grey, 70.0).any()
    assert not find_edges(grey, 100.0).any()


@pytest.mark.parametrize(("step", "goes_on"), [(20, False), (30, True)])
def test_an_edge_goes_on_where_four_tenths_of_its_contrast_are_left(step: int, goes_on: bool) -> None:
    """From a Sobel response of 400 in the upper half down to 80 or 120 in the lower one."""
    grey = empty()
    grey[:100, 150:], grey[100:, 150:] = 100, step
    assert find_edges(grey, 250.0)[110:].any() == goes_on


def test_contours_from_32_pixels_on_are_kept() -> None:
    assert len(find_contours(stroke(32), 32.0).ends_px) >= 1
    assert len(find_contours(stroke(31), 32.0).ends_px) == 0


def test_the_two_ends_of_a_contour() -> None:
    # There and back are 64 px, cut into two pieces of at most 48 px: one there, one back.
    for ends in find_contours(stroke(32), 32.0).ends_px:
        ordered = ends[ends[:, 0].argsort()]
        np.testing.assert_allclose(ordered, [[20.0, 50.0], [52.0, 50.0]], atol=1.0)


def test_too_short_contours_are_removed_from_the_edge_image() -> None:
    edges = stroke(60) | stroke(15, row=120)
    remaining = find_contours(edges, 32.0).edges
    np.testing.assert_array_equal(remaining, stroke(60))
    assert not find_contours(stroke(15), 32.0).edges.any()


def test_long_walks_are_cut_into_pieces_with_their_ends_on_the_contour() -> None:
    edges = empty()
    cv2.rectangle(edges, (60, 40), (180, 140), 255, 1)  # a walk of 440 px
    pieces = find_contours(edges, 32.0).ends_px
    assert len(pieces) >= 10  # of at most 48 px
    assert (lengths_px(pieces) <= 48.5).all()
    ends = pieces.reshape(-1, 2).astype(int)
    assert (edges[ends[:, 1], ends[:, 0]] == 255).all()
    # Together they go all around.
    for side in (ends[:, 0] == 60, ends[:, 0] == 180, ends[:, 1] == 40, ends[:, 1] == 140):
        assert side.any()


def test_an_empty_image_has_no_contours() -> None:
    found = find_contours(empty(), 32.0)
    assert found.ends_px.shape == (0, 2, 2)
    assert not found.edges.any()


@pytest.mark.parametrize(("u", "v"), [(120, 50), (20, 150), (100, 130)])
def test_hough_finds_a_stroke_with_its_ends(u: int, v: int) -> None:
    edges = empty()
    cv2.line(edges, (20, 50), (u, v), 255, 1)
    found = hough_segments(edges, 32.0)
    assert len(found) >= 1
    longest = found[int(lengths_px(found).argmax())]
    ordered = longest[np.lexsort((longest[:, 1], longest[:, 0]))]
    np.testing.assert_allclose(ordered, sorted([(20, 50), (u, v)]), atol=3.0)


def test_hough_leaves_out_short_strokes() -> None:
    assert hough_segments(stroke(20), 32.0).shape == (0, 2, 2)


def test_segments_of_one_part_lie_in_the_whole_image() -> None:
    """A stroke by its two contours, there and back, and by Hough; nothing of a short one."""
    found = find_segments(stroke(40) | stroke(20, row=90), 32.0, (100, 30))
    assert len(found) == 3
    for ends in found:
        ordered = ends[ends[:, 0].argsort()]
        np.testing.assert_allclose(ordered, [[120.0, 80.0], [160.0, 80.0]], atol=1.0)


def test_the_longest_segment_comes_first_and_of_equal_ones_the_first() -> None:
    ends = np.zeros((4, 2, 2), np.float32)
    ends[:, 1] = [(3.0, 4.0), (0.0, 8.0), (0.0, 5.0), (0.0, 2.0)]
    np.testing.assert_array_equal(longest_first(ends), ends[[1, 0, 2, 3]])


def test_length_of_a_segment() -> None:
    ends = np.array([[[1.0, 2.0], [4.0, 6.0]], [[0.0, 0.0], [0.0, 32.0]]], np.float32)
    np.testing.assert_allclose(lengths_px(ends), [5.0, 32.0])


def test_smaller_eigenvalue_by_hand() -> None:
    # [[2, 1], [1, 2]] has 1 and 3; a diagonal matrix its entries; a straight edge 0.
    uu, uv, vv = (np.array(x, np.float32) for x in ([2.0, 5.0, 4.0], [1.0, 0.0, 2.0], [2.0, 3.0, 1.0]))
    np.testing.assert_allclose(smaller_eigenvalue(uu, uv, vv), [1.0, 3.0, 0.0], atol=1e-6)


def test_ends_are_moved_to_the_corner_nearby() -> None:
    grey = empty()
    grey[60:140, 80:200] = 180
    # The upper edge of the block, its ends found 3 px away from its corners.
    snapped, tensor = snap_to_corners(grey, np.array([[[83.0, 60.0], [196.0, 61.0]]], np.float32), SNAP_PX)
    # Anywhere within 3 px of the corner the 7x7 px around hold both edges.
    np.testing.assert_allclose(snapped, [[[79.5, 59.5], [199.5, 59.5]]], atol=3.0)
    # Both directions are held there, unlike in the middle of the edge.
    held = smaller_eigenvalue(*np.moveaxis(tensor, -1, 0))
    _, along = snap_to_corners(grey, np.array([[[140.0, 60.0], [140.0, 139.0]]], np.float32), SNAP_PX)
    assert held.min() > 1000.0
    assert smaller_eigenvalue(*np.moveaxis(along, -1, 0)).max() == pytest.approx(0.0, abs=1e-2)


def tensor_at(grey: NDArray[np.uint8], u: int, v: int) -> tuple[float, float, float]:
    """uu, uv, vv of the structure tensor over 7x7 px around one pixel."""
    patch = grey[v - 4 : v + 5, u - 4 : u + 5].astype(float)
    du, dv = 0.5 * (patch[1:-1, 2:] - patch[1:-1, :-2]), 0.5 * (patch[2:, 1:-1] - patch[:-2, 1:-1])
    return float((du * du).sum()), float((du * dv).sum()), float((dv * dv).sum())


@pytest.mark.parametrize("end_px", [(0.0, 0.0), (39.0, 29.0), (17.4, 12.6), (9.0, 20.0), (30.0, 9.0)])
@pytest.mark.parametrize("levels", [2, 256])
@pytest.mark.parametrize("reach_px", [0, 1, SNAP_PX])
def test_an_end_goes_where_it_is_held_best_and_of_equal_places_to_the_first(
    end_px: tuple[float, float], levels: int, reach_px: int
) -> None:
    """9 px from the border of the image the surroundings of all places end."""
    grey = np.random.default_rng(3).integers(0, levels, (30, 40), dtype=np.uint8)
    middle_u, middle_v = (min(max(round(x), 9), size - 10) for x, size in zip(end_px, (40, 30), strict=True))
    steps = range(-reach_px, reach_px + 1)
    around = [(middle_u + right, middle_v + down) for down in steps for right in steps]
    tensors = np.array([tensor_at(grey, u, v) for u, v in around], np.float32)
    best = int(smaller_eigenvalue(*tensors.T.copy()).argmax())
    snapped, tensor = snap_to_corners(grey, np.array([[end_px, end_px]], np.float32), reach_px)
    np.testing.assert_array_equal(snapped, [[around[best]] * 2])
    np.testing.assert_array_equal(tensor, [[tensors[best]] * 2])


def test_in_an_image_too_small_for_any_surroundings_there_are_no_ends() -> None:
    grey = np.zeros((18, 40), np.uint8)
    snapped, tensor = snap_to_corners(grey, np.empty((0, 2, 2), np.float32), SNAP_PX)
    assert snapped.shape == (0, 2, 2)
    assert tensor.shape == (0, 2, 3)
    with pytest.raises(ValueError, match="40x18"):
        snap_to_corners(grey, np.ones((1, 2, 2), np.float32), SNAP_PX)


def test_ends_at_the_rim_of_the_image_stay_inside() -> None:
    rng = np.random.default_rng(3)
    grey = rng.integers(0, 255, (200, 300), dtype=np.uint8)
    snapped, _ = snap_to_corners(grey, np.array([[[0.0, 0.0], [299.0, 199.0]]], np.float32), SNAP_PX)
    assert (snapped >= 0).all()
    assert (snapped[..., 0] < 300).all()
    assert (snapped[..., 1] < 200).all()
