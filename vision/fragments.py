"""The featured fragments as they live: kept from frame to frame, dropped when lost, renewed when thin.

Struct of arrays over N fragments with two ends each. A history of the last frames gives every fragment
an anchor: where its ends were and how deep, up to a window of time ago.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Pose

HISTORY = 24


@dataclass(frozen=True, slots=True, eq=False)
class AnchorEnds:
    """Where the ends of each fragment were lag frames ago: pixels (N, 2, 2), depth_m, far_m (N, 2) and
    looks (N, 2) as in the store, lag_frames (N,), lag_s (N,), slot (N,) of the camera pose."""

    pixels: NDArray[np.float32]
    depth_m: NDArray[np.float32]
    far_m: NDArray[np.float32]
    looks: NDArray[np.float32]
    lag_frames: NDArray[np.intp]
    lag_s: FloatArray
    slot: NDArray[np.intp]


class FragmentStore:
    """Holds the fragments and their history. Changed only by the detector.

    near_m, far_m (N, 2): depth measured in this frame. depth_m (N, 2): of the near surface, averaged over
    looks (N, 2) frames as for a static point.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget everything but the next id: an id is never used twice."""
        self._next_id = getattr(self, "_next_id", 0)
        self.ids = np.empty(0, np.int64)
        self.ends_px = np.empty((0, 2, 2), np.float32)
        self.near_m = np.empty((0, 2), np.float32)
        self.far_m = np.empty((0, 2), np.float32)
        self.depth_m = np.empty((0, 2), np.float32)
        self.looks = np.empty((0, 2), np.float32)
        self.age_frames = np.empty(0, np.intp)
        self.pixel_cov = np.empty((0, 2, 3), np.float32)
        self._history = np.empty((HISTORY, 0, 2, 5), np.float32)
        self._stamps_ns = np.zeros(HISTORY, np.int64)
        self._rotations = np.tile(np.eye(3), (HISTORY, 1, 1))
        self._translations = np.zeros((HISTORY, 3))
        self._comparable = 0
        self._head = -1

    def __len__(self) -> int:
        return len(self.ids)

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Drop all but the chosen fragments."""
        if chosen.all():
            return
        self.ids = self.ids[chosen]
        self.ends_px = self.ends_px[chosen]
        self.near_m = self.near_m[chosen]
        self.far_m = self.far_m[chosen]
        self.depth_m = self.depth_m[chosen]
        self.looks = self.looks[chosen]
        self.age_frames = self.age_frames[chosen]
        self.pixel_cov = self.pixel_cov[chosen]
        self._history = self._history[:, chosen]

    def add(
        self,
        ends_px: NDArray[np.float32],
        near_m: NDArray[np.float32],
        far_m: NDArray[np.float32],
        pixel_cov: NDArray[np.float32],
    ) -> None:
        """New fragments, seen for the first time in the frame that is committed next."""
        count = len(ends_px)
        if count == 0:
            return
        self.ids = np.concatenate((self.ids, np.arange(self._next_id, self._next_id + count)))
        self._next_id += count
        self.ends_px = np.concatenate((self.ends_px, ends_px))
        self.near_m = np.concatenate((self.near_m, near_m))
        self.far_m = np.concatenate((self.far_m, far_m))
        self.depth_m = np.concatenate((self.depth_m, near_m))
        self.looks = np.concatenate((self.looks, np.ones((count, 2), np.float32)))
        self.age_frames = np.concatenate((self.age_frames, np.zeros(count, np.intp)))
        self.pixel_cov = np.concatenate((self.pixel_cov, pixel_cov))
        room = np.full((HISTORY, count, 2, 5), np.nan, np.float32)
        self._history = np.concatenate((self._history, room), axis=1)

    def commit(self, stamp_ns: int, pose: Pose) -> None:
        """Write the present ends into the history, with the camera pose of this frame."""
        self._head = (self._head + 1) % HISTORY
        self._comparable = min(self._comparable + 1, HISTORY)
        slot = self._history[self._head]
        slot[:, :, :2] = self.ends_px
        slot[:, :, 2] = self.depth_m
        slot[:, :, 3] = self.far_m
        slot[:, :, 4] = self.looks
        self._stamps_ns[self._head] = stamp_ns
        self._rotations[self._head] = pose.rotation
        self._translations[self._head] = pose.translation_m
        self.age_frames += 1

    def break_history(self) -> None:
        """The camera's way to the frame that is committed next is not known: do not look back beyond it."""
        self._comparable = 0

    def anchors(self, now_ns: int, window_s: float) -> AnchorEnds:
        """The oldest sight of each fragment that is no older than window_s; at least the last one.

        Call between tracking and commit: the history then ends with the frame before.
        """
        back = np.arange(1, self._comparable + 1)
        slots = (self._head - back + 1) % HISTORY
        ages_s: FloatArray = np.multiply(now_ns - self._stamps_ns[slots], 1e-9, dtype=np.float64)
        reach = max(1, int(np.count_nonzero(ages_s <= window_s)))
        lag = np.clip(self.age_frames, 1, reach)
        slot = slots[lag - 1]
        rows = self._history[slot, np.arange(len(self.ids))]
        return AnchorEnds(
            rows[:, :, :2], rows[:, :, 2], rows[:, :, 3], rows[:, :, 4], lag, ages_s[lag - 1], slot
        )

    def before(self) -> tuple[NDArray[np.float32], NDArray[np.float32], Pose]:
        """Pixels (N, 2, 2) and depth_m (N, 2) in the frame before, and its camera pose."""
        rows = self._history[self._head]
        return (
            rows[:, :, :2],
            rows[:, :, 2],
            Pose(self._rotations[self._head], self._translations[self._head]),
        )

    def poses(self, slot: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Camera rotation (N, 3, 3) and translation (N, 3) of history slots (N,)."""
        return self._rotations[slot], self._translations[slot]
