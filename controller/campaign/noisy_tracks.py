"""The tracks of a perception with errors; part of controller/campaign/noisy_camera.py."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from controller.campaign.noise_model import NoiseModel
from controller.campaign.view import PlanarEye, PlanarView
from hal.compiled import compiled, inlined
from hal.types import FloatArray
from vision.scene import Obstacle

BoolArray = NDArray[np.bool_]

_BOX_PX = (0.0, 0.0, 1.0, 1.0)
# Standard deviation of the vertical velocity.
_UP_MPS = 0.1
# A body was seen in the last frame if it was seen within this many frame periods.
_SEEN_FRAMES = 1.5
# Columns of a track: id; time of the first and of the last sighting; number of sightings (0: not tracked);
# centre on the floor, velocity, and size across, up and along the view, all without errors; for how long the
# body has seemed to move, and whether it is judged to move. From _ERRORS on: the errors of position and
# velocity, along the view and to its left, in sigmas.
_NUMBER, _FIRST_S, _SEEN_S, _SIGHTINGS, _X, _Y, _VX, _VY, _WIDE, _HIGH, _DEEP, _SEEMS_S, _MOVES = range(13)
_ERRORS, _COLUMNS = 13, 17


class NoisyTracks:
    """The tracks of N bodies. Once a frame: advance(), sight(), obstacles(). All random numbers: random's."""

    def __init__(
        self,
        z_m: FloatArray,
        listed: BoolArray,
        to_optical: FloatArray,
        eye: PlanarEye,
        eye_m: float,
        camera: SimulatedCameraConfig,
        noise: NoiseModel,
    ) -> None:
        """z_m (N, 2): lowest and highest point of the bodies. listed (N,): which bodies are obstacles.
        to_optical (3, 3): rotates ahead, left, up of the camera, eye_m high, into its optical axes."""
        self._listed, self._to_optical = listed, np.ascontiguousarray(to_optical)
        self._eye, self._noise = eye, noise
        self._period_s, self._least_m = 1.0 / camera.fps, camera.depth_min_m
        low_m, high_m = z_m.T
        self._middle_m = 0.5 * (low_m + high_m) - eye_m
        self._tracks = np.zeros((len(z_m), _COLUMNS))
        self._tracks[:, _FIRST_S], self._tracks[:, _SEEN_S] = np.nan, -np.inf
        self._tracks[:, _HIGH] = high_m - low_m
        self._keeps, self._follows = 0.0, -math.expm1(-self._period_s / noise.velocity_lag_s)

    def advance(self, velocity_mps: FloatArray, t_s: float, random: np.random.Generator) -> None:
        """Advance by one frame: errors change slowly, measured velocities follow the true ones (N, 2), and
        bodies that are not seen keep their last measured velocity."""
        fresh = random.standard_normal((len(self._tracks), _COLUMNS - _ERRORS))
        since_s = t_s - _SEEN_FRAMES * self._period_s
        self._tracks = _gone_on(
            self._tracks, velocity_mps, fresh, since_s, self._keeps, self._follows, self._period_s
        )
        self._keeps = math.exp(-self._period_s / self._noise.wander_s)

    def sight(self, view: PlanarView, t_s: float, random: np.random.Generator) -> None:
        """Update the tracks with the bodies in this frame."""
        noise, eye = self._noise, self._eye
        chance = random.random(len(self._tracks))
        self._tracks = _sighted(
            self._tracks,
            view.bodies,
            view.forward_m,
            self._listed,
            chance,
            eye.bearing_tan,
            eye.half_width_tan,
            eye.range_m,
            self._least_m,
            *view.place,
            t_s,
            self._period_s,
            noise.missed_share,
            noise.missed_share_at_range,
            noise.moving_mps,
            noise.moving_per_m,
            noise.rise_s,
            noise.fall_s,
            noise.forget_s,
        )

    def obstacles(self, view: PlanarView, t_s: float) -> tuple[Obstacle, ...]:
        """The obstacles as perception reports them for this view."""
        noise = self._noise
        told, vectors, covariances = _measured(
            self._tracks,
            self._middle_m,
            self._to_optical,
            *view.place,
            t_s,
            noise.sightings,
            noise.kept_by_tracker * noise.depth_sigma_1pm,
            noise.side_sigma_m,
            noise.radial_velocity_mps,
            noise.radial_velocity_per_m,
            noise.side_velocity_mps,
            noise.side_velocity_per_m,
            noise.first_velocity_mps,
            noise.first_velocity_fades_s,
        )
        return tuple(
            [
                Obstacle(
                    id=int(number),
                    bbox_px=_BOX_PX,
                    position_m=vectors[k, 0],
                    extent_m=vectors[k, 1],
                    velocity_mps=vectors[k, 2],
                    velocity_cov=covariances[k],
                    moving=moves > 0.0,
                    score=0.9 if moves > 0.0 else 0.5,
                    fragments=8,
                    age_s=age_s,
                    unseen_s=unseen_s,
                )
                for k, (number, moves, age_s, unseen_s) in enumerate(told.tolist())
            ]
        )


