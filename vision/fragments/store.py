"""The store of all fragments: a struct of arrays over N fragments with two ends each, with a history.

The history of the last frames gives every fragment an anchor: the direction and depth of its ends some frames
ago, at most a window of time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray, Integers, Intrinsics, Matrix, Pose, Vector
from vision.ego_motion.rolling_shutter import straight_rays
from vision.fragments.candidates import NewFragments

HISTORY = 24  # frames: enough for the window of 0.25 s at 90 frames a second
_FEWEST_PLACES = 64  # places in the history at first; it grows by doubling


@record(frozen=True, slots=True, eq=False)
class AnchorEnds:
    """Where the 2N ends of N fragments were some frames ago; the two ends of a fragment are adjacent.

    direction, origin: an end of depth d was at d * direction + origin in the fixed frame, (3, 2N).
    depth_m, far_m, depth_samples: as in FragmentStore, (2N,).
    lag_frames, lag_s: how long ago, (N,).
    """

    direction: Matrix
    origin: Matrix
    depth_m: Vector
    far_m: Vector
    depth_samples: Vector
    lag_frames: Integers
    lag_s: Vector


@dataclass(slots=True, eq=False)
class _History:
    """The last frames, in a ring buffer. Each fragment has a place in it, of P.

    ends: direction (3), depth, far depth and depth_samples of each end, (HISTORY, P, 2, 6).
    origins: of the camera in the fixed frame, (HISTORY, 3).
    stamps_ns: when the frames were taken, (HISTORY,).
    head: index of the last frame.
    comparable: how many frames the next one can be compared with.
    """

    ends: Annotated[FloatArray, "float64[:, :, :, ::1]"] = field(
        default_factory=lambda: np.full((HISTORY, _FEWEST_PLACES, 2, 6), np.nan)
    )
    origins: Matrix = field(default_factory=lambda: np.zeros((HISTORY, 3)))
    stamps_ns: Integers = field(default_factory=lambda: np.zeros(HISTORY, np.int64))
    head: int = -1
    comparable: int = 0


class FragmentStore:
    """Holds the fragments and their history. Only the detector changes it.

    ids: in ascending order, (N,).
    ends_px: the two end points (u, v), (N, 2, 2).
    near_m, far_m: depth of the near and the far surface measured in this frame, (N, 2).
    depth_m: depth of the near surface averaged over depth_samples frames, as for a static point, (N, 2).
    age_frames: frames since it was found, (N,).
    pixel_cov: xx, xy, yy of one flow step at each end, px^2, (N, 2, 3).
    error_px: of where each end was expected in this frame (optical_flow.py); inf for new ones, (N, 2).
    body_only: found on a body that may move (vision/fragments/attention.py), so not used for the camera's
        motion, (N,).

    Each fragment keeps its place in the history for life, so that nothing has to be moved when fragments are
    lost or found.
    """

    def __init__(self) -> None:
        self._next_id = 0
        self.clear()

    def clear(self) -> None:
        """Forget everything but the next id: an id is never used twice."""
        self.ids = np.empty(0, np.int64)
        self.ends_px = np.empty((0, 2, 2), np.float32)
        self.near_m = np.empty((0, 2), np.float32)
        self.far_m = np.empty((0, 2), np.float32)
        self.depth_m = np.empty((0, 2), np.float32)
        self.depth_samples = np.empty((0, 2), np.float32)
        self.age_frames = np.empty(0, np.intp)
        self.pixel_cov = np.empty((0, 2, 3), np.float32)
        self.error_px = np.empty((0, 2), np.float32)
        self.body_only = np.empty(0, np.bool_)
        self._place = np.empty(0, np.intp)
        self._history = _History()

    def __len__(self) -> int:
        return len(self.ids)

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Drop all but the chosen fragments."""
        if chosen.all():
            return
        kept = chosen.nonzero()[0]  # taking by index is several times as fast as by mask
        self.ids = self.ids.take(kept)
        self.ends_px = self.ends_px.take(kept, axis=0)
        self.near_m = self.near_m.take(kept, axis=0)
        self.far_m = self.far_m.take(kept, axis=0)
        self.depth_m = self.depth_m.take(kept, axis=0)
        self.depth_samples = self.depth_samples.take(kept, axis=0)
        self.age_frames = self.age_frames.take(kept)
        self.pixel_cov = self.pixel_cov.take(kept, axis=0)
        self.error_px = self.error_px.take(kept, axis=0)
        self.body_only = self.body_only.take(kept)
        self._place = self._place.take(kept)

    def add(self, new: NewFragments, body_only: bool = False) -> None:
        """Add new fragments, seen for the first time in the frame that is committed next."""
        count = len(new.ends_px)
        if count == 0:
            return
        self.ids = np.concatenate((self.ids, np.arange(self._next_id, self._next_id + count)))
        self._next_id += count
        self.ends_px = np.concatenate((self.ends_px, new.ends_px))
        self.near_m = np.concatenate((self.near_m, new.near_m))
        self.far_m = np.concatenate((self.far_m, new.far_m))
        self.depth_m = np.concatenate((self.depth_m, new.near_m))
        self.depth_samples = np.concatenate((self.depth_samples, np.ones((count, 2), np.float32)))
        self.age_frames = np.concatenate((self.age_frames, np.zeros(count, np.intp)))
        self.pixel_cov = np.concatenate((self.pixel_cov, new.pixel_cov))
        self.error_px = np.concatenate((self.error_px, np.full((count, 2), np.inf, np.float32)))
        self.body_only = np.concatenate((self.body_only, np.full(count, body_only)))
        self._place = np.concatenate((self._place, self._free_places(count)))

    def _free_places(self, count: int) -> NDArray[np.intp]:
        """Free places in the history; it grows if there are too few."""
        history = self._history
        free = np.ones(history.ends.shape[1], np.bool_)
        free[self._place] = False
        places = free.nonzero()[0]
        missing = count - len(places)
        if missing > 0:
            more = max(missing, len(free))
            room = np.full((HISTORY, more, 2, 6), np.nan)
            history.ends = np.concatenate((history.ends, room), axis=1)
            places = np.concatenate((places, np.arange(len(free), len(free) + more)))
        return places[:count]

    def commit(self, stamp_ns: int, pose: Pose, camera: Intrinsics, sweep_rad: FloatArray) -> None:
        """Write the present ends into the history, with the camera pose of this frame.

        sweep_rad (2,): see straight_rays.
        """
        history = self._history
        history.head = (history.head + 1) % HISTORY
        history.comparable = min(history.comparable + 1, HISTORY)
        direction = pose.rotation @ straight_rays(self.ends_px.reshape(-1, 2), camera, sweep_rad).T
        entries = _entries(direction, self.depth_m, self.far_m, self.depth_samples)
        history.ends[history.head, self._place] = entries
        history.stamps_ns[history.head] = stamp_ns
        history.origins[history.head] = pose.translation_m
        self.age_frames += 1

    def break_history(self) -> None:
        """Do not look back beyond the frame that is committed next: the motion to it is not known.

        So it is not known either how far the ends are from where they should be expected.
        """
        self._history.comparable = 0
        self.error_px = np.full_like(self.error_px, np.inf)

    def anchors(self, now_ns: int, window_s: float) -> AnchorEnds:
        """The oldest entry of each fragment that is at most window_s old, but no newer than the last frame.

        Call between optical flow and commit: the history then ends with the frame before.
        """
        return self._look_back(now_ns, self._history.comparable, window_s)

    def last_entries(self, now_ns: int) -> AnchorEnds:
        """The last entry of each fragment: that of the frame before."""
        return self._look_back(now_ns, 1, np.inf)

    def _look_back(self, now_ns: int, max_frames: int, window_s: float) -> AnchorEnds:
        """As anchors, looking back by max_frames at most."""
        ends, origin, lag, lag_s = _sights(
            self._history, self._place, self.age_frames, now_ns, max_frames, window_s
        )
        return AnchorEnds(
            direction=ends[:3],
            origin=origin,
            depth_m=ends[3],
            far_m=ends[4],
            depth_samples=ends[5],
            lag_frames=lag,
            lag_s=lag_s,
        )


