"""The obstacles that are followed: struct of arrays over T tracks, in the fixed frame of the detector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision import kalman
from vision.regions import Region

_FIELDS = (
    "ids",
    "state",
    "covariance",
    "born_ns",
    "seen_ns",
    "sightings",
    "evidence",
    "moving",
    "confidence",
    "bbox_px",
    "extent_m",
    "fragments",
    "seen_now",
)


class Tracks:
    """state (T, 6): position and velocity; covariance (T, 6, 6); evidence (T,) of motion, with hysteresis;
    confidence (T,) 0..1; bbox_px (T, 4); extent_m (T, 3); seen_now (T,)."""

    def __init__(self) -> None:
        self.ids = np.empty(0, np.int64)
        self.state = np.empty((0, 6))
        self.covariance = np.empty((0, 6, 6))
        self.born_ns = np.empty(0, np.int64)
        self.seen_ns = np.empty(0, np.int64)
        self.sightings = np.empty(0, np.intp)
        self.evidence = np.empty(0)
        self.moving = np.empty(0, np.bool_)
        self.confidence = np.empty(0)
        self.bbox_px = np.empty((0, 4))
        self.extent_m = np.empty((0, 3))
        self.fragments = np.empty(0, np.intp)
        self.seen_now = np.empty(0, np.bool_)
        self._next_id = 1

    def __len__(self) -> int:
        return len(self.ids)

    def clear(self) -> None:
        """Forget all tracks; ids go on."""
        self.keep(np.zeros(len(self), np.bool_))

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Drop all but the chosen tracks."""
        for name in _FIELDS:
            setattr(self, name, getattr(self, name)[chosen])

    def index_of(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """(N,) index of each track id, -1 where there is none (any more)."""
        if len(self) == 0:
            return np.full(len(ids), -1, np.intp)
        place = np.minimum(np.searchsorted(self.ids, ids), len(self) - 1)
        return np.where(self.ids[place] == ids, place, -1).astype(np.intp)

    def start(
        self, position_m: FloatArray, velocity_mps: FloatArray, velocity_sigma_mps: float, now_ns: int
    ) -> int:
        """Begin a track; returns its index, which is the last one."""
        covariance = np.diag([0.2**2] * 3 + [velocity_sigma_mps**2] * 3)
        new: dict[str, object] = {
            "ids": self._next_id,
            "state": np.concatenate((position_m, velocity_mps)),
            "covariance": covariance,
            "born_ns": now_ns,
            "seen_ns": now_ns,
            "sightings": 0,
            "evidence": 0.0,
            "moving": False,
            "confidence": 0.0,
            "bbox_px": np.zeros(4),
            "extent_m": np.zeros(3),
            "fragments": 0,
            "seen_now": False,
        }
        self._next_id += 1
        for name in _FIELDS:
            old = getattr(self, name)
            setattr(self, name, np.concatenate((old, np.asarray(new[name], old.dtype)[None])))
        return len(self) - 1

    def predict(self, dt_s: float, accel_mps2: float) -> None:
        """Move every track on; nothing is seen yet."""
        self.seen_now[:] = False
        if len(self) and dt_s > 0:
            self.state, self.covariance = kalman.predict(self.state, self.covariance, dt_s, accel_mps2)

    def see(self, index: int, region: Region, position_m: FloatArray, noise: FloatArray, now_ns: int) -> None:
        """A track's surface was seen: position (3,) in the fixed frame with covariance noise (3, 3)."""
        state, covariance = kalman.update(
            self.state[index : index + 1],
            self.covariance[index : index + 1],
            position_m[None],
            noise[None],
            0,
        )
        self.state[index], self.covariance[index] = state[0], covariance[0]
        self.seen_ns[index] = now_ns
        self.sightings[index] += 1
        self.seen_now[index] = True
        self.bbox_px[index] = region.bbox_px
        self.extent_m[index] = region.extent_m