@compiled("float64[:, ::1], float64[:, ::1], float64[:, ::1], float64, float64, float64, float64")
def _gone_on(
    tracks: FloatArray,
    velocity_mps: FloatArray,
    fresh: FloatArray,
    seen_since_s: float,
    keeps: float,
    follows: float,
    dt_s: float,
) -> FloatArray:
    """The tracks (N, C) dt_s later. keeps: share of the old errors that stays; fresh (N, 4): new errors.
    follows: by which share velocities of bodies seen since seen_since_s approach the true ones (N, 2)."""
    tracks = tracks.copy()
    adds = math.sqrt(1.0 - keeps * keeps)
    for k in range(len(tracks)):
        track = tracks[k]
        if track[_SEEN_S] > seen_since_s:
            track[_VX] += follows * (velocity_mps[k, 0] - track[_VX])
            track[_VY] += follows * (velocity_mps[k, 1] - track[_VY])
        track[_X] += track[_VX] * dt_s
        track[_Y] += track[_VY] * dt_s
        for j in range(fresh.shape[1]):
            track[_ERRORS + j] = keeps * track[_ERRORS + j] + adds * fresh[k, j]
    return tracks


@inlined
def _shown(
    forward_m: FloatArray, bearing_tan: FloatArray, half_width_tan: float, least_m: float
) -> tuple[float, float, float, float]:
    """The extent (near, far, left, right) of a body by the bands (B,) that show it; near: inf if none
    does."""
    near, far, left, right = math.inf, -math.inf, math.inf, -math.inf
    for b in range(len(bearing_tan)):
        z = forward_m[b]
        if z < math.inf and z >= least_m:
            near, far = min(near, z), max(far, z)
            left, right = min(left, z * bearing_tan[b]), max(right, z * bearing_tan[b])
    return near, far, left - near * half_width_tan, right + near * half_width_tan


@inlined
def _judge(track: FloatArray, fast: bool, dt_s: float, rise_s: float, fall_s: float) -> None:
    """Update whether the body moves, with hysteresis. fast: whether it was fast in this frame."""
    if fast:
        track[_SEEMS_S] = min(track[_SEEMS_S] + dt_s, rise_s + dt_s)
        if track[_SEEMS_S] >= rise_s:
            track[_MOVES] = 1.0
    else:
        track[_SEEMS_S] -= dt_s * rise_s / fall_s
        if track[_SEEMS_S] <= 0.0:
            track[_SEEMS_S] = track[_MOVES] = 0.0