@compiled("float64[:, :], float32[:, :], float32[:, :], float32[:, :]")
def _entries(
    direction: FloatArray,
    depth_m: NDArray[np.float32],
    far_m: NDArray[np.float32],
    depth_samples: NDArray[np.float32],
) -> FloatArray:
    """(N, 2, 6) what a frame adds to the history. direction (3, 2N): of the ends in the fixed frame."""
    entries = np.empty((len(depth_m), 2, 6))
    for n in range(len(depth_m)):
        for end in range(2):
            for i in range(3):
                entries[n, end, i] = direction[i, 2 * n + end]
            entries[n, end, 3], entries[n, end, 4] = depth_m[n, end], far_m[n, end]
            entries[n, end, 5] = depth_samples[n, end]
    return entries


@compiled(_History, "int64[::1], int64[::1], int64, int64, float64")
def _sights(
    history: _History,
    place: NDArray[np.intp],
    age_frames: NDArray[np.intp],
    now_ns: int,
    max_frames: int,
    window_s: float,
) -> tuple[FloatArray, FloatArray, NDArray[np.intp], FloatArray]:
    """The oldest entry of each fragment within window_s, or else the last one.

    Returns the ends (6, 2N), the camera's position then (3, 2N), and the age in frames and seconds, (N,)
    each.
    """
    stamps_ns, head, within = history.stamps_ns, history.head, 0
    for back in range(max_frames):
        if (now_ns - stamps_ns[(head - back) % HISTORY]) * 1e-9 <= window_s:
            within += 1
    count = len(place)
    ends, origin = np.empty((6, 2 * count)), np.empty((3, 2 * count))
    lag_frames, lag_s = np.empty(count, np.intp), np.empty(count)
    for n in range(count):
        lag = min(max(age_frames[n], 1), max(within, 1))
        frame = (head - lag + 1) % HISTORY
        lag_frames[n], lag_s[n] = lag, (now_ns - stamps_ns[frame]) * 1e-9
        for column in range(2 * n, 2 * n + 2):
            for k in range(6):
                ends[k, column] = history.ends[frame, place[n], column - 2 * n, k]
            for k in range(3):
                origin[k, column] = history.origins[frame, k]
    return ends, origin, lag_frames, lag_s
