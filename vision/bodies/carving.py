"""Suspects: possible movers, cut out of a larger static track with which connected depth merges them.

A person close to a wall is one part with it. Two kinds of cells are cut out of a large static track and begin
a track of their own:

* cells that have arrived (vision/bodies/arrivals.py);
* cells around fragments that no static surface explains: two or more that move alike, or one that has moved
  clearly for a while.

Such a track is a suspect. It is looked at more closely (vision/fragments/attention.py). Without further
evidence it ends, and its cells go back to the track around them. Likewise a mover that has grown over
something it moves along is cut back to these cells.

This module finds the cuts; vision/bodies/cutting.py starts the tracks. Terms: vision/__init__.py.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise, PerceptionConfig
from hal.compiled import compiled
from hal.types import FloatArray
from vision.bodies.arrivals import ARRIVED_UP_TO_S, Changes
from vision.bodies.births import MIN_CELLS
from vision.bodies.cutting import Cut
from vision.bodies.ends import near_ends
from vision.bodies.masks import cells_of
from vision.bodies.sizes import SINGLE_WIDTH_M
from vision.bodies.tracks import Tracks
from vision.depth import connected
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.depth_noise import depth_sigma_m, depth_sigma_of
from vision.depth.regions import Regions
from vision.detection import Detection
from vision.motion import moving_fragments
from vision.motion.least_squares import FragmentVelocities
from vision.motion.velocities import EndResiduals
from vision.numerics.order import median

# Score at the start. It is used up in 0.14 s where nothing speaks for motion, in 0.9 s where something does:
# of somebody far away, in front of a wall, few frames prove that he moves.
SUSPECT_EVIDENCE = 0.45
_COMPACT_M = 1.6  # a track wider or deeper than one body with its load may hide another body
_MIN_FRAGMENTS = 2  # that move alike; one alone may be an end that slides
# One fragment alone, on a person who walks along a wall, is believed if it has been seen for this long, moves
# at this speed (a slow walk) with a certainty of this many sigmas (as a verdict needs), and moves level.
_LONE_S = 0.25
_LONE_MPS, _LONE_SIGMAS = 0.4, 4.0
_LEVEL = 0.3  # maximum vertical share of its speed: an end that slides along an upright edge has more
_BLOCK = np.ones((3, 3), np.uint8)


def cuts(
    tracks: Tracks,
    detection: Detection,
    labels: IntGrid,
    measured: Regions,
    changes: Changes,
    velocities: FragmentVelocities,
    config: PerceptionConfig,
) -> list[Cut]:
    """What is to be cut out: the static rest of overgrown movers, then suspects.

    labels (h, w): track index + 1. measured: regions of labels. changes: since earlier frames. velocities: of
    the fragments of detection.
    """
    if len(tracks) == 0:
        return []
    suspicious = moving_fragments.moving_candidates(detection.motion, detection.age_frames).nonzero()[0]
    if len(suspicious) == 0 and not changes.arrived.any():
        return []
    searched, overgrown = _may_hide_mover(tracks, measured, tracks.mover, config.depth_noise)
    asked = searched | overgrown
    if not asked.any():
        return []
    search_area = cells_of(labels, asked)
    moving_cells = changes.arrived & search_area
    moving_cells |= _around_moving_fragments(detection, velocities, suspicious, search_area, config)
    if not moving_cells.any():
        return []
    rests = _static_rests(detection.grid, labels, overgrown, moving_cells, changes.stayed, config.depth_noise)
    inside = cells_of(labels, searched) if overgrown.any() else search_area
    return rests + _suspects(detection.grid, moving_cells & inside, inside)


def _suspects(grid: DepthGrid, seeds: BoolGrid, inside: BoolGrid) -> list[Cut]:
    """Suspects: seeds (h, w) and the cells of inside (h, w) around them, where enough are connected."""
    widened = cv2.dilate(seeds.view(np.uint8), _BLOCK)
    grown: BoolGrid = np.asarray(widened, np.uint8).view(np.bool_) & inside
    if np.count_nonzero(grown) < MIN_CELLS:
        return []
    count, parts = connected.components(grid, grown)
    each = [np.flatnonzero(parts == number) for number in range(1, count + 1)]
    return [Cut(cells, SUSPECT_EVIDENCE) for cells in each if len(cells) >= MIN_CELLS]


@compiled(Tracks, Regions, "boolean[:]", DepthNoise)
def _may_hide_mover(
    tracks: Tracks, measured: Regions, mover: NDArray[np.bool_], noise: DepthNoise
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(T,) static tracks that may hide a mover; and (T,) movers that have grown larger than any body."""
    searched, overgrown = np.zeros(len(mover), np.bool_), np.zeros(len(mover), np.bool_)
    for t in range(len(mover)):
        width_m, depth_m = measured.extent_m[t, 0], measured.position_m[t, 2]
        sigma_m = depth_sigma_of(depth_m, noise)
        compact = width_m <= _COMPACT_M and measured.extent_m[t, 2] <= _COMPACT_M + 2.0 * sigma_m
        calm = tracks.surely_static[t] and tracks.no_evidence_s[t] >= ARRIVED_UP_TO_S
        # If the fragments of something wider than a body stand still while part of it arrives, somebody
        # touches it.
        touched = calm and width_m > SINGLE_WIDTH_M
        searched[t] = not mover[t] and (not compact or touched)
        overgrown[t] = tracks.moving[t] and not compact
    return searched, overgrown


