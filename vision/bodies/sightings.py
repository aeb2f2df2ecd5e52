"""Measurement update of each track's filters by the centroid of its visible surface.

What the centroid measures depends on what is seen:

* Position and velocity (Tracks.locate): the same whole surface as before, neither cut at its side by the
  image's border nor hidden there, of about its usual area, and without a jump.
* Position and velocity, but with a larger variance: any other surface of a track that is known to move. A
  body cannot be far from what is seen of it.
* Position only (Tracks.relocate): a surface of a static track that is cut, hidden in part or suddenly another
  one; any surface after a jump, or while the camera's own motion is not known.
* Neither: a sliver, the little that is left to see of a mover that goes behind something.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray, Intrinsics, Pose
from vision.bodies.grouping import ExpectedBodies
from vision.bodies.tracks import Tracks
from vision.depth.depth_mask import depth_sigma_m
from vision.depth.regions import Regions
from vision.detection import Detection

MIN_CELLS = 6  # as many as a part has (_SPECKLE_CELLS of vision/depth/regions.py)
_CENTRE_SIGMA_M = 0.015  # of the centre of the smallest thing: a cell is as wide 2.3 m away
_CENTRE_SHARE = 0.0125  # of its size, across the line of sight: cells at the rim come and go
_CENTRE_DEPTH_SHARE = 0.04  # of its size along the line of sight, where what is seen of it changes more
_SHIFT_SHARE = 0.35  # of its size: the middle of what is seen of a body, from where it is while all is seen
_CUT_SIGMA_M = 1.0  # in height, of what reaches beyond the image above or below
_CENTRE_NOISE = 0.2  # of a pixel's depth noise: neighbours share it, so that it does not average out
_SAME_AREA = 0.3  # a surface that grows or shrinks by more is not the same part of its body
_AREA_MEMORY_S = 0.32  # a tenth of what is new each frame at 30 a second
_SLIVER = 0.4  # of its usual surface
_JUMP_M = 0.3  # and two sigmas of depth: a centre farther from where it was expected has jumped


def see(tracks: Tracks, detection: Detection, measured: Regions, noise: DepthNoise) -> None:
    """Update tracks with the surfaces measured, entry k for track k; without cells they stay as predicted."""
    visible = measured.cells >= MIN_CELLS
    tracks.clean_s[~visible] = 0.0
    seen = visible.nonzero()[0]
    if len(seen) == 0:
        return
    position = detection.pose.apply(measured.position_m[seen])
    depth = measured.position_m[seen, 2]
    covariance = _centre_covariance(measured, seen, detection.pose.rotation, noise)
    area_m2 = measured.cells[seen] * np.square(depth)
    usual_m2 = np.where(tracks.sightings[seen] == 0, area_m2, tracks.area_m2[seen])
    change = np.abs(area_m2 - usual_m2) / usual_m2
    jump = np.sqrt(np.square(position - tracks.state[seen, :3]).sum(axis=1))
    steady = jump <= _JUMP_M + 2.0 * depth_sigma_m(depth, noise)
    steady &= detection.motion_known  # else the camera's own error would be theirs
    smooth = measured.wide[seen] & (change <= _SAME_AREA) & steady
    # What is left to see of a mover that goes behind something is not where its body is.
    sliver = tracks.moving[seen] & (area_m2 < _SLIVER * usual_m2)
    rough = ~smooth & ~sliver & steady & tracks.moving[seen]
    cut = ~smooth & ~sliver & ~rough
    tracks.sliver[seen] = sliver & ~_at_border(measured.bbox_px[seen], detection)
    located, doubt = (smooth | rough).nonzero()[0], covariance
    if rough.any():
        shift_m = np.where(rough, _SHIFT_SHARE * measured.extent_m[seen, :2].max(axis=1), 0.0)
        doubt = covariance + np.square(shift_m)[:, None, None] * np.eye(3)
    tracks.locate(seen[located], position[located], doubt[located])
    tracks.relocate(seen[cut], position[cut], covariance[cut])
    clean = smooth & measured.whole[seen]
    tracks.clean_s[seen] = np.where(clean, tracks.clean_s[seen] + detection.dt_s, 0.0)
    tracks.growth_mps[seen] = change * measured.extent_m[seen, 0] / _AREA_MEMORY_S
    gain = -math.expm1(-detection.dt_s / _AREA_MEMORY_S)
    tracks.area_m2[seen] = np.where(sliver, usual_m2, usual_m2 + gain * (area_m2 - usual_m2))
    tracks.seen_ns[seen] = detection.captured_ns
    tracks.sightings[seen] += 1
    tracks.bbox_px[seen] = measured.bbox_px[seen]
    shown = seen[(measured.whole[seen] & ~sliver) | (tracks.sightings[seen] == 1)]
    tracks.box_m[shown] = _box_m(measured, shown, detection.camera)
    tracks.extent_m[seen] = measured.extent_m[seen]
    tracks.cells[seen] = measured.cells[seen]


def expected_bodies(tracks: Tracks, pose: Pose, noise: DepthNoise) -> ExpectedBodies:
    """Where the bodies of tracks are expected by a camera at pose."""
    centre_m = pose.inverse().apply(tracks.state[:, :3])
    sigma_m: FloatArray = np.asarray(depth_sigma_m(np.maximum(centre_m[:, 2], 0.0), noise), np.float64)
    return ExpectedBodies(centre_m, tracks.extent_m, tracks.box_m, sigma_m)


def up(detection: Detection) -> FloatArray | None:
    """(3,) the floor's normal in the fixed frame; None where the floor is not known."""
    normal = detection.grid.up
    return None if normal is None else np.asarray(detection.pose.rotation @ normal)


