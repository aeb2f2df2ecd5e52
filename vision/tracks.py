"""The obstacles that are followed: struct of arrays over T tracks, in the fixed frame of the detector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision import kalman

_FIELDS = (
    "ids",
    "state",
    "covariance",
    "surface_state",
    "surface_covariance",
    "born_ns",
    "seen_ns",
    "sightings",
    "evidence",
    "moving",
    "confidence",
    "bbox_px",
    "extent_m",
    "cells",
    "fragments",
)


class Tracks:
    """state (T, 6): position and velocity; covariance (T, 6, 6); surface_state and surface_covariance: the
    same from the centres of the visible surface alone, without the fragments, as a second opinion; evidence (T,) of motion; moving (T,);
    confidence (T,) 0..1; bbox_px (T, 4); extent_m (T, 3); cells (T,) of the grid covered when last seen."""

    def __init__(self) -> None:
        self.ids = np.empty(0, np.int64)
        self.state = np.empty((0, 6))
        self.covariance = np.empty((0, 6, 6))
        self.surface_state = np.empty((0, 6))
        self.surface_covariance = np.empty((0, 6, 6))
        self.born_ns = np.empty(0, np.int64)
        self.seen_ns = np.empty(0, np.int64)
        self.sightings = np.empty(0, np.intp)
        self.evidence = np.empty(0)
        self.moving = np.empty(0, np.bool_)
        self.confidence = np.empty(0)
        self.bbox_px = np.empty((0, 4))
        self.extent_m = np.empty((0, 3))
        self.cells = np.empty(0, np.intp)
        self.fragments = np.empty(0, np.intp)
        self._next_id = 1

    def __len__(self) -> int:
        return len(self.ids)

    def clear(self) -> None:
        """Forget all tracks; ids go on."""
        self.keep(np.zeros(len(self), np.bool_))

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Drop all but the chosen tracks."""
        if chosen.all():
            return
        for name in _FIELDS:
            setattr(self, name, getattr(self, name)[chosen])

    def index_of(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """(N,) index of each track id, -1 where there is none (any more)."""
        if len(self) == 0:
            return np.full(len(ids), -1, np.intp)
        place = np.minimum(np.searchsorted(self.ids, ids), len(self) - 1)
        return np.where(self.ids[place] == ids, place, -1).astype(np.intp)

    def start(
        self, position_m: FloatArray, sigma_m: float, max_speed_mps: float, evidence: float, now_ns: int
    ) -> None:
        """Begin tracks at positions (K, 3) with unknown velocity: bounded by max_speed_mps, not zero."""
        count = len(position_m)
        spread = np.diag([sigma_m**2] * 3 + [max_speed_mps**2] * 3)
        new: dict[str, object] = {
            "ids": np.arange(self._next_id, self._next_id + count),
            "state": np.concatenate((position_m, np.zeros((count, 3))), axis=1),
            "covariance": np.tile(spread, (count, 1, 1)),
            "surface_state": np.concatenate((position_m, np.zeros((count, 3))), axis=1),
            "surface_covariance": np.tile(spread, (count, 1, 1)),
            "born_ns": np.full(count, now_ns),
            "seen_ns": np.full(count, now_ns),
            "sightings": np.zeros(count),
            "evidence": np.full(count, evidence),
            "moving": np.zeros(count),
            "confidence": np.zeros(count),
            "bbox_px": np.zeros((count, 4)),
            "extent_m": np.zeros((count, 3)),
            "cells": np.zeros(count),
            "fragments": np.zeros(count),
        }
        self._next_id += count
        for name in _FIELDS:
            old = getattr(self, name)
            setattr(self, name, np.concatenate((old, np.asarray(new[name], old.dtype))))

    def twin(self, track: int, now_ns: int) -> None:
        """Begin a track that moves as another one does: its companion, so far taken for a part of it."""
        moving, evidence = self.moving[track], float(self.evidence[track])
        state, covariance = self.state[track], self.covariance[track]
        sightings = self.sightings[track]
        self.start(state[None, :3], 0.3, 1.0, evidence, now_ns)
        self.state[-1, 3:] = state[3:]
        self.covariance[-1, 3:, 3:] = covariance[3:, 3:]
        self.moving[-1] = moving
        self.sightings[-1] = sightings

    def predict(self, dt_s: float, accel_density: float) -> None:
        """Move every track on."""
        if len(self) and dt_s > 0:
            self.state, self.covariance = kalman.predict(self.state, self.covariance, dt_s, accel_density)
            self.surface_state, self.surface_covariance = kalman.predict(
                self.surface_state, self.surface_covariance, dt_s, accel_density
            )
