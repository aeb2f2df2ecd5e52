"""The tracks of a perception with errors; part of controller/campaign/noisy_camera.py."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from controller.campaign.noise_model import NoiseModel
from controller.campaign.view import Eye, PlanarCamera, PlanarView
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.types import FloatArray
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


class NoisyTracks:
    """The tracks of N bodies. Once a frame: step(), then obstacles()."""

    def __init__(
        self,
        z_m: FloatArray,
        is_obstacle: BoolArray,
        to_optical: FloatArray,
        camera: PlanarCamera,
        camera_height_m: float,
        config: SimulatedCameraConfig,
        noise: NoiseModel,
    ) -> None:
        """z_m (N, 2): lowest and highest point of the bodies. is_obstacle (N,): which are reported.
        to_optical (3, 3): rotates ahead, left, up of the camera into its optical axes."""
        self._is_obstacle, self._to_optical = is_obstacle, np.ascontiguousarray(to_optical)
        self._camera, self._noise = camera, noise
        self._period_s, self._min_depth_m = 1.0 / config.fps, config.depth_min_m
        low_m, high_m = z_m.T
        self._centre_height_m = 0.5 * (low_m + high_m) - camera_height_m
        self._tracks = np.zeros((len(z_m), _COLUMNS))
        self._tracks[:, _FIRST_S], self._tracks[:, _SEEN_S] = np.nan, -np.inf
        self._tracks[:, _HEIGHT] = high_m - low_m
        self._error_decay, self._velocity_gain = 0.0, -math.expm1(-self._period_s / noise.velocity_lag_s)

    def step(
        self, view: PlanarView, velocity_mps: FloatArray, t_s: float, random: np.random.Generator
    ) -> None:
        """Predict the tracks by one frame, and update them with the bodies in it.

        Errors change slowly, measured velocities follow the true ones (N, 2), and bodies that are not seen
        keep their last measured velocity.
        """
        new_errors = random.standard_normal((len(self._tracks), _COLUMNS - _ERRORS))
        self._tracks = _stepped(
            self._tracks,
            view,
            self._camera,
            self._noise,
            velocity_mps,
            self._is_obstacle,
            new_errors,
            random.random(len(self._tracks)),
            self._error_decay,
            self._velocity_gain,
            self._min_depth_m,
            t_s,
            self._period_s,
        )
        self._error_decay = math.exp(-self._period_s / self._noise.correlation_s)

    def obstacles(self, view: PlanarView, t_s: float) -> tuple[Obstacle, ...]:
        """The obstacles as perception reports them for this view."""
        reported, vectors = _reported(
            self._tracks, self._centre_height_m, self._to_optical, view.camera_pose, t_s, self._noise
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
def _predict(
    tracks: FloatArray,
    velocity_mps: FloatArray,
    new_errors: FloatArray,
    seen_since_s: float,
    decay: float,
    velocity_gain: float,
    dt_s: float,
) -> None:
    """Predict the tracks (N, C) by dt_s. decay: ratio of the old errors that stays; new_errors: (N, 4).
    velocity_gain: low-pass gain with which the measured velocities of bodies seen since seen_since_s approach
    the true ones (N, 2)."""
    innovation = math.sqrt(1.0 - decay * decay)
    for k in range(len(tracks)):
        track = tracks[k]
        if track[_SEEN_S] > seen_since_s:
            track[_VX] += velocity_gain * (velocity_mps[k, 0] - track[_VX])
            track[_VY] += velocity_gain * (velocity_mps[k, 1] - track[_VY])
        track[_X] += track[_VX] * dt_s
        track[_Y] += track[_VY] * dt_s
        for j in range(new_errors.shape[1]):
            track[_ERRORS + j] = decay * track[_ERRORS + j] + innovation * new_errors[k, j]


@inlined
def _visible_extent(
    forward_m: FloatArray, bearing_tan: FloatArray, half_width_tan: float, min_depth_m: float
) -> tuple[float, float, float, float]:
    """The extent (near, far, left, right) of a body by the bands (B,) that show it; near: inf if none."""
    near, far, left, right = math.inf, -math.inf, math.inf, -math.inf
    for b in range(len(bearing_tan)):
        z = forward_m[b]
        if z < math.inf and z >= min_depth_m:
            near, far = min(near, z), max(far, z)
            left, right = min(left, z * bearing_tan[b]), max(right, z * bearing_tan[b])
    return near, far, left - near * half_width_tan, right + near * half_width_tan


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


@compiled(
    "float64[:, ::1]",
    PlanarView,
    PlanarCamera,
    NoiseModel,
    "float64[:, ::1], boolean[::1], float64[:, ::1], float64[::1],"
    "float64, float64, float64, float64, float64",
)
def _stepped(
    tracks: FloatArray,
    view: PlanarView,
    camera: PlanarCamera,
    noise: NoiseModel,
    velocity_mps: FloatArray,
    is_obstacle: BoolArray,
    new_errors: FloatArray,
    draws: FloatArray,
    decay: float,
    velocity_gain: float,
    min_depth_m: float,
    t_s: float,
    dt_s: float,
) -> FloatArray:
    """The tracks (N, C) after a frame with this view. velocity_mps, new_errors, decay and velocity_gain: as
    for _predict().

    A body is missed if its random draw (N,) in 0..1 is less than the miss rate at its distance.
    """
    camera_x, camera_y, cos, sin = view.camera_pose
    tracks = tracks.copy()
    _predict(tracks, velocity_mps, new_errors, t_s - _MAX_UNSEEN_FRAMES * dt_s, decay, velocity_gain, dt_s)
    last_id = tracks[:, _ID].max() if len(tracks) else 0.0
    for row in range(len(view.bodies)):
        body = view.bodies[row]
        near, far, left, right = _visible_extent(
            view.forward_m[row], camera.bearing_tan, camera.half_width_tan, min_depth_m
        )
        miss_probability = max(
            noise.miss_rate, noise.miss_rate_at_range * (2.0 * near / camera.range_m - 1.0)
        )
        if math.isinf(near) or not is_obstacle[body] or draws[body] < miss_probability:
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
