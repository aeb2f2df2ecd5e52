"""What tracking knows, put into the Scene and the Fragments that others read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.bodies.boxes import overlaps
from vision.bodies.tracks import Tracks
from vision.detection import Detection
from vision.motion.least_squares import FragmentVelocities
from vision.scene import Fragments, Obstacle

MIN_SIGHTINGS = 3  # frames: what lasts for one or two is taken for a speckle
_LISTED_UNSEEN_S = 0.15  # a track is remembered for longer, but no longer shown as seen
_WAY_SIGMA_M = 0.06  # one sigma of where a mover went that is not seen
_STATIC_SCORE = 0.5  # nothing is estimated of what stands: neither sure nor unsure
_LAST_CELLS = 12  # less of a sliver is no sight of anybody
_OVERHEAD_CELLS = 24  # half of a head, 6 m away
# For so long a new mover may be a piece of something else, at most so far before or behind it: of a mover so
# many times as large that covers so much of it, as a wheel of a cart is; or, if it is less than half of a
# body and ends in what stands by guess, of somebody close to that, as a leg is.
_PIECE_S = 0.3
_PIECE_M = 1.5
_PIECE_OF = 2.0
_PIECE_SHARE = 0.3
_PIECE_M2 = 0.5


def obstacles(tracks: Tracks, detection: Detection) -> tuple[Obstacle, ...]:
    """The tracks seen often enough, in the camera axes of the detection."""
    pose = detection.pose
    local = (tracks.state[:, :3] - pose.translation_m) @ pose.rotation
    velocity = tracks.state[:, 3:] @ pose.rotation
    covariance = pose.rotation.T @ tracks.covariance[:, 3:, 3:] @ pose.rotation
    unseen_s: FloatArray = np.multiply(detection.captured_ns - tracks.seen_ns, 1e-9, dtype=np.float64)
    listed = (tracks.sightings >= MIN_SIGHTINGS) & (local[:, 2] > 0.0) & _expected(tracks, unseen_s)
    bbox, unseen = tracks.bbox_px, unseen_s != 0.0
    # What is above the robot may end there. What goes has legs behind what hides them; of slivers that is
    # hard to tell.
    listed &= ~tracks.overhead | (tracks.moving & (tracks.cells >= _OVERHEAD_CELLS))
    # A mover that is out of sight, but for a sliver, is where it goes, whole, and not where its rest is seen.
    whole = tracks.moving & (unseen | tracks.sliver)
    if unseen.any():
        listed &= ~unseen | _in_view(local, detection)
    if whole.any():
        expected_px, rest = _expected_px(tracks.box_m, local, detection), ~unseen
        expected_px[rest, :2] = np.minimum(expected_px[rest, :2], bbox[rest, :2])
        expected_px[rest, 2:] = np.maximum(expected_px[rest, 2:], bbox[rest, 2:])
        bbox = np.where(whole[:, None], expected_px, bbox)
    told = tracks.moving & ~_pieces(tracks, listed, bbox, local[:, 2], detection.camera.fx)
    result = []
    for t in listed.nonzero()[0].tolist():
        moving = bool(told[t])
        u0, v0, u1, v1 = bbox[t].tolist()
        result.append(
            Obstacle(
                id=int(tracks.ids[t]),
                bbox_px=(u0, v0, u1, v1),
                position_m=local[t],
                extent_m=tracks.extent_m[t].copy(),
                velocity_mps=velocity[t],
                velocity_cov=covariance[t],
                moving=moving,
                score=float(tracks.confidence[t]) if moving else _STATIC_SCORE,
                fragments=int(tracks.fragments[t]),
                age_s=(detection.captured_ns - int(tracks.born_ns[t])) * 1e-9,
                unseen_s=float(unseen_s[t]),
            )
        )
    return tuple(result)


def _pieces(
    tracks: Tracks, listed: NDArray[np.bool_], bbox_px: FloatArray, depth_m: FloatArray, focal_px: float
) -> NDArray[np.bool_]:
    """(T,) movers so new that they may be a piece of something larger."""
    result = np.zeros(len(tracks), np.bool_)
    new = (tracks.moving & listed & (tracks.moving_s < _PIECE_S)).nonzero()[0]
    if len(new):
        area_px = (bbox_px[:, 2:] - bbox_px[:, :2]).prod(axis=1)
        small = area_px * np.square(depth_m / focal_px) < _PIECE_M2
        covered, own_px = overlaps(bbox_px[new, None], bbox_px), area_px[new, None]
        piece = tracks.moving & (area_px >= _PIECE_OF * own_px) & (covered >= _PIECE_SHARE)
        piece |= (small & tracks.guessed)[new, None] & (area_px > own_px) & (covered > 0.0)
        piece &= listed & (np.abs(depth_m - depth_m[new, None]) <= _PIECE_M)
        result[new] = piece.any(axis=1)
    return result


def _expected(tracks: Tracks, unseen_s: FloatArray) -> NDArray[np.bool_]:
    """(T,) of which it is known well enough where they went since they were seen unseen_s (T,) ago."""
    known = ~tracks.moving | (tracks.velocity_sigma_mps * unseen_s <= _WAY_SIGMA_M)
    # What was seen last of somebody who went behind something tells little of where he is now.
    known &= ~(tracks.moving & tracks.sliver) | (tracks.cells >= _LAST_CELLS)
    result: NDArray[np.bool_] = (unseen_s <= _LISTED_UNSEEN_S) & known
    return result


def _expected_px(box_m: FloatArray, local_m: FloatArray, detection: Detection) -> FloatArray:
    """(T, 4) boxes in the image, cut at its border, of bodies at local_m (T, 3) with edges box_m (T, 4)."""
    camera = detection.camera
    depth = np.maximum(local_m[:, 2:], 0.1)
    u = (local_m[:, :1] + box_m[:, 0::2]) / depth * camera.fx + camera.cx
    v = (local_m[:, 1:2] + box_m[:, 1::2]) / depth * camera.fy + camera.cy
    u, v = np.clip(u, 0.0, camera.width), np.clip(v, 0.0, camera.height)
    return np.stack((u[:, 0], v[:, 0], u[:, 1], v[:, 1]), axis=1)


def _in_view(local_m: FloatArray, detection: Detection) -> NDArray[np.bool_]:
    """(T,) whether points (T, 3) of the camera frame project into the image."""
    camera = detection.camera
    depth = np.maximum(local_m[:, 2], 0.1)
    u = local_m[:, 0] / depth * camera.fx + camera.cx
    v = local_m[:, 1] / depth * camera.fy + camera.cy
    result: NDArray[np.bool_] = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return result


def fragments(
    detection: Detection,
    owner: NDArray[np.int64],
    moving: NDArray[np.bool_],
    velocities: FragmentVelocities,
) -> Fragments:
    """The fragments with their owners (N,) and whether these move (N,)."""
    camera = detection.camera
    depth = (0.5 * (detection.near_m[:, 0] + detection.near_m[:, 1])).astype(float)
    middle = (0.5 * (detection.ends_px[:, 0] + detection.ends_px[:, 1])).astype(float)
    position = np.empty((len(depth), 3))
    position[:, 0] = (middle[:, 0] - camera.cx) / camera.fx * depth
    position[:, 1] = (middle[:, 1] - camera.cy) / camera.fy * depth
    position[:, 2] = depth
    usable = detection.motion.usable.reshape(-1, 2)
    measured = (usable[:, 0] | usable[:, 1])[:, None]
    sigma = np.sqrt(np.diagonal(velocities.covariance, axis1=1, axis2=2))
    return Fragments(
        ids=detection.ids,
        ends_px=detection.ends_px,
        depth_m=depth,
        position_m=position,
        velocity_mps=np.where(measured, velocities.velocity_mps, np.nan),
        velocity_sigma_mps=np.where(measured, sigma, np.nan),
        moving=moving,
        obstacle_id=owner,
    )
