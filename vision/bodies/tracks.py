"""The state of all tracks: a struct of arrays over T tracks, in the fixed frame of the detector.

vision/tracker.py predicts the tracks at the start of each frame; vision/bodies/sightings.py, the fragment
velocities and vision/bodies/judgement.py update them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import Flags, FloatArray, Integers, Matrices, Matrix, Vector
from vision.numerics import kalman
from vision.numerics.order import indices_of

_TRAIL_S = 0.3  # time constant of the trailing average of a centre: several frames, less than a step lasts
# Share of the acceleration's density in the second opinion, by the surface alone: what goes slowly but
# steadily is to be told from what stands.
_STEADY_SHARE = 0.25
# A track really advances if its centre advances at this share of the filtered velocity at least. The centre
# of something static does not advance; its filtered velocity is noise.
_MIN_ADVANCE_SHARE = 0.4

_Estimates = tuple[FloatArray, FloatArray]  # states (K, 6) and covariances (K, 6, 6)


def _column(kind: type, *shape: int) -> Any:
    """A field with one entry of this type and shape per track; no tracks yet."""
    return field(default_factory=lambda: np.empty((0, *shape), kind), init=False)


@dataclass(slots=True, eq=False)
class Tracks:
    """Parallel arrays with one entry per track."""

    ids: Integers = _column(np.int64)  # in ascending order
    # Filter of position and velocity (T, 6), from the centres of the surface and from the fragments.
    state: Matrix = _column(float, 6)
    covariance: Matrices = _column(float, 6, 6)
    # The same from the centres of the visible surface alone, as a second opinion.
    surface_state: Matrix = _column(float, 6)
    surface_covariance: Matrices = _column(float, 6, 6)
    trailing_m: Matrix = _column(float, 3)  # running average of the centre
    born_ns: Integers = _column(np.int64)  # first seen
    seen_ns: Integers = _column(np.int64)  # last seen
    sightings: Integers = _column(np.intp)  # number of frames in which it was seen
    # As last seen.
    bbox_px: Matrix = _column(float, 4)  # box in the image
    extent_m: Matrix = _column(float, 3)  # size along the camera axes
    cells: Integers = _column(np.intp)  # cells of the depth grid; 0: it has gone behind something since
    fragments: Integers = _column(np.intp)  # number of fragments on it
    box_m: Matrix = _column(float, 4)  # edges of the last box that showed all of it, from its centre
    area_m2: Vector = _column(float)  # running average, up to a common factor
    growth_mps: Vector = _column(float)  # speed of the centre that a growing or shrinking surface can explain
    # For how long the centre has measured the velocity without a break.
    velocity_measured_s: Vector = _column(float)
    nearly_hidden: Flags = _column(np.bool_)  # a mover of which only a small rest was visible
    # A mover without an edge in depth to the static surface beside it: where it ends there is a guess.
    border_is_guess: Flags = _column(np.bool_)
    merged_away: Flags = _column(np.bool_)  # joined to another track, so it ends with this frame
    overhead: Flags = _column(np.bool_)  # seen only above the robot's height; the rest is out of sight
    ends_above_s: Vector = _column(float)  # for how long it has been seen to end above the robot
    # The verdict (vision/bodies/judgement.py).
    evidence: Vector = _column(float)  # the score it rests on
    moving: Flags = _column(np.bool_)  # now
    ever_moved: Flags = _column(np.bool_)  # at any time
    confidence: Vector = _column(float)  # 0..1
    surely_static: Flags = _column(np.bool_)  # its fragments are sure that it stands still
    no_evidence_s: Vector = _column(float)  # time without evidence; inf: there never was any
    moving_s: Vector = _column(float)  # for how long the verdict has been that it moves
    unproven_s: Vector = _column(float)  # since a frame last proved that it moves, or since its birth
    # Time in which nearly all ends contradicted standing still, less the time in which they did not.
    restless_s: Vector = _column(float)
    # Time in which part of the surface was newly arrived, less the time in which none was.
    arriving_s: Vector = _column(float)
    rim_s: Vector = _column(float)  # for how long its free rims have gone one way; negative to the left
    approach_s: Vector = _column(float)  # for how long its surface has come nearer
    _next_id: int = field(default=1, init=False)

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def mover(self) -> NDArray[np.bool_]:
        """(T,) tracks that move by the verdict, or have evidence of it."""
        return self.moving | (self.evidence > 0.0)

    @property
    def velocity_mps(self) -> FloatArray:
        """(T, 3) filtered velocity; a view of the state."""
        return self.state[:, 3:]

    @property
    def speed_mps(self) -> FloatArray:
        """(T,) filtered speed."""
        return _speeds(self.state)

    @property
    def size_m(self) -> FloatArray:
        """(T,) largest extent."""
        return _largest(self.extent_m)

    @property
    def velocity_sigma_mps(self) -> FloatArray:
        """(T,) standard deviation of the filtered velocity: root of the sum of the variances of its axes."""
        result: FloatArray = np.sqrt(self.covariance[:, 3:, 3:].trace(axis1=1, axis2=2))
        return result

    def clear(self) -> None:
        """Forget all tracks; ids are not used again."""
        self.keep(np.zeros(len(self), np.bool_))

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Drop all but the chosen tracks."""
        if chosen.all():
            return
        kept = chosen.nonzero()[0]  # taking by index is several times as fast as by mask
        for name in _COLUMNS:
            setattr(self, name, getattr(self, name).take(kept, axis=0))

    def index_of(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """(N,) index of each track id; -1 where there is no such track, or no longer."""
        return indices_of(self.ids, ids)

    def start(
        self,
        position_m: FloatArray,
        sigma_m: float,
        max_speed_mps: float,
        evidence: FloatArray | float,
        now_ns: int,
    ) -> None:
        """Begin tracks at positions (K, 3), known to sigma_m, with unknown velocity.

        Its mean is 0 and its standard deviation is max_speed_mps. evidence: score of each, (K,), or of all.
        """
        count = len(position_m)
        given: dict[str, object] = {
            "ids": np.arange(self._next_id, self._next_id + count),
            "born_ns": now_ns,
            "seen_ns": now_ns,
            "evidence": evidence,
            "trailing_m": position_m,
            "no_evidence_s": np.inf,
        }
        given["state"] = given["surface_state"] = np.concatenate((position_m, np.zeros((count, 3))), axis=1)
        spread = np.diag([sigma_m**2] * 3 + [max_speed_mps**2] * 3)
        given["covariance"] = given["surface_covariance"] = spread
        self._next_id += count
        for name in _COLUMNS:
            old = getattr(self, name)
            new = np.zeros((count, *old.shape[1:]), old.dtype)
            if name in given:
                new[...] = given[name]
            setattr(self, name, np.concatenate((old, new)))

    def start_from(self, track: int, sigma_m: float, sigma_mps: float, evidence: float, now_ns: int) -> None:
        """Begin a track that was part of another one, with that one's position and velocity.

        It has to prove its motion by itself: it may be something static that the mover passes.
        """
        self.start(self.state[track : track + 1, :3], sigma_m, sigma_mps, evidence, now_ns)
        self.state[-1, 3:] = self.state[track, 3:]

    def predict(self, dt_s: float, accel_density: float, up: FloatArray | None) -> None:
        """Predict all tracks dt_s ahead.

        accel_density: spectral density of the acceleration, (m/s^2)^2 s; for the surface alone a quarter of
        it. up (3,): the floor's normal, along which a velocity dies out; None where it is not known.
        """
        surface_density = _STEADY_SHARE * accel_density
        if len(self) and dt_s > 0:
            self.state, self.covariance = kalman.predict(self.state, self.covariance, dt_s, accel_density, up)
            self.surface_state, self.surface_covariance = kalman.predict(
                self.surface_state, self.surface_covariance, dt_s, surface_density, up
            )

    def update_trailing_average(self, dt_s: float) -> NDArray[np.bool_]:
        """Update the trailing averages; (T,) whether the centres advance about as fast as the velocities say.

        Call once a frame, dt_s after the frame before.
        """
        gain, behind_s = -math.expm1(-dt_s / _TRAIL_S), dt_s / math.expm1(dt_s / _TRAIL_S)
        self.trailing_m, advances = _trailing_average(self.state, self.trailing_m, gain, behind_s)
        return advances

    def sight(self, camera_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(T, 3) unit vectors from a camera at camera_m (3,) to the centres, and (T,) their distances."""
        return _sight(self.state, camera_m)

    def update_durations(self, proven: NDArray[np.bool_], dt_s: float) -> None:
        """Update the durations after a verdict, dt_s after the last. proven (T,): motion, by this frame."""
        self.unproven_s = np.where(proven, 0.0, self.unproven_s + dt_s)
        self.moving_s = np.where(self.moving, self.moving_s + dt_s, 0.0)
        self.no_evidence_s = np.where(self.evidence > 0.0, 0.0, self.no_evidence_s + dt_s)

    def mark_hidden(self, chosen: NDArray[np.bool_]) -> None:
        """Mark the chosen tracks as hidden: nothing of them is visible behind a static surface."""
        self.nearly_hidden |= chosen
        self.cells[chosen] = 0

    def update_with_centre(self, index: Integers, position_m: FloatArray, noise: FloatArray) -> None:
        """Update both filters of tracks index (K,) with measured centres.

        position_m (K, 3): in the fixed frame. noise (K, 3, 3): their covariance.
        """
        self._apply(kalman.update, index, position_m, noise, kalman.POSITION)

    def reset_position(self, index: Integers, position_m: FloatArray, noise: FloatArray) -> None:
        """As update_with_centre, but the centre tells nothing about the velocity."""
        self._apply(kalman.reset_position, index, position_m, noise)

    def update_with_surface(self, index: Integers, velocity_mps: FloatArray, noise: FloatArray) -> None:
        """Update both filters of tracks index (K,) with velocities of the surface (K, 3), noise (K, 3, 3)."""
        self._apply(kalman.update, index, velocity_mps, noise, kalman.VELOCITY)

    def update_with_fragments(self, index: Integers, velocity_mps: FloatArray, noise: FloatArray) -> None:
        """The same with velocities of fragments, which the filter of the surface does not take."""
        self.state, self.covariance = kalman.update(
            self.state, self.covariance, index, velocity_mps, noise, kalman.VELOCITY
        )

    def _apply(self, update: Callable[..., _Estimates], index: Integers, *measured: FloatArray | int) -> None:
        """Replace both estimates of tracks index (K,) by those that update makes of them and of measured."""
        if len(index) == 0:
            return
        self.state, self.covariance = update(self.state, self.covariance, index, *measured)
        self.surface_state, self.surface_covariance = update(
            self.surface_state, self.surface_covariance, index, *measured
        )


_COLUMNS = tuple(one.name for one in fields(Tracks) if one.name != "_next_id")


@inlined
def speed_of(state: FloatArray) -> float:
    """The speed of a state (6,)."""
    x, y, z = state[3], state[4], state[5]
    return math.sqrt(x * x + y * y + z * z)


@compiled("float64[:, ::1]")
def _speeds(state: FloatArray) -> FloatArray:
    """As Tracks.speed_mps."""
    speed_mps = np.empty(len(state))
    for t in range(len(state)):
        speed_mps[t] = speed_of(state[t])
    return speed_mps


@compiled("float64[:, ::1]")
def _largest(extent_m: FloatArray) -> FloatArray:
    """As Tracks.size_m."""
    size_m = np.empty(len(extent_m))
    for t in range(len(extent_m)):
        size_m[t] = max(extent_m[t, 0], extent_m[t, 1], extent_m[t, 2])
    return size_m


@compiled("float64[:, ::1], float64[:, ::1], float64, float64")
def _trailing_average(
    state: FloatArray, trailing_m: FloatArray, gain: float, behind_s: float
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """As Tracks.update_trailing_average, with trailing_m (T, 3). behind_s: lag at a steady velocity."""
    trails_m, advances = trailing_m.copy(), np.empty(len(state), np.bool_)
    for t in range(len(state)):
        way, squared = 0.0, 0.0
        for i in range(3):
            speed = state[t, 3 + i]
            trails_m[t, i] += gain * (state[t, i] - trails_m[t, i])
            way += (state[t, i] - trails_m[t, i]) * speed
            squared += speed * speed
        advances[t] = way / behind_s > _MIN_ADVANCE_SHARE * squared
    return trails_m, advances


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