def _static_rests(
    grid: DepthGrid,
    labels: IntGrid,
    overgrown: NDArray[np.bool_],
    moving_cells: BoolGrid,
    stayed: BoolGrid,
    noise: DepthNoise,
) -> list[Cut]:
    """Of overgrown movers (T,), all but the cells that move (moving_cells, (h, w)).

    They have grown over furniture they move along, so the rest of each begins as a static track. What is as
    close to the moving cells as parts of one body are, and has not stayed (h, w), goes on with them: a leg
    would stand as a track of its own.
    """
    rests = []
    for track in overgrown.nonzero()[0].tolist():
        own = labels == track + 1
        widened = np.asarray(cv2.dilate((moving_cells & own).view(np.uint8), _BLOCK), np.uint8)
        kept = widened.view(np.bool_) & own
        if np.count_nonzero(kept) < MIN_CELLS:
            continue
        rest = np.flatnonzero(own & ~kept & ~(_of_one_body(grid, own, kept, noise) & ~stayed))
        if len(rest) >= MIN_CELLS:
            rests.append(Cut(rest, 0.0))
    return rests


def _of_one_body(grid: DepthGrid, own: BoolGrid, moving: BoolGrid, noise: DepthNoise) -> BoolGrid:
    """(h, w) cells of own within half the width of a body of the middle of moving, seen from above."""
    cells = own.ravel().nonzero()[0]
    x_m, _, z_m = grid.points(cells)
    of_moving = moving.ravel().take(cells)
    middle_x_m, middle_z_m = median(x_m[of_moving]), median(z_m[of_moving])
    sigma_m = depth_sigma_m(middle_z_m, noise)
    close = np.abs(x_m - middle_x_m) <= 0.5 * SINGLE_WIDTH_M
    close &= np.abs(z_m - middle_z_m) <= 0.5 * SINGLE_WIDTH_M + 2.0 * sigma_m
    result = np.zeros(own.shape, np.bool_)
    result.ravel()[cells[close]] = True
    return result


def _around_moving_fragments(
    detection: Detection,
    velocities: FragmentVelocities,
    chosen: NDArray[np.intp],
    search_area: BoolGrid,
    config: PerceptionConfig,
) -> BoolGrid:
    """(h, w) cells of search_area (h, w) close to moving fragments of chosen (K,), at their depth.

    A fragment counts as moving if others move alike, or if its own motion is clear enough
    (_believable_alone).
    """
    result = np.zeros(detection.grid.depth_m.shape, np.bool_)
    if len(chosen) == 0:
        return result
    position, velocity, covariance = _of_chosen(detection.motion, velocities, chosen)
    sigma = depth_sigma_m(position[:, 2], config.depth_noise)
    group = moving_fragments.cluster(position, velocity, covariance, sigma)
    company = np.bincount(group)[group] >= _MIN_FRAGMENTS
    seen_s = detection.age_frames.take(chosen).astype(float) * detection.dt_s
    chosen = chosen[company | _believable_alone(seen_s, velocity, covariance, config.motion.implausible_mps)]
    if len(chosen) == 0:
        return result
    return near_ends(
        detection.grid,
        search_area,
        detection.ends_px[chosen],
        detection.near_m[chosen],
        detection.camera.fx,
        config.depth_noise,
    )


@compiled(EndResiduals, FragmentVelocities, "int64[::1]")
def _of_chosen(
    motion: EndResiduals, velocities: FragmentVelocities, chosen: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position (K, 3), velocity (K, 3) and its covariance (K, 3, 3) of fragments chosen (K,).

    The position is the middle of the two ends, where they would be if they were static.
    """
    static_m = motion.static_m
    position, velocity = np.empty((len(chosen), 3)), np.empty((len(chosen), 3))
    spread = np.empty((len(chosen), 3, 3))
    for k in range(len(chosen)):
        n = chosen[k]
        position[k] = 0.5 * (static_m[2 * n] + static_m[2 * n + 1])
        velocity[k], spread[k] = velocities.velocity_mps[n], velocities.covariance[n]
    return position, velocity, spread


@compiled("float64[::1], float64[:, :], float64[:, :, :], float64")
def _believable_alone(
    seen_s: FloatArray, velocity_mps: FloatArray, covariance: FloatArray, most_mps: float
) -> NDArray[np.bool_]:
    """(K,) fragments whose velocity is believed without another fragment that moves alike.

    seen_s (K,): time since they were first seen. velocity_mps (K, 3), covariance (K, 3, 3): in the camera's
    axes. most_mps: faster ones are mistakes.
    """
    result = np.zeros(len(seen_s), np.bool_)
    for k in range(len(seen_s)):
        v, along = velocity_mps[k], 0.0
        speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        for i in range(3):
            for j in range(3):
                along += v[i] * covariance[k, i, j] * v[j]
        # v' C v / v'v is the variance of the speed, along the direction of motion.
        sure = speed >= _LONE_MPS and speed**2 > _LONE_SIGMAS * math.sqrt(along)
        level = abs(v[1]) <= _LEVEL * speed
        result[k] = seen_s[k] >= _LONE_S and sure and level and speed <= most_mps
    return result
