"""Segments found in an image -> new fragments: ends that can be followed, and the depth along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import FloatArray, RgbdFrame
from vision.depth.depth_mask import SurfaceDepth, depth_sigma_m, surface_depth
from vision.fragments.edges import GreyImage
from vision.fragments.segments import lengths_px, smaller_eigenvalue, snap_to_corners

_TAKEN_PX = 6  # about half a search window: closer ends would follow the same pixels
_NOISE_STRUCTURE = 220.0  # what image noise of 3 grey levels adds to both eigenvalues over 7x7 px
_LEAST_STRUCTURE = 3.0  # of either eigenvalue: an end held so weakly is known to 3.5 px
_STAIRS = 0.05  # of the larger eigenvalue, that the stairs of a coarsely sampled edge add to the smaller one
_MATCH_SIGMA = 6.0  # grey levels by which two sights of the same patch differ
_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0], np.float32)  # where along a segment its depth is read


@dataclass(frozen=True, slots=True, eq=False)
class NewFragments:
    """ends_px (N, 2, 2), near_m and far_m (N, 2), pixel_cov (N, 2, 3): xx, xy, yy of one flow step, px^2."""

    ends_px: NDArray[np.float32]
    near_m: NDArray[np.float32]
    far_m: NDArray[np.float32]
    pixel_cov: NDArray[np.float32]


NOTHING_NEW = NewFragments(
    np.empty((0, 2, 2), np.float32),
    np.empty((0, 2), np.float32),
    np.empty((0, 2), np.float32),
    np.empty((0, 2, 3), np.float32),
)


def held_ends(
    grey: GreyImage,
    segments_px: NDArray[np.float32],
    ends_px: NDArray[np.float32],
    min_distance_px: float,
    least_held: float = 0.0,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Of segments (N, 2, 2) those whose ends, moved to corners, are no nearer to each other than
    min_distance_px and no fragment's of ends_px (K, 2, 2): (M, 2, 2), the best held ones first, and the
    structure tensor at their ends (M, 2, 3). least_held: of its smaller eigenvalue at either end.
    """
    snapped, tensor = snap_to_corners(grey, segments_px)
    held = smaller_eigenvalue(tensor[..., 0], tensor[..., 1], tensor[..., 2]).min(axis=1)
    order = np.argsort(-held, kind="stable")
    snapped, tensor = snapped[order], tensor[order]
    wanted = (lengths_px(snapped) >= min_distance_px) & _not_taken(snapped, ends_px, grey.shape)
    wanted &= held[order] >= least_held
    return snapped[wanted], tensor[wanted]


def depth_along(segments_px: NDArray[np.float32], frame: RgbdFrame, config: PerceptionConfig) -> SurfaceDepth:
    """Depth along segments (N, 2, 2), from end to end: (N, 5) each."""
    along = np.empty((len(segments_px), len(_SHARES), 2), np.float32)
    for k in (0, 1):
        begin, end = segments_px[:, :1, k], segments_px[:, 1:, k]
        along[..., k] = begin + (end - begin) * _SHARES
    found = surface_depth(
        frame.depth,
        frame.depth_scale_m,
        along.reshape(-1, 2),
        config.min_depth_m,
        config.max_depth_m,
        config.depth_noise,
    )
    return SurfaceDepth(*(part.reshape(-1, 5) for part in (found.near_m, found.far_m, found.holes)))


def new_fragments(
    picked: NDArray[np.intp],
    segments_px: NDArray[np.float32],
    tensor: NDArray[np.float32],
    surface: SurfaceDepth,
    settings: FragmentSettings,
) -> NewFragments:
    """Those picked (M,) of segments with what held_ends and depth_along say of them."""
    return NewFragments(
        segments_px[picked],
        surface.near_m[picked, ::4].astype(np.float32),
        surface.far_m[picked, ::4].astype(np.float32),
        _flow_covariance(tensor[picked], settings.pixel_sigma_px),
    )


def on_one_surface(near_m: FloatArray, config: PerceptionConfig) -> NDArray[np.bool_]:
    """(N,) of near_m (N, 5) as in depth_along.

    Inverse depth runs straight along a segment of one plane; a segment across a depth edge jumps.
    """
    inverse = 1.0 / near_m
    straight = inverse[:, :1] + (inverse[:, 4:] - inverse[:, :1]) * _SHARES
    expected_m = 1.0 / straight[:, 1:4]
    gate_m = 0.05 + 3.0 * depth_sigma_m(expected_m, config.depth_noise)
    inside = np.abs(near_m[:, 1:4] - expected_m) <= gate_m
    # One of the three samples in between may fall into a hole.
    missing = np.isnan(near_m)
    good = (inside | missing[:, 1:4]).all(axis=1) & (missing[:, 1:4].sum(axis=1) <= 1)
    result: NDArray[np.bool_] = good & ~missing[:, 0] & ~missing[:, 4]
    return result


def _not_taken(
    candidates: NDArray[np.float32], ends_px: NDArray[np.float32], shape: tuple[int, ...]
) -> NDArray[np.bool_]:
    """Which candidates have both ends where no other fragment, old or earlier in the list, has one."""
    columns = shape[1] // _TAKEN_PX + 1
    taken = np.zeros((shape[0] // _TAKEN_PX + 1) * columns, np.bool_)
    taken[_cells(ends_px, columns).ravel()] = True
    cells = _cells(candidates, columns).ravel()
    # Writing backwards leaves in each cell the first one that wants it.
    first = np.empty(len(taken), np.intp)
    first[cells[::-1]] = np.arange(len(cells))[::-1]
    alone = (first.take(cells) == np.arange(len(cells))) & ~taken.take(cells)
    result: NDArray[np.bool_] = alone[0::2] & alone[1::2]
    return result


def _cells(ends_px: NDArray[np.float32], columns: int) -> NDArray[np.intp]:
    index = (ends_px * (1.0 / _TAKEN_PX)).astype(np.intp)
    result: NDArray[np.intp] = index[:, :, 1] * columns + index[:, :, 0]
    return result


def _flow_covariance(tensor: NDArray[np.float32], floor_px: float) -> NDArray[np.float32]:
    """(N, 2, 3) covariance of one flow step from the structure tensor (N, 2, 3): wide along an edge.

    Image noise makes every direction look structured, and so do the stairs that a strong edge has where it
    is sampled coarsely; they wander along it as it turns. Both shares are taken off first, or an end on a
    straight edge would seem as well held along the edge as across it.
    """
    uu, uv, vv = tensor[..., 0], tensor[..., 1], tensor[..., 2]
    middle, half = 0.5 * (uu + vv), 0.5 * (uu - vv)
    radius = np.sqrt(half * half + uv * uv)
    larger = np.maximum(middle + radius - _NOISE_STRUCTURE, _LEAST_STRUCTURE)
    smaller = np.maximum(middle - radius - _NOISE_STRUCTURE - _STAIRS * larger, _LEAST_STRUCTURE)
    # The inverse has the same axes and the inverse eigenvalues.
    across, along = _MATCH_SIGMA**2 / larger, _MATCH_SIGMA**2 / smaller
    mean, spread = 0.5 * (across + along), 0.5 * (across - along)
    scale = spread / np.maximum(radius, 1e-6)
    floor = floor_px**2
    result = np.empty(tensor.shape, np.float32)
    result[..., 0], result[..., 2] = mean + scale * half + floor, mean - scale * half + floor
    result[..., 1] = scale * uv
    return result
