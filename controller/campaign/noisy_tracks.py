"""The tracks of a perception with errors; part of controller/campaign/noisy_camera.py."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.campaign.noise_model import NoiseModel
from controller.campaign.view import PlanarCamera, PlanarView
from controller.decision.surfaces import Eye
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.records import record
from hal.types import Flags, FloatArray, Matrix, Vector
from vision.scene import Obstacle

BoolArray = NDArray[np.bool_]

_BOX_PX = (0.0, 0.0, 1.0, 1.0)  # bbox_px of all of them: there is no image
_VERTICAL_SIGMA_MPS = 0.1  # of the vertical velocity, which is 0 and which no policy uses
# A body was seen in the last frame if it was seen within this many frame periods.
_MAX_UNSEEN_FRAMES = 1.5
# Columns of a track: id; time of the first and of the last sighting; number of sightings (0: not tracked);
# centre on the floor, velocity, and size across, up and along the view, all without errors; for how long the
# body has seemed to move, and whether it is judged to move. From _ERRORS on: the errors of position and
# velocity, along the view and to its left, in sigmas.
_ID, _FIRST_S, _SEEN_S, _SIGHTINGS, _X, _Y, _VX, _VY, _WIDTH, _HEIGHT, _DEPTH, _FAST_S, _MOVING = range(13)
_ERRORS, _COLUMNS = 13, 17


@record(frozen=True, slots=True, eq=False)
class _Draws:
    """The random numbers of one frame.

    errors: (N, 4), standard normal: the new parts of the errors. misses: (N,), uniform in 0..1: a body is
    missed if its number is less than the miss rate at its distance.
    """

    errors: Matrix
    misses: Vector


class NoisyTracks:
    """The tracks of N bodies. Once a frame: step(), then obstacles().

    tracks: (N, C), with the columns above.
    is_obstacle: (N,), which are reported.
    period_s: of the frames.
    error_decay: share of the errors that stays from one frame to the next.
    velocity_gain: low-pass gain with which measured velocities approach the true ones.
    """

    tracks: Matrix
    is_obstacle: Flags
    period_s: float
    error_decay: float
    velocity_gain: float

    def __init__(
        self,
        is_obstacle: BoolArray,
        to_optical: FloatArray,
        camera: PlanarCamera,
        period_s: float,
        noise: NoiseModel,
    ) -> None:
        """to_optical (3, 3): rotates ahead, left, up of the camera into its optical axes."""
        self.is_obstacle, self._to_optical = is_obstacle, np.ascontiguousarray(to_optical)
        self._camera, self._noise, self.period_s = camera, noise, period_s
        low_m, high_m = camera.z_m.T
        self._centre_height_m = 0.5 * (low_m + high_m) - camera.height_m
        self.tracks = np.zeros((len(is_obstacle), _COLUMNS))
        self.tracks[:, _FIRST_S], self.tracks[:, _SEEN_S] = np.nan, -np.inf
        self.tracks[:, _HEIGHT] = high_m - low_m
        self.error_decay, self.velocity_gain = 0.0, -math.expm1(-period_s / noise.velocity_lag_s)

    def step(
        self, view: PlanarView, velocity_mps: FloatArray, t_s: float, random: np.random.Generator
    ) -> None:
        """Predict the tracks by one frame, and update them with the bodies in it.

        Errors change slowly, measured velocities follow the true ones (N, 2), and bodies that are not seen
        keep their last measured velocity.
        """
        errors = random.standard_normal((len(self.tracks), _COLUMNS - _ERRORS))
        draws = _Draws(errors, random.random(len(self.tracks)))
        self.tracks = _stepped(self, draws, view, self._camera, self._noise, velocity_mps, t_s)
        self.error_decay = math.exp(-self.period_s / self._noise.correlation_s)

    def obstacles(self, view: PlanarView, t_s: float) -> tuple[Obstacle, ...]:
        """The obstacles as perception reports them for this view."""
        reported, vectors = _reported(
            self.tracks, self._centre_height_m, self._to_optical, view.eye, t_s, self._noise
        )
        return tuple(
            [
                Obstacle(
                    id=int(track_id),
                    bbox_px=_BOX_PX,
                    position_m=measured[0],
                    extent_m=measured[1],
                    velocity_mps=measured[2],
                    velocity_cov=measured[3:],
                    moving=moving > 0.0,
                    score=0.9 if moving > 0.0 else 0.5,
                    fragments=8,
                    age_s=age_s,
                    unseen_s=unseen_s,
                )
                for measured, (track_id, moving, age_s, unseen_s) in zip(
                    vectors, reported.tolist(), strict=True
                )
            ]
        )


@inlined
def _predicted(
    known: NoisyTracks, new_errors: FloatArray, velocity_mps: FloatArray, t_s: float
) -> FloatArray:
    """(N, C) the tracks of a frame before, predicted for t_s. velocity_mps (N, 2): the true ones."""
    tracks, dt_s, decay = known.tracks.copy(), known.period_s, known.error_decay
    seen_since_s, innovation = t_s - _MAX_UNSEEN_FRAMES * dt_s, math.sqrt(1.0 - decay * decay)
    for k in range(len(tracks)):
        track = tracks[k]
        if track[_SEEN_S] > seen_since_s:
            track[_VX] += known.velocity_gain * (velocity_mps[k, 0] - track[_VX])
            track[_VY] += known.velocity_gain * (velocity_mps[k, 1] - track[_VY])
        track[_X] += track[_VX] * dt_s
        track[_Y] += track[_VY] * dt_s
        for j in range(new_errors.shape[1]):
            track[_ERRORS + j] = decay * track[_ERRORS + j] + innovation * new_errors[k, j]
    return tracks


@inlined
def _visible_extent(forward_m: FloatArray, camera: PlanarCamera) -> tuple[float, float, float, float]:
    """The extent (near, far, left, right) of a body by the bands (B,) that show it; near: inf if none."""
    near, far, left, right = math.inf, -math.inf, math.inf, -math.inf
    for b in range(len(forward_m)):
        z = forward_m[b]
        if z < math.inf and z >= camera.min_depth_m:
            near, far = min(near, z), max(far, z)
            left, right = min(left, z * camera.bearing_tan[b]), max(right, z * camera.bearing_tan[b])
    return near, far, left - near * camera.half_width_tan, right + near * camera.half_width_tan


@inlined
def _update_motion(track: FloatArray, fast: bool, dt_s: float, noise: NoiseModel) -> None:
    """Update whether the body moves, with hysteresis. fast: whether it was fast in this frame."""
    if fast:
        track[_FAST_S] = min(track[_FAST_S] + dt_s, noise.rise_s + dt_s)
        if track[_FAST_S] >= noise.rise_s:
            track[_MOVING] = 1.0
    else:
        track[_FAST_S] -= dt_s * noise.rise_s / noise.fall_s
        if track[_FAST_S] <= 0.0:
            track[_FAST_S] = track[_MOVING] = 0.0


@compiled(NoisyTracks, _Draws, PlanarView, PlanarCamera, NoiseModel, "float64[:, ::1], float64")
def _stepped(
    known: NoisyTracks,
    draws: _Draws,
    view: PlanarView,
    camera: PlanarCamera,
    noise: NoiseModel,
    velocity_mps: FloatArray,
    t_s: float,
) -> FloatArray:
    """(N, C) the tracks after a frame with this view at t_s. velocity_mps (N, 2): the true ones."""
    camera_x, camera_y, cos, sin = view.eye
    tracks, dt_s = _predicted(known, draws.errors, velocity_mps, t_s), known.period_s
    last_id = tracks[:, _ID].max() if len(tracks) else 0.0
    for row in range(len(view.bodies)):
        body = view.bodies[row]
        near, far, left, right = _visible_extent(view.forward_m[row], camera)
        miss_probability = max(
            noise.miss_rate, noise.miss_rate_at_range * (2.0 * near / camera.range_m - 1.0)
        )
        if math.isinf(near) or not known.is_obstacle[body] or draws.misses[body] < miss_probability:
            continue
        track = tracks[body]
        if track[_SIGHTINGS] == 0.0:
            last_id += 1.0
            track[_ID], track[_FIRST_S] = last_id, t_s
            track[_VX] = track[_VY] = 0.0
        track[_SIGHTINGS] += 1.0
        track[_SEEN_S] = t_s
        forward, lateral = 0.5 * (near + far), 0.5 * (left + right)
        track[_X] = camera_x + forward * cos + lateral * sin
        track[_Y] = camera_y + forward * sin - lateral * cos
        track[_WIDTH], track[_DEPTH] = right - left, far - near
        fast = math.hypot(track[_VX], track[_VY]) > noise.moving_mps + noise.moving_per_m * forward
        _update_motion(track, fast, dt_s, noise)
    for k in range(len(tracks)):
        if tracks[k, _SEEN_S] < t_s - noise.forget_s:
            tracks[k, _SIGHTINGS] = tracks[k, _FAST_S] = tracks[k, _MOVING] = 0.0
    return tracks


@compiled("float64[:, ::1], float64[::1], float64[:, ::1], UniTuple(float64, 4), float64", NoiseModel)
def _reported(
    tracks: FloatArray,
    centre_height_m: FloatArray,
    to_optical: FloatArray,
    eye: Eye,
    t_s: float,
    noise: NoiseModel,
) -> tuple[FloatArray, FloatArray]:
    """The R bodies that are reported: id, whether it moves, times since its first and last sighting (R, 4);
    position, extent, velocity and the three rows of its covariance, in optical axes (R, 6, 3)."""
    camera_x, camera_y, cos, sin = eye
    depth_sigma_1pm = noise.tracked_depth_ratio * noise.depth_sigma_1pm
    count, found = len(tracks), 0
    reported, vectors = np.empty((count, 4)), np.empty((count, 6, 3))
    for k in range(count):
        track = tracks[k]
        errors = track[_ERRORS:]
        ahead, left = along_and_left(track[_X] - camera_x, track[_Y] - camera_y, cos, sin)
        if track[_SIGHTINGS] < noise.sightings or not ahead > 0.0:
            continue
        seen_ahead = ahead + depth_sigma_1pm * ahead * ahead * errors[0]
        seen_left = left + noise.lateral_sigma_m * errors[1]
        radial = noise.radial_velocity_mps + noise.radial_velocity_per_m * ahead
        lateral = noise.lateral_velocity_mps + noise.lateral_velocity_per_m * ahead
        away_mps, left_mps = along_and_left(track[_VX], track[_VY], cos, sin)
        away_mps, left_mps = away_mps + radial * errors[2], left_mps + lateral * errors[3]
        initial = noise.first_velocity_mps * math.exp(-(t_s - track[_FIRST_S]) / noise.first_velocity_decay_s)
        radial, lateral = (radial + initial) ** 2, (lateral + initial) ** 2
        vertical = (_VERTICAL_SIGMA_MPS + initial) ** 2
        reported[found] = track[_ID], track[_MOVING], t_s - track[_FIRST_S], t_s - track[_SEEN_S]
        position, extent, velocity = vectors[found, :3]
        covariance = vectors[found, 3:]
        for i in range(3):
            axis_i = to_optical[i]
            position[i] = seen_ahead * axis_i[0] + seen_left * axis_i[1] + centre_height_m[k] * axis_i[2]
            extent[i] = track[_WIDTH + i]
            velocity[i] = away_mps * axis_i[0] + left_mps * axis_i[1]
            for j in range(3):
                axis_j = to_optical[j]
                covariance[i, j] = (
                    axis_i[0] * radial * axis_j[0]
                    + axis_i[1] * lateral * axis_j[1]
                    + axis_i[2] * vertical * axis_j[2]
                )
        found += 1
    return reported[:found], vectors[:found]