@compiled(
    "float64[:, ::1], int64[::1], float64[:, ::1], boolean[::1], float64[::1], float64[::1],"
    "float64, float64, float64, float64, float64, float64, float64, float64, float64, float64, float64,"
    "float64, float64, float64, float64, float64"
)
def _sighted(
    tracks: FloatArray,
    bodies: NDArray[np.intp],
    forward_m: FloatArray,
    listed: BoolArray,
    chance: FloatArray,
    bearing_tan: FloatArray,
    half_width_tan: float,
    range_m: float,
    least_m: float,
    eye_x: float,
    eye_y: float,
    cos: float,
    sin: float,
    t_s: float,
    dt_s: float,
    missed_share: float,
    missed_at_range: float,
    moving_mps: float,
    moving_per_m: float,
    rise_s: float,
    fall_s: float,
    forget_s: float,
) -> FloatArray:
    """The tracks (N, C) after a frame that shows bodies (M,) at distances forward_m (M, B). A body is missed
    if its random chance (N,) in 0..1 is less than the missed share at its distance."""
    tracks = tracks.copy()
    newest = tracks[:, _NUMBER].max() if len(tracks) else 0.0
    for row in range(len(bodies)):
        body = bodies[row]
        near, far, left, right = _shown(forward_m[row], bearing_tan, half_width_tan, least_m)
        missed = max(missed_share, missed_at_range * (2.0 * near / range_m - 1.0))
        if math.isinf(near) or not listed[body] or chance[body] < missed:
            continue
        track = tracks[body]
        if track[_SIGHTINGS] == 0.0:
            newest += 1.0
            track[_NUMBER], track[_FIRST_S] = newest, t_s
            track[_VX] = track[_VY] = 0.0
        track[_SIGHTINGS] += 1.0
        track[_SEEN_S] = t_s
        forward, aside = 0.5 * (near + far), 0.5 * (left + right)
        track[_X] = eye_x + forward * cos + aside * sin
        track[_Y] = eye_y + forward * sin - aside * cos
        track[_WIDE], track[_DEEP] = right - left, far - near
        fast = math.hypot(track[_VX], track[_VY]) > moving_mps + moving_per_m * forward
        _judge(track, fast, dt_s, rise_s, fall_s)
    for k in range(len(tracks)):
        if tracks[k, _SEEN_S] < t_s - forget_s:
            tracks[k, _SIGHTINGS] = tracks[k, _SEEMS_S] = tracks[k, _MOVES] = 0.0
    return tracks


@compiled(
    "float64[:, ::1], float64[::1], float64[:, ::1], float64, float64, float64, float64, float64, int64,"
    "float64, float64, float64, float64, float64, float64, float64, float64"
)
def _measured(
    tracks: FloatArray,
    middle_m: FloatArray,
    to_optical: FloatArray,
    eye_x: float,
    eye_y: float,
    cos: float,
    sin: float,
    t_s: float,
    sightings: int,
    depth_sigma_1pm: float,
    side_sigma_m: float,
    radial_mps: float,
    radial_per_m: float,
    side_mps: float,
    side_per_m: float,
    first_mps: float,
    fades_s: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The R bodies that are reported: id, whether it moves, times since its first and last sighting (R, 4);
    position, extent and velocity in optical axes (R, 3, 3); covariance of the velocity (R, 3, 3)."""
    count, found = len(tracks), 0
    told, vectors, covariances = np.empty((count, 4)), np.empty((count, 3, 3)), np.empty((count, 3, 3))
    for k in range(count):
        track = tracks[k]
        errors = track[_ERRORS:]
        dx, dy = track[_X] - eye_x, track[_Y] - eye_y
        ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
        if track[_SIGHTINGS] < sightings or not ahead > 0.0:
            continue
        seen_ahead = ahead + depth_sigma_1pm * ahead * ahead * errors[0]
        seen_left = left + side_sigma_m * errors[1]
        radial, side, up = radial_mps + radial_per_m * ahead, side_mps + side_per_m * ahead, _UP_MPS
        away_mps = track[_VX] * cos + track[_VY] * sin + radial * errors[2]
        left_mps = track[_VY] * cos - track[_VX] * sin + side * errors[3]
        young = first_mps * math.exp(-(t_s - track[_FIRST_S]) / fades_s)
        radial, side, up = (radial + young) ** 2, (side + young) ** 2, (up + young) ** 2
        told[found] = track[_NUMBER], track[_MOVES], t_s - track[_FIRST_S], t_s - track[_SEEN_S]
        position, extent, velocity = vectors[found]
        for i in range(3):
            turn = to_optical[i]
            position[i] = seen_ahead * turn[0] + seen_left * turn[1] + middle_m[k] * turn[2]
            extent[i] = track[_WIDE + i]
            velocity[i] = away_mps * turn[0] + left_mps * turn[1]
            for j in range(3):
                other = to_optical[j]
                covariances[found, i, j] = (
                    turn[0] * radial * other[0] + turn[1] * side * other[1] + turn[2] * up * other[2]
                )
        found += 1
    return told[:found], vectors[:found], covariances[:found]
