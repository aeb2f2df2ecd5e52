"""Movers that connected depth hides in something larger: a person close to a wall is one part with it.

Two kinds of cells are cut out of a large static track and become tracks of their own: cells that have arrived
(vision/bodies/arrivals.py), and cells around fragments that no static surface explains, two that move alike
or one that has gone one way for a while. Such a track is only a suspect, which is then looked at more closely
(vision/fragments/attention.py): without further evidence it ends, and its cells go back to the track around
them. Likewise a mover that has grown over something it walks along is cut back to these cells. Terms:
vision/__init__.py.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray
from vision.bodies.judgement import IMPLAUSIBLE
from vision.bodies.tracks import Tracks
from vision.depth import connected, regions
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.depth_mask import depth_sigma_m
from vision.depth.regions import Regions
from vision.detection import Detection
from vision.motion import least_squares
from vision.motion.least_squares import FragmentVelocities

SUSPECT_EVIDENCE = 0.3  # gone in 0.09 s where nothing speaks for motion, in 0.6 s where hints do
_COMPACT_M = 1.6  # wider or deeper than any one body with what it carries: it may hide one
_BODY_M = 0.85  # nobody is wider (SINGLE_WIDTH_M of vision/bodies/division.py)
_CALM_S = 0.9  # for so long, what has come to rest is where free space was seen
_MIN_CELLS = 12  # what a track begins with (vision/bodies/births.py)
_AROUND_M = 0.2  # cells so close to a moving fragment are of its body; a body is about twice as wide
_MIN_FRAGMENTS = 2  # one alone may be an end that slides
# One alone, on somebody who walks along a wall: seen for so long, level, and surely so fast.
_LONE_S = 0.25
_LONE_MPS, _LONE_SIGMAS = 0.4, 4.0  # a slow walk, as surely as a verdict asks for
_LEVEL = 0.3  # of its speed may go up or down: an end that slides along an upright edge does
_BLOCK = np.ones((3, 3), np.uint8)
_AGREE_M = 0.3  # about a body's depth, and
_AGREE_PER_M2 = 0.015  # two sigmas of depth by the default noise


def carve(
    tracks: Tracks,
    detection: Detection,
    labels: IntGrid,
    measured: Regions,
    arrived: BoolGrid,
    velocities: FragmentVelocities,
    config: PerceptionConfig,
) -> IntGrid:
    """labels (h, w), track index + 1, with suspects cut out; they are started in tracks.

    measured: of labels. velocities: of the fragments detected. The same labels come back where there is
    nothing to cut out.
    """
    if len(tracks) == 0:
        return labels
    grid = detection.grid
    suspicious = least_squares.moving_candidates(detection.motion, detection.age_frames).nonzero()[0]
    if len(suspicious) == 0 and not arrived.any():
        return labels
    mover = tracks.mover
    # Where the lines of something wider than a body stand while a part of it arrives, somebody touches it.
    touched = tracks.stands & (tracks.calm_s >= _CALM_S) & (measured.extent_m[:, 0] > _BODY_M)
    compact = (measured.extent_m[:, 0] <= _COMPACT_M) & (
        measured.extent_m[:, 2]
        <= _COMPACT_M + 2.0 * depth_sigma_m(measured.position_m[:, 2], config.depth_noise)
    )
    searched, overgrown = ~mover & (~compact | touched), tracks.moving & ~compact
    chosen = np.zeros(len(tracks) + 1, np.bool_)
    chosen[1:] = searched | overgrown
    if not chosen.any():
        return labels
    looked_at = chosen.take(labels)
    shown = arrived & looked_at
    shown |= _around_moving_fragments(detection, velocities, suspicious, looked_at, config)
    if not shown.any():
        return labels
    chosen[1:] = searched
    inside = chosen.take(labels) if overgrown.any() else looked_at
    labels = _cut_back(tracks, detection, labels, overgrown, shown, config)
    seeds = shown & inside
    widened = cv2.dilate(seeds.view(np.uint8), _BLOCK)
    grown: BoolGrid = np.asarray(widened, np.uint8).view(np.bool_) & inside
    if np.count_nonzero(grown) < _MIN_CELLS:
        return labels
    count, parts = connected.components(grid, grown)
    cells = np.bincount(parts.ravel(), minlength=count + 1)
    keep = (cells[1:] >= _MIN_CELLS).nonzero()[0] + 1
    if len(keep) == 0:
        return labels
    number = np.zeros(count + 1, np.int32)
    number[keep] = np.arange(1, len(keep) + 1)
    own = number.take(parts)
    suspects = regions.measure(grid, own, len(keep))
    first = len(tracks)
    _start(tracks, detection, suspects, SUSPECT_EVIDENCE, config)
    return np.where(own > 0, own + first, labels).astype(np.int32)


def _cut_back(
    tracks: Tracks,
    detection: Detection,
    labels: IntGrid,
    overgrown: NDArray[np.bool_],
    shown: BoolGrid,
    config: PerceptionConfig,
) -> IntGrid:
    """labels (h, w) where movers that have grown larger than any body, over furniture they walk along, keep
    only what is shown (h, w) to move. The rest of each begins as a track that stands."""
    for track in overgrown.nonzero()[0].tolist():
        own = labels == track + 1
        widened = np.asarray(cv2.dilate((shown & own).view(np.uint8), _BLOCK), np.uint8)
        kept = widened.view(np.bool_) & own
        rest = own & ~kept
        if min(np.count_nonzero(kept), np.count_nonzero(rest)) < _MIN_CELLS:
            continue
        one = regions.measure(detection.grid, rest.astype(np.int32), 1)
        _start(tracks, detection, one, 0.0, config)
        labels = np.where(rest, np.int32(len(tracks)), labels)
    return labels


def _start(
    tracks: Tracks, detection: Detection, measured: Regions, evidence: float, config: PerceptionConfig
) -> None:
    position_m = detection.pose.apply(measured.position_m)
    tracks.start(position_m, 0.2, config.motion.max_speed_mps, evidence, detection.captured_ns)


def _around_moving_fragments(
    detection: Detection,
    velocities: FragmentVelocities,
    chosen: NDArray[np.intp],
    looked_at: BoolGrid,
    config: PerceptionConfig,
) -> BoolGrid:
    """(h, w) those cells of looked_at (h, w) that are close to the ones of fragments chosen (K,) that move in
    company, or clearly, at their depth."""
    result = np.zeros(detection.grid.depth_m.shape, np.bool_)
    motion = detection.motion
    if len(chosen) == 0:
        return result
    velocity, covariance = velocities.velocity_mps[chosen], velocities.covariance[chosen]
    position = 0.5 * (motion.static_m[2 * chosen] + motion.static_m[2 * chosen + 1])
    sigma = depth_sigma_m(position[:, 2], config.depth_noise)
    group = least_squares.cluster(position, velocity, covariance, sigma)
    company = np.bincount(group)[group] >= _MIN_FRAGMENTS
    seen_s = detection.age_frames[chosen].astype(float) * detection.dt_s
    chosen = chosen[company | _alone(seen_s, velocity, covariance, config.motion.max_speed_mps)]
    if len(chosen) == 0:
        return result
    return _near_ends(
        detection.grid, looked_at, detection.ends_px[chosen], detection.near_m[chosen], detection.camera.fx
    )


def _alone(
    seen_s: FloatArray, velocity_mps: FloatArray, covariance: FloatArray, max_speed_mps: float
) -> NDArray[np.bool_]:
    """(K,) fragments, seen for seen_s (K,), whose velocity (K, 3), in the camera's axes, with covariance
    (K, 3, 3) needs no other one beside it to be believed."""
    speed = np.sqrt(np.square(velocity_mps).sum(axis=1))
    # Along its way: v' C v / v'v is the variance there.
    along = np.einsum("ki,kij,kj->k", velocity_mps, covariance, velocity_mps)
    sure = (speed >= _LONE_MPS) & (speed**2 > _LONE_SIGMAS * np.sqrt(along))
    level = np.abs(velocity_mps[:, 1]) <= _LEVEL * speed
    result: NDArray[np.bool_] = (seen_s >= _LONE_S) & sure & level & (speed <= IMPLAUSIBLE * max_speed_mps)
    return result


def _near_ends(
    grid: DepthGrid,
    looked_at: BoolGrid,
    ends_px: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    focal_px: float,
) -> BoolGrid:
    """(h, w) those cells of looked_at (h, w) that are close to the ends (N, 2, 2), at their depth (N, 2)."""
    result = np.zeros(grid.depth_m.shape, np.bool_)
    depth = depth_m.ravel().astype(float)
    known = np.isfinite(depth)
    ends, depth = ends_px.reshape(-1, 2)[known].astype(float), depth[known]
    if len(depth) == 0:
        return result
    rows, columns = grid.rows(ends[:, 1]), grid.columns(ends[:, 0])
    # No cell farther away than this can be close to an end: the others need not be looked at.
    reach_cells = int(_AROUND_M * focal_px / (grid.step_px * float(depth.min()))) + 2
    top, left = max(int(rows.min()) - reach_cells, 0), max(int(columns.min()) - reach_cells, 0)
    box = slice(top, int(rows.max()) + reach_cells + 1), slice(left, int(columns.max()) + reach_cells + 1)
    if not looked_at[box].any():
        return result
    rows, columns = rows - top, columns - left
    seeds = np.ones(result[box].shape, np.uint8)
    seeds[rows, columns] = 0
    distance, found = cv2.distanceTransformWithLabels(seeds, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    label: IntGrid = np.asarray(found, np.int32)
    there = np.zeros(int(label.max()) + 1)
    there[label[rows, columns]] = depth
    nearest_m = there.take(label)
    reach = np.asarray(distance) * (grid.step_px / (_AROUND_M * focal_px)) * nearest_m <= 1.0
    agrees = np.abs(grid.depth_m[box] - nearest_m) <= _AGREE_M + _AGREE_PER_M2 * nearest_m * nearest_m
    result[box] = reach & agrees & looked_at[box]
    return result
