"""Which fragment belongs to which track: the one on whose visible surface, and at whose depth, it lies.

Terms (fragment, surface, track): vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray
from vision.bodies.tracks import Tracks
from vision.depth.connected import IntGrid
from vision.depth.depth_mask import depth_sigma_m
from vision.detection import Detection
from vision.motion.least_squares import long_static

# Where along a fragment its body is looked for, and how much above: a lower edge lies on the floor. Last,
# beside it: an outline lies on the rim, where the cells may be those of the body behind.
_ALONG = np.array([0.5, 0.15, 0.85, 0.5, 0.15, 0.85, 0.5, 0.5])
_ABOVE_PX = np.array([0.0, 0.0, 0.0, 8.0, 8.0, 8.0, 0.0, 0.0])
_BESIDE_PX = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -8.0, 8.0])
_ON_IT = 6  # places that are on the fragment: one of these at least has to agree, not only one beside it
_LEAST_GATE_M = 0.3  # about a body's depth: an outline may be as far back as its side
_SAME_DEPTH_M = 0.05  # closer than this, beside the noise, is at the same depth: no surface is even
_NEARER = 0.1  # per metre, against the depth by which a fragment is off


def adopt(
    tracks: Tracks, detection: Detection, labels: IntGrid, owner: NDArray[np.int64], noise: DepthNoise
) -> NDArray[np.int64]:
    """(N,) id of the track that each fragment of detection belongs to, -1 for none.

    labels (h, w): track index + 1 of each cell. owner (N,): as of the frame before. A line that has long
    lain still, on the floor or a wall, does not go to a mover that passes by.
    """
    grid = detection.grid
    if len(tracks) == 0 or len(owner) == 0:
        return np.full(len(owner), -1, np.int64)
    ends = detection.ends_px.astype(float)
    u, v = (ends[:, :1, k] + (ends[:, 1:, k] - ends[:, :1, k]) * _ALONG for k in (0, 1))
    cells = grid.cells(u + _BESIDE_PX, v - _ABOVE_PX)
    there = labels.ravel().take(cells)
    near = np.fmin(detection.near_m[:, 0], detection.near_m[:, 1]).astype(float)
    depth = grid.depth_m.ravel().take(cells)
    gap = np.abs(depth - near[:, None])
    sigma = depth_sigma_m(near, noise)[:, None]
    agrees = (there > 0) & (gap <= _LEAST_GATE_M + 2.0 * sigma)
    # Of two bodies in one place of the image, the one at whose depth the fragment is; where noise hides
    # the difference, the nearer one: an outline belongs to what is in front.
    off = np.maximum(gap - _SAME_DEPTH_M - sigma, 0.0) + _NEARER * depth
    best = np.where(agrees, off, np.inf).argmin(axis=1)
    track = there[np.arange(len(there)), best] - 1
    ids = np.where(agrees[:, :_ON_IT].any(axis=1), tracks.ids[track], -1)
    age_s: FloatArray = np.multiply(detection.age_frames, detection.dt_s, dtype=np.float64)
    still = long_static(detection.motion, age_s)
    return np.where(still & tracks.moving[track] & (ids != owner), -1, ids)
