"""Trajectory classification (Table 1, second row): long point tracks, split by the rigid motion of the scene.

Corners are tracked for up to half a second. RANSAC over the points with depth gives the camera's rigid motion
between the oldest and the newest image. Trajectories that are outliers in several frames are moving. Those
that are close in space are one blob.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.evaluation.methods.baselines import ego_motion
from controller.evaluation.methods.baselines.ego_motion import Points
from controller.evaluation.methods.baselines.masks import (
    SCALE,
    Blob,
    IdTracker,
    Mask,
    half_depth_m,
    half_grey,
    half_intrinsics,
)
from controller.evaluation.types import MethodOutput
from hal.types import FloatArray, Intrinsics, Pose, RgbdFrame

_CORNERS = 400
_WINDOW = 15  # frames
_MIN_AGE = 6  # least age of the old image, in frames
_TOLERANCE_PX = 1.0  # inliers of the rigid motion
_MOVING_PX = 2.0  # a trajectory whose residual is larger gets a vote for moving
_LINK_M = 0.45  # points that are closer belong to one blob
_MIN_TRAJECTORIES = 5  # of a blob
_MIN_SHARED = 30  # trajectories that the old image and the newest must share
_VOTE_DECAY = 0.6  # weight of the votes of earlier frames


@dataclass(frozen=True, slots=True, eq=False)
class _Snapshot:
    """The trajectories in an earlier frame: ids (N,), pixels (N, 2), depth_m (N,)."""

    ids: NDArray[np.int64]
    pixels: Points
    depth_m: FloatArray


class Trajectories:
    """Keeps the corners and their positions in the last images."""

    def __init__(self) -> None:
        ego_motion.seed_ransac()
        self._previous: Mask | None = None
        self._ids = np.empty(0, np.int64)
        self._pixels: Points = np.empty((0, 2), np.float32)
        self._votes = np.empty(0)
        self._next_id = 0
        self._history: deque[_Snapshot] = deque(maxlen=_WINDOW)
        self._id_tracker = IdTracker()

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        """Odometry is not used."""
        grey, depth_m, k = half_grey(frame), half_depth_m(frame), half_intrinsics(frame.intrinsics)
        if self._previous is not None:
            tracked, found = ego_motion.track_points(self._previous, grey, self._pixels)
            self._ids, self._pixels, self._votes = self._ids[found], tracked[found], self._votes[found]
        self._previous = grey
        z_m = ego_motion.depth_at(self._pixels, depth_m)
        self._vote(k)
        moving = (self._votes > 0.5) & (z_m > 0.0)
        found_blobs = _group(self._pixels[moving], z_m[moving], k)
        self._add_corners(grey)
        self._history.append(_Snapshot(self._ids, self._pixels, ego_motion.depth_at(self._pixels, depth_m)))
        return self._id_tracker.answer(found_blobs, None)

    def _vote(self, k: Intrinsics) -> None:
        """Vote by the motion since the oldest image that shares enough trajectories with the newest."""
        self._votes = self._votes * _VOTE_DECAY
        for index, snapshot in enumerate(self._history):
            if len(self._history) - index < _MIN_AGE:
                return
            _, old, new = np.intersect1d(snapshot.ids, self._ids, assume_unique=True, return_indices=True)
            known = snapshot.depth_m[old] > 0.0
            old, new = old[known], new[known]
            if len(old) < _MIN_SHARED:
                continue
            points_m = ego_motion.back_project(snapshot.pixels[old], snapshot.depth_m[old], k)
            motion = ego_motion.rigid_motion(points_m, self._pixels[new], k, _TOLERANCE_PX)
            if motion is None:
                return
            residual_px = np.hypot(*(ego_motion.project(motion.apply(points_m), k) - self._pixels[new]).T)
            self._votes[new] += np.where(np.nan_to_num(residual_px) > _MOVING_PX, 1.0 - _VOTE_DECAY, 0.0)
            return

    def _add_corners(self, grey: Mask) -> None:
        missing = _CORNERS - len(self._ids)
        if missing < _CORNERS // 8:
            return
        new_corners = ego_motion.corners(grey, missing, self._pixels)
        self._ids = np.concatenate([self._ids, np.arange(self._next_id, self._next_id + len(new_corners))])
        self._next_id += len(new_corners)
        self._pixels = np.concatenate([self._pixels, new_corners])
        self._votes = np.concatenate([self._votes, np.zeros(len(new_corners))])


def _group(pixels: Points, z_m: FloatArray, k: Intrinsics) -> list[Blob]:
    """Single-linkage clustering in space: points closer than _LINK_M belong together."""
    points_m = ego_motion.back_project(pixels, z_m, k)
    label = np.arange(len(points_m))
    close = np.linalg.norm(points_m[:, None] - points_m[None], axis=2) <= _LINK_M
    for index in range(len(points_m)):
        merged = np.unique(label[close[index]])
        label[np.isin(label, merged)] = merged[0]
    found = []
    for cluster_label in np.unique(label):
        members = label == cluster_label
        if np.count_nonzero(members) < _MIN_TRAJECTORIES:
            continue
        low, high = pixels[members].min(axis=0) * SCALE, pixels[members].max(axis=0) * SCALE
        box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
        members_m = points_m[members]
        found.append(Blob(box, members_m.mean(axis=0), np.ptp(members_m, axis=0), 1.0))
    return found
