"""The obstacles that are followed: struct of arrays over T tracks, in the fixed frame of the detector."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision import kalman

_TRAIL_S = 0.3
_GOING_SHARE = 0.4
_UNPROVEN_S = 0.05
_GONE_SHARE = 0.6  # of its width
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
    "has_moved",
    "confidence",
    "bbox_px",
    "box_m",
    "extent_m",
    "area_m2",
    "cells",
    "fragments",
    "clean_s",
    "growth_mps",
    "sliver",
    "trailing_m",
    "stands",
    "calm_s",
    "unrest_s",
    "unproven_s",
    "overhead",
)


class Tracks:
    """state (T, 6): position and velocity; covariance (T, 6, 6); surface_state and surface_covariance: the
    same from the centres of the visible surface alone, without the fragments, as a second opinion; evidence
    (T,) of motion; moving (T,); has_moved (T,): now or ever before; confidence (T,) 0..1; bbox_px (T, 4);
    box_m (T, 4): edges of the last box that showed the whole body, at its depth, from its centre; extent_m
    (T, 3); area_m2 (T,): averaged, up to a common factor; cells (T,) of the grid covered when last seen;
    clean_s (T,): for how long the surface's centre has told of the velocity without a break; sliver (T,): a
    mover of which hardly anything was left to see; trailing_m (T, 3): where the centre was of late, averaged;
    stands (T,): its fragments are sure of it; calm_s (T,): since when there has been no evidence, inf if
    there never was; unrest_s (T,): for how long nearly all of its ends have denied that it stands, less what
    they did not; unproven_s (T,): since anything
    proved motion; overhead (T,): seen only above the robot so far, with its lower part behind something
    nearer."""

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
        self.has_moved = np.empty(0, np.bool_)
        self.confidence = np.empty(0)
        self.bbox_px = np.empty((0, 4))
        self.box_m = np.empty((0, 4))
        self.extent_m = np.empty((0, 3))
        self.area_m2 = np.empty(0)
        self.cells = np.empty(0, np.intp)
        self.fragments = np.empty(0, np.intp)
        self.clean_s = np.empty(0)
        self.growth_mps = np.empty(0)
        self.sliver = np.empty(0, np.bool_)
        self.trailing_m = np.empty((0, 3))
        self.stands = np.empty(0, np.bool_)
        self.calm_s = np.empty(0)
        self.unrest_s = np.empty(0)
        self.unproven_s = np.empty(0)
        self.overhead = np.empty(0, np.bool_)
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
        place = np.minimum(self.ids.searchsorted(ids), len(self) - 1)
        return np.where(self.ids[place] == ids, place, -1)

    def start(
        self, position_m: FloatArray, sigma_m: float, max_speed_mps: float, evidence: float, now_ns: int
    ) -> None:
        """Begin tracks at positions (K, 3) with unknown velocity: bounded by max_speed_mps, not zero."""
        count = len(position_m)
        given: dict[str, object] = {
            "ids": np.arange(self._next_id, self._next_id + count),
            "born_ns": now_ns,
            "seen_ns": now_ns,
            "evidence": evidence,
            "trailing_m": position_m,
            "calm_s": np.inf,
        }
        given["state"] = given["surface_state"] = np.concatenate((position_m, np.zeros((count, 3))), axis=1)
        spread = np.diag([sigma_m**2] * 3 + [max_speed_mps**2] * 3)
        given["covariance"] = given["surface_covariance"] = spread
        self._next_id += count
        for name in _FIELDS:
            old = getattr(self, name)
            new = np.zeros((count, *old.shape[1:]), old.dtype)
            if name in given:
                new[...] = given[name]
            setattr(self, name, np.concatenate((old, new)))

    def twin(self, track: int, evidence: float, now_ns: int) -> None:
        """Begin a track with the velocity of another one that it was taken for a part of. It has to prove
        its motion itself: it may be what the mover passes by."""
        self.start(self.state[track : track + 1, :3], 0.3, 1.0, evidence, now_ns)
        self.state[-1, 3:] = self.state[track, 3:]

    def predict(self, dt_s: float, accel_density: float, up: FloatArray | None) -> None:
        """Move every track on. up (3,): along the floor's normal nothing keeps going; None: not known."""
        if len(self) and dt_s > 0:
            # Both filters at once: the calls cost more than what they compute.
            states = np.concatenate((self.state, self.surface_state))
            covariances = np.concatenate((self.covariance, self.surface_covariance))
            states, covariances = kalman.predict(states, covariances, dt_s, accel_density, up)
            count = len(self)
            self.state, self.surface_state = states[:count], states[count:]
            self.covariance, self.surface_covariance = covariances[:count], covariances[count:]

    def follow_trails(self, dt_s: float) -> NDArray[np.bool_]:
        """Take in where the centres are, dt_s on; (T,) whether they really go about as fast as the velocities
        say. Once a frame."""
        self.trailing_m += -math.expm1(-dt_s / _TRAIL_S) * (self.state[:, :3] - self.trailing_m)
        velocity, behind_s = self.state[:, 3:], dt_s / math.expm1(dt_s / _TRAIL_S)
        way = ((self.state[:, :3] - self.trailing_m) * velocity).sum(axis=1) / behind_s
        result: NDArray[np.bool_] = way > _GOING_SHARE * np.square(velocity).sum(axis=1)
        return result

    def overdue(self, elapsed_s: float) -> NDArray[np.bool_]:
        """(T,) movers of which nothing has proved just now that they go on, and which by their velocity are
        no longer where they were elapsed_s ago."""
        way_m = elapsed_s * np.sqrt(np.square(self.state[:, 3:]).sum(axis=1))
        gone = way_m >= _GONE_SHARE * self.extent_m[:, ::2].max(axis=1)
        result: NDArray[np.bool_] = self.moving & (self.unproven_s >= _UNPROVEN_S) & gone
        return result

    def hide(self, chosen: NDArray[np.bool_]) -> None:
        """Tracks of which nothing is to be seen any more, behind what stands there."""
        self.sliver |= chosen
        self.cells[chosen] = 0

    def locate(self, index: NDArray[np.intp], position_m: FloatArray, noise: FloatArray) -> None:
        """The centres of tracks index (K,) were seen at position_m (K, 3) with covariance noise (K, 3, 3)."""
        if len(index) == 0:
            return
        states = np.concatenate((self.state[index], self.surface_state[index]))
        covariances = np.concatenate((self.covariance[index], self.surface_covariance[index]))
        measured, doubt = np.concatenate((position_m, position_m)), np.concatenate((noise, noise))
        states, covariances = kalman.update(states, covariances, measured, doubt, 0)
        count = len(index)
        self.state[index], self.surface_state[index] = states[:count], states[count:]
        self.covariance[index], self.surface_covariance[index] = covariances[:count], covariances[count:]

    def relocate(self, index: NDArray[np.intp], position_m: FloatArray, noise: FloatArray) -> None:
        """As locate, where the centre says nothing of the velocity."""
        if len(index) == 0:
            return
        self.state[index], self.covariance[index] = kalman.place(
            self.state[index], self.covariance[index], position_m, noise
        )
        self.surface_state[index], self.surface_covariance[index] = kalman.place(
            self.surface_state[index], self.surface_covariance[index], position_m, noise
        )
