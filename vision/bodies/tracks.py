"""The obstacles that are followed: struct of arrays over T tracks, in the fixed frame of the detector."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.numerics import kalman

_TRAIL_S = 0.3  # over which a centre is averaged: several frames, and less than a step
_GOING_SHARE = 0.4  # of its velocity: what stands has a centre that goes nowhere, by its noise
_UNPROVEN_S = 0.05  # a frame or two, and proof may fail to come by chance
_GONE_SHARE = 0.6  # of its width


class Tracks:
    """Parallel arrays, one entry for each of T tracks; what each of them means is said where it is made."""

    def __init__(self) -> None:
        self.ids = np.empty(0, np.int64)  # growing
        # Position and velocity (T, 6); as a second opinion the same from the centres of the visible surface
        # alone, without the fragments.
        self.state = np.empty((0, 6))
        self.covariance = np.empty((0, 6, 6))
        self.surface_state = np.empty((0, 6))
        self.surface_covariance = np.empty((0, 6, 6))
        self.trailing_m = np.empty((0, 3))  # where the centre was of late, averaged
        # When it was seen first and last, and in how many frames.
        self.born_ns = np.empty(0, np.int64)
        self.seen_ns = np.empty(0, np.int64)
        self.sightings = np.empty(0, np.intp)
        # What was seen of it last: its box in the image, its size in the camera's axes, cells of the grid (0:
        # it went behind something since), fragments on it.
        self.bbox_px = np.empty((0, 4))
        self.extent_m = np.empty((0, 3))
        self.cells = np.empty(0, np.intp)
        self.fragments = np.empty(0, np.intp)
        # Edges of the last box that showed all of it, at its depth, from its centre.
        self.box_m = np.empty((0, 4))
        self.area_m2 = np.empty(0)  # averaged, up to a common factor
        # How fast its centre may wander because it shows more or less of itself.
        self.growth_mps = np.empty(0)
        # For how long its surface's centre has told of the velocity without a break.
        self.clean_s = np.empty(0)
        self.sliver = np.empty(0, np.bool_)  # a mover of which hardly anything was left to see
        # A mover that ends in what stands around it where a guess has it.
        self.guessed = np.empty(0, np.bool_)
        # Seen only above the robot; the rest is hidden, or beside the view.
        self.overhead = np.empty(0, np.bool_)
        # The verdict (vision/bodies/judgement.py): the score it rests on, now, ever, how surely (0..1), and
        # whether its fragments are sure that it stands.
        self.evidence = np.empty(0)
        self.moving = np.empty(0, np.bool_)
        self.has_moved = np.empty(0, np.bool_)
        self.confidence = np.empty(0)
        self.stands = np.empty(0, np.bool_)
        self.calm_s = np.empty(0)  # since there was evidence; inf: there never was
        self.moving_s = np.empty(0)  # for how long the verdict has been that it moves
        self.unproven_s = np.empty(0)  # since a frame proved that it moves, or since its birth
        # For how long nearly all ends denied that it stands, less how long they did not.
        self.unrest_s = np.empty(0)
        self._fields = tuple(vars(self))
        self._next_id = 1

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def mover(self) -> NDArray[np.bool_]:
        """(T,) who moves, or is suspected of it."""
        return self.moving | (self.evidence > 0.0)

    @property
    def speed_mps(self) -> FloatArray:
        """(T,) as filtered."""
        return _speeds(self.state)

    @property
    def velocity_sigma_mps(self) -> FloatArray:
        """(T,) of the filtered velocities, over all directions."""
        result: FloatArray = np.sqrt(self.covariance[:, 3:, 3:].trace(axis1=1, axis2=2))
        return result

    def clear(self) -> None:
        """Forget all tracks; ids go on."""
        self.keep(np.zeros(len(self), np.bool_))

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Drop all but the chosen tracks."""
        if chosen.all():
            return
        kept = chosen.nonzero()[0]  # a choice by index is several times as fast
        for name in self._fields:
            setattr(self, name, getattr(self, name).take(kept, axis=0))

    def index_of(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """(N,) index of each track id, -1 where there is none (any more)."""
        return _places(self.ids, ids)

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
        for name in self._fields:
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
            self.state, self.covariance = kalman.predict(self.state, self.covariance, dt_s, accel_density, up)
            self.surface_state, self.surface_covariance = kalman.predict(
                self.surface_state, self.surface_covariance, dt_s, accel_density, up
            )

    def follow_trails(self, dt_s: float) -> NDArray[np.bool_]:
        """Take in where the centres are, dt_s on; (T,) whether they really go about as fast as the velocities
        say. Once a frame."""
        gain, behind_s = -math.expm1(-dt_s / _TRAIL_S), dt_s / math.expm1(dt_s / _TRAIL_S)
        self.trailing_m, goes = _followed(self.state, self.trailing_m, gain, behind_s)
        return goes

    def sight(self, camera_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(T, 3) unit vectors from a camera at camera_m (3,) to the centres, and (T,) their distances."""
        return _sight(self.state, camera_m)

    def overdue(self, elapsed_s: float, sight: FloatArray, resolves_m: FloatArray) -> NDArray[np.bool_]:
        """(T,) movers of which nothing has proved just now that they go on, and which by their velocity are
        clearly no longer where they were elapsed_s ago: across the line of sight by most of their width, or
        along it by what depth can tell apart there, resolves_m (T,). sight (T, 3): unit vectors."""
        if elapsed_s <= 0.0:
            return np.zeros(len(self), np.bool_)
        asked = self.moving & (self.unproven_s >= _UNPROVEN_S)
        return _gone(asked, self.state, self.extent_m, sight, resolves_m, elapsed_s)

    def count_on(self, proven: NDArray[np.bool_], dt_s: float) -> None:
        """For how long it has been so, after a verdict, dt_s after the last. proven (T,): by this frame."""
        self.unproven_s = np.where(proven, 0.0, self.unproven_s + dt_s)
        self.moving_s = np.where(self.moving, self.moving_s + dt_s, 0.0)
        self.calm_s = np.where(self.evidence > 0.0, 0.0, self.calm_s + dt_s)

    def hide(self, chosen: NDArray[np.bool_]) -> None:
        """Tracks of which nothing is to be seen any more, behind what stands there."""
        self.sliver |= chosen
        self.cells[chosen] = 0

    def locate(self, index: NDArray[np.intp], position_m: FloatArray, noise: FloatArray) -> None:
        """The centres of tracks index (K,) were seen at position_m (K, 3) with covariance noise (K, 3, 3)."""
        if len(index) == 0:
            return
        self.state[index], self.covariance[index] = kalman.update(
            self.state.take(index, axis=0), self.covariance.take(index, axis=0), position_m, noise, 0
        )
        self.surface_state[index], self.surface_covariance[index] = kalman.update(
            self.surface_state.take(index, axis=0),
            self.surface_covariance.take(index, axis=0),
            position_m,
            noise,
            0,
        )

    def relocate(self, index: NDArray[np.intp], position_m: FloatArray, noise: FloatArray) -> None:
        """As locate, where the centre says nothing of the velocity."""
        if len(index) == 0:
            return
        self.state[index], self.covariance[index] = kalman.place(
            self.state.take(index, axis=0), self.covariance.take(index, axis=0), position_m, noise
        )
        self.surface_state[index], self.surface_covariance[index] = kalman.place(
            self.surface_state.take(index, axis=0),
            self.surface_covariance.take(index, axis=0),
            position_m,
            noise,
        )


@compiled("int64[::1], int64[::1]")
def _places(known: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.intp]:
    """(N,) where each of ids (N,) stands among those known, which grow; -1: nowhere."""
    result = np.full(len(ids), -1, np.intp)
    for k in range(len(ids)):
        place = np.searchsorted(known, ids[k])
        if place < len(known) and known[place] == ids[k]:
            result[k] = place
    return result


@compiled("float64[:, ::1]")
def _speeds(state: FloatArray) -> FloatArray:
    """As Tracks.speed_mps."""
    speed_mps = np.empty(len(state))
    for t in range(len(state)):
        x, y, z = state[t, 3], state[t, 4], state[t, 5]
        speed_mps[t] = math.sqrt(x * x + y * y + z * z)
    return speed_mps


@compiled("float64[:, ::1], float64[:, ::1], float64, float64")
def _followed(
    state: FloatArray, trailing_m: FloatArray, gain: float, behind_s: float
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """trailing_m (T, 3) a step on, and follow_trails; behind_s: by so much it trails what goes steadily."""
    trails_m, goes = trailing_m.copy(), np.empty(len(state), np.bool_)
    for t in range(len(state)):
        way, squared = 0.0, 0.0
        for i in range(3):
            speed = state[t, 3 + i]
            trails_m[t, i] += gain * (state[t, i] - trails_m[t, i])
            way += (state[t, i] - trails_m[t, i]) * speed
            squared += speed * speed
        goes[t] = way / behind_s > _GOING_SHARE * squared
    return trails_m, goes


@compiled("float64[:, ::1], float64[:]")
def _sight(state: FloatArray, camera_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As Tracks.sight."""
    sight, distance_m = np.empty((len(state), 3)), np.empty(len(state))
    for t in range(len(state)):
        squared = 0.0
        for i in range(3):
            sight[t, i] = state[t, i] - camera_m[i]
            squared += sight[t, i] * sight[t, i]
        distance_m[t] = math.sqrt(squared)
        sight[t] /= max(distance_m[t], 0.1)
    return sight, distance_m


@compiled("boolean[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], float64")
def _gone(
    asked: NDArray[np.bool_],
    state: FloatArray,
    extent_m: FloatArray,
    sight: FloatArray,
    resolves_m: FloatArray,
    elapsed_s: float,
) -> NDArray[np.bool_]:
    """(T,) those asked for that are clearly no longer where they were elapsed_s ago."""
    gone = np.zeros(len(asked), np.bool_)
    for t in range(len(asked)):
        along_m, squared = 0.0, 0.0
        for i in range(3):
            way_m = elapsed_s * state[t, 3 + i]
            along_m += way_m * sight[t, i]
            squared += way_m * way_m
        across_m = math.sqrt(max(squared - along_m * along_m, 0.0))
        width_m, depth_m = max(extent_m[t, 0], extent_m[t, 2]), extent_m[t, 2]
        far = across_m >= _GONE_SHARE * width_m or abs(along_m) >= max(resolves_m[t], _GONE_SHARE * depth_m)
        gone[t] = asked[t] and far
    return gone