def view_radps(detection: Detection, sight: FloatArray, distance_m: FloatArray) -> FloatArray:
    """(T,) rate at which the camera's way turns directions sight (T, 3) to what is distance_m (T,) off."""
    ego = detection.ego_motion
    if ego.dt_s <= 0.0:
        return np.zeros(len(sight))
    way = detection.pose.rotation @ ego.motion.translation_m / ego.dt_s
    ahead = sight @ way
    turn: FloatArray = np.sqrt(np.maximum(way @ way - ahead * ahead, 0.0))
    return turn / np.maximum(distance_m, 0.1)


def _box_m(measured: Regions, seen: NDArray[np.intp], camera: Intrinsics) -> FloatArray:
    """(K, 4) left, upper, right and lower edge of surfaces seen (K,) from their centres, at their depth."""
    centre_m = measured.position_m[seen]
    middle_px = np.array([camera.cx, camera.cy, camera.cx, camera.cy])
    focal_px = np.array([camera.fx, camera.fy, camera.fx, camera.fy])
    edges_m: FloatArray = (measured.bbox_px[seen] - middle_px) / focal_px * centre_m[:, 2:]
    edges_m -= centre_m.take((0, 1, 0, 1), axis=1)
    return edges_m


def _at_border(bbox_px: FloatArray, detection: Detection) -> NDArray[np.bool_]:
    """(K,) boxes (K, 4) that reach the left or right border of the image: their rest is outside of it."""
    step_px = detection.grid.step_px
    result: NDArray[np.bool_] = (bbox_px[:, 0] <= step_px) | (
        bbox_px[:, 2] >= detection.camera.width - step_px
    )
    return result


def _centre_covariance(
    measured: Regions, seen: NDArray[np.intp], rotation: FloatArray, noise: DepthNoise
) -> FloatArray:
    """(K, 3, 3) of the centres of the surfaces seen (K,), in the fixed frame that rotation leads to."""
    extent, sigma = measured.extent_m[seen], depth_sigma_m(measured.position_m[seen, 2], noise)
    covariance = np.zeros((len(seen), 3, 3))
    across = _CENTRE_SIGMA_M + _CENTRE_SHARE * extent[:, :2].max(axis=1)
    covariance[:, 0, 0] = np.square(across)
    covariance[:, 1, 1] = np.where(measured.tall[seen], np.square(across), _CUT_SIGMA_M**2)
    along = _CENTRE_SIGMA_M + _CENTRE_DEPTH_SHARE * extent[:, 2]
    covariance[:, 2, 2] = np.square(along) + np.square(_CENTRE_NOISE * sigma)
    result: FloatArray = rotation @ covariance @ rotation.T
    return result
