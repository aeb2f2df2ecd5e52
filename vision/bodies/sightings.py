"""Measurement update of each track's filters by the centroid of its visible surface.

What the centroid is used to measure depends on how much of the surface is visible. In each case the name of
the kind in the code is given:

* _WHOLE: position and velocity (Tracks.update_with_centre). The whole surface is visible, as before: its left
  and right sides are neither cut by the image border nor hidden, its area is about the usual one, and its
  centroid has not jumped.
* _PARTIAL: position and velocity, but with a larger variance. Any other surface of a track that is known to
  move. A body cannot be far from its visible part.
* _POSITION_ONLY: position only (Tracks.reset_position). A surface of a static track that is cut, partly
  hidden or changed in area; also any surface after a jump, or while the camera's own motion is not known.
* _NEARLY_HIDDEN: nothing. The small rest that is visible of a mover that is passing behind something.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise, MotionSettings
from hal.compiled import compiled, inlined
from hal.types import Flags, FloatArray, Integers, Intrinsics, Pose
from vision.bodies.tracks import Tracks
from vision.camera.lens import ray_through
from vision.depth.connected import MIN_PART_CELLS
from vision.depth.depth_noise import depth_sigma_of
from vision.depth.regions import Regions
from vision.detection import Detection
from vision.numerics import kalman
from vision.numerics.pose_axes import outer_point

# Standard deviation of the centroid of a very small surface: the width of a cell 2.3 m away.
_CENTRE_SIGMA_M = 0.015
_CENTRE_SHARE = 0.0125  # more of it, per metre of size across the line of sight: cells at the rim come and go
_CENTRE_DEPTH_SHARE = 0.04  # the same per metre of size along it: there the visible part changes more
# Standard deviation of the centroid of a partly visible surface from that of the whole, as a share of size.
_SHIFT_SHARE = 0.35
_CUT_SIGMA_M = 1.0  # standard deviation in height of a surface that the upper or lower image border cuts
_CENTRE_NOISE = 0.2  # share of a pixel's depth noise: neighbours share it, so it does not average out fully
_SAME_AREA = 0.3  # a relative change of area above this means that another part of the body is visible
_AREA_MEMORY_S = 0.32  # time constant of the averaged area: a gain of 0.1 per frame at 30 frames a second
_NEARLY_HIDDEN_SHARE = 0.4  # of the usual area: a mover with a smaller surface is nearly hidden
# By such a factor areas change from frame to frame only where depth is wrong: what comes into view, or goes
# behind something, changes more slowly.
_JUMP_OF_AREA = 2.0
_JUMP_M = 0.3  # plus two sigmas of depth: a centroid farther from its prediction than this has jumped
# How a track is visible: with fewer cells than a part has; then the kinds of the module docstring, in order.
_NOT_VISIBLE, _WHOLE, _PARTIAL, _POSITION_ONLY, _NEARLY_HIDDEN = range(5)


def update_from_surfaces(tracks: Tracks, detection: Detection, measured: Regions, noise: DepthNoise) -> None:
    """Update tracks with the surfaces measured, entry k for track k; one without cells stays predicted."""
    kind, centre_m, change, tracks.area_m2 = _kinds(
        measured,
        tracks,
        detection.pose,
        noise,
        detection.motion_known,
        -math.expm1(-detection.dt_s / _AREA_MEMORY_S),
    )
    covariance = _centre_covariances(kind, measured, detection.pose, noise)
    centred = ((kind == _WHOLE) | (kind == _PARTIAL)).nonzero()[0]
    tracks.update_with_centre(centred, centre_m.take(centred, axis=0), covariance.take(centred, axis=0))
    placed = (kind == _POSITION_ONLY).nonzero()[0]
    tracks.reset_position(placed, centre_m.take(placed, axis=0), covariance.take(placed, axis=0))
    growth_mps = change * measured.extent_m[:, 0] / _AREA_MEMORY_S
    tracks.growth_mps = np.where(kind != _NOT_VISIBLE, growth_mps, tracks.growth_mps)
    _note_view(tracks, detection, measured, kind)


def keeps_area(tracks: Tracks, cells: Integers) -> Flags:
    """(T,) tracks whose surface, now of cells (T,), has neither doubled nor halved since it was last seen.

    A wrong match of a repeated pattern comes and goes with noise, and its outline with it. Call before
    update_from_surfaces.
    """
    before = tracks.cells
    result: Flags = (before == 0) | ((cells <= _JUMP_OF_AREA * before) & (before <= _JUMP_OF_AREA * cells))
    return result


def forget_implausible(tracks: Tracks, settings: MotionSettings) -> None:
    """Forget implausible velocities of tracks that are not known to move.

    They come from a surface that jumped. While a filter forgets one slowly, it passes through all plausible
    velocities, and each would be proof of motion.
    """
    for state, covariance in (
        (tracks.state, tracks.covariance),
        (tracks.surface_state, tracks.surface_covariance),
    ):
        wild = _wild(state, tracks.moving, settings.implausible_mps)
        if len(wild):
            kalman.forget_velocity(state, covariance, wild, settings.max_speed_mps)


@compiled("float64[:, ::1], boolean[::1], float64")
def _wild(state: FloatArray, moving: NDArray[np.bool_], most_mps: float) -> Integers:
    """(K,) indices of the states (T, 6) that are faster than most_mps, and not known to be moving (T,)."""
    wild = np.empty(len(state), np.bool_)
    for t in range(len(state)):
        x, y, z = state[t, 3], state[t, 4], state[t, 5]
        wild[t] = x * x + y * y + z * z > most_mps**2 and not moving[t]
    return wild.nonzero()[0]


def _note_view(tracks: Tracks, detection: Detection, measured: Regions, kind: NDArray[np.intp]) -> None:
    """Note in tracks how each is visible in this frame: since when, how large, and how much of it."""
    tracks.nearly_hidden, tracks.velocity_measured_s, tracks.box_m = _views(
        tracks, measured, kind, detection.camera, detection.grid.step_px, detection.dt_s
    )
    visible = kind != _NOT_VISIBLE
    tracks.seen_ns[visible] = detection.captured_ns
    tracks.sightings += visible
    np.copyto(tracks.bbox_px, measured.bbox_px, where=visible[:, None])
    np.copyto(tracks.extent_m, measured.extent_m, where=visible[:, None])
    np.copyto(tracks.cells, measured.cells, where=visible)


@compiled(Regions, Tracks, Pose, DepthNoise, "boolean, float64")
def _kinds(
    measured: Regions, tracks: Tracks, pose: Pose, noise: DepthNoise, motion_known: bool, gain: float
) -> tuple[NDArray[np.intp], FloatArray, FloatArray, FloatArray]:
    """Classify each surface.

    Returns its kind (T,), its centroid in the fixed frame (T, 3), the relative change from its usual area
    (T,), and the usual area (T,), updated with gain. tracks: with the verdict of the frame before. pose: of
    the camera. gain: of the running average.
    """
    count, sides_visible = len(measured.cells), measured.sides_visible
    kind, change, usual_m2 = np.full(count, _NOT_VISIBLE), np.zeros(count), tracks.area_m2.copy()
    centre_m = np.zeros((count, 3))
    for t in range(count):
        cells, moving = measured.cells[t], tracks.moving[t]
        if cells < MIN_PART_CELLS:
            continue
        depth_m = measured.position_m[t, 2]
        now_m2 = cells * (depth_m * depth_m)
        if tracks.sightings[t] == 0:
            usual_m2[t] = now_m2
        change[t] = abs(now_m2 - usual_m2[t]) / usual_m2[t]
        centre_m[t], squared = outer_point(pose, measured.position_m[t]), 0.0
        for i in range(3):
            squared += (centre_m[t, i] - tracks.state[t, i]) ** 2
        expected_m = _JUMP_M + 2.0 * depth_sigma_of(depth_m, noise)
        # Without a known motion of the camera, its error would be taken for a motion of the tracks.
        steady = motion_known and math.sqrt(squared) <= expected_m
        if sides_visible[t] and change[t] <= _SAME_AREA and steady:
            kind[t] = _WHOLE
        elif moving and now_m2 < _NEARLY_HIDDEN_SHARE * usual_m2[t]:
            # The visible rest of a mover that is passing behind something does not show where its body is.
            kind[t] = _NEARLY_HIDDEN
            continue
        elif moving and steady:
            kind[t] = _PARTIAL
        else:
            kind[t] = _POSITION_ONLY
        usual_m2[t] += gain * (now_m2 - usual_m2[t])
    return kind, centre_m, change, usual_m2


@compiled("int64[::1]", Regions, Pose, DepthNoise)
def _centre_covariances(
    kind: NDArray[np.intp], measured: Regions, pose: Pose, noise: DepthNoise
) -> FloatArray:
    """(T, 3, 3) covariance of the centroids in the fixed frame. pose: of the camera."""
    covariance, variance, rotation = np.zeros((len(kind), 3, 3)), np.empty(3), pose.rotation
    for t in range(len(kind)):
        if kind[t] == _NOT_VISIBLE:
            continue
        width_m, height_m, deep_m = measured.extent_m[t]
        size_m, depth_m = max(width_m, height_m), measured.position_m[t, 2]
        across_m = _CENTRE_SIGMA_M + _CENTRE_SHARE * size_m
        along_m = _CENTRE_SIGMA_M + _CENTRE_DEPTH_SHARE * deep_m
        noise_m = _CENTRE_NOISE * depth_sigma_of(depth_m, noise)
        variance[0] = across_m**2
        variance[1] = across_m**2 if measured.top_and_bottom_visible[t] else _CUT_SIGMA_M**2
        variance[2] = along_m**2 + noise_m**2
        if kind[t] == _PARTIAL:
            variance += (_SHIFT_SHARE * size_m) ** 2
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    covariance[t, i, j] += rotation[i, k] * variance[k] * rotation[j, k]
    return covariance


@inlined
def _box_m(measured: Regions, t: int, camera: Intrinsics) -> tuple[float, float, float, float]:
    """Left, upper, right, lower edge of an image box as offsets from the centroid, in metres at its depth."""
    u0, v0, u1, v1 = measured.bbox_px[t]
    x, y, z = measured.position_m[t]
    left, upper = ray_through(camera, u0, v0)
    right, lower = ray_through(camera, u1, v1)
    return left * z - x, upper * z - y, right * z - x, lower * z - y


@compiled(Tracks, Regions, "int64[::1]", Intrinsics, "int64, float64")
def _views(
    tracks: Tracks,
    measured: Regions,
    kind: NDArray[np.intp],
    camera: Intrinsics,
    step_px: int,
    dt_s: float,
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """nearly_hidden (T,), velocity_measured_s (T,) and box_m (T, 4) of the tracks after this frame."""
    nearly_hidden, box_m = tracks.nearly_hidden.copy(), tracks.box_m.copy()
    measured_s = np.zeros(len(kind))
    for t in range(len(kind)):
        if kind[t] == _NOT_VISIBLE:
            continue
        sides = measured.sides_visible[t] and measured.top_and_bottom_visible[t]
        whole = sides and not measured.overlapped[t]
        # The rest of what reaches the left or right border of the image may lie outside.
        left, right = measured.bbox_px[t, 0], measured.bbox_px[t, 2]
        at_border = left <= step_px or right >= camera.width - step_px
        nearly_hidden[t] = kind[t] == _NEARLY_HIDDEN and not at_border
        if kind[t] == _WHOLE and whole:
            measured_s[t] = tracks.velocity_measured_s[t] + dt_s
        if (whole and kind[t] != _NEARLY_HIDDEN) or tracks.sightings[t] == 0:
            box_m[t] = _box_m(measured, t, camera)
    return nearly_hidden, measured_s, box_m
