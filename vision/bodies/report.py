"""The last step of tracking: tracks and fragments are written as the Obstacles and Fragments of the Scene."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray, Intrinsics, Pose
from vision.bodies.boxes import overlaps
from vision.bodies.tracks import Tracks
from vision.camera.lens import MIN_AHEAD_M, pixel_of, ray_through
from vision.detection import Detection
from vision.motion.least_squares import FragmentVelocities
from vision.motion.velocities import EndResiduals
from vision.numerics.pose_axes import inner_point, inner_vector
from vision.scene import Fragments, Obstacle

MIN_SIGHTINGS = 3  # frames: a track seen in one or two is taken for a speckle
_LISTED_UNSEEN_S = 0.15  # maximum time unseen for a listed track; tracks themselves are kept for longer
_WAY_SIGMA_M = 0.06  # maximum standard deviation of an unseen mover's displacement for it to be listed
_STATIC_SCORE = 0.5  # score of static obstacles, for which no confidence is estimated
# Minimum cells of a nearly hidden mover: with fewer, the mover's position is not known well enough.
_LAST_CELLS = 12
_OVERHEAD_CELLS = 24  # half of a head, 6 m away
# For some time a new mover may be a piece of another one and is not reported as moving: a wheel of a cart, or
# a leg of a person close to a static surface.
_PIECE_S = 0.3  # duration of that time
_PIECE_M = 1.5  # maximum difference in depth between the piece and the mover
_PIECE_OF = 2.0  # wheel: the mover's area in the image is larger than the piece's by at least this factor
_PIECE_SHARE = 0.3  # wheel: minimum share of the piece that the mover's box covers
_PIECE_M2 = 0.5  # leg: maximum area of the piece, less than half of a body; its border has to be a guess too


def obstacles(tracks: Tracks, detection: Detection) -> tuple[Obstacle, ...]:
    """The tracks that are listed as obstacles, in the camera axes of the detection."""
    camera, moving = detection.camera, tracks.moving
    local, velocity, covariance = _in_camera(tracks, detection.pose)
    unseen_s: FloatArray = np.multiply(detection.captured_ns - tracks.seen_ns, 1e-9, dtype=np.float64)
    listed, bbox = _listed(tracks, local, unseen_s, camera)
    reported_moving = moving & ~_pieces(tracks, listed, bbox, local[:, 2], camera.fx)
    result = []
    ids, born_ns, fragments_on = tracks.ids.tolist(), tracks.born_ns.tolist(), tracks.fragments.tolist()
    score, unseen, is_moving = tracks.confidence.tolist(), unseen_s.tolist(), reported_moving.tolist()
    boxes, extent_m = bbox.tolist(), tracks.extent_m.copy()
    for t in listed.nonzero()[0].tolist():
        u0, v0, u1, v1 = boxes[t]
        result.append(
            Obstacle(
                id=ids[t],
                bbox_px=(u0, v0, u1, v1),
                position_m=local[t],
                extent_m=extent_m[t],
                velocity_mps=velocity[t],
                velocity_cov=covariance[t],
                moving=is_moving[t],
                score=score[t] if is_moving[t] else _STATIC_SCORE,
                fragments=fragments_on[t],
                age_s=(detection.captured_ns - born_ns[t]) * 1e-9,
                unseen_s=unseen[t],
            )
        )
    return tuple(result)


@compiled(Tracks, Pose)
def _in_camera(tracks: Tracks, pose: Pose) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position (T, 3), velocity (T, 3) and its covariance (T, 3, 3) in the axes of the camera at pose."""
    state, covariance, rotation = tracks.state, tracks.covariance, pose.rotation
    count = len(state)
    local, velocity, spread = np.empty((count, 3)), np.empty((count, 3)), np.zeros((count, 3, 3))
    for t in range(count):
        local[t] = inner_point(pose, state[t, :3])
        velocity[t] = inner_vector(pose, state[t, 3:])
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    for m in range(3):
                        spread[t, i, j] += rotation[k, i] * covariance[t, 3 + k, 3 + m] * rotation[m, j]
    return local, velocity, spread


@inlined
def _position_known(unseen_s: float, cells: int, moving: bool, nearly_hidden: bool, sigma_mps: float) -> bool:
    """Whether the present position of a track is known well enough, unseen_s after it was last seen."""
    if unseen_s > _LISTED_UNSEEN_S or (moving and not sigma_mps * unseen_s <= _WAY_SIGMA_M):
        return False
    # The last visible rest of a mover that went behind something tells little about its present position.
    return not (moving and nearly_hidden) or cells >= _LAST_CELLS


@inlined
def _expected_box(
    box_m: FloatArray, x: float, y: float, z: float, camera: Intrinsics
) -> tuple[float, float, float, float]:
    """Left, upper, right, lower edge in the image of a whole body with its centre at x, y, z.

    box_m (4,): as in Tracks.
    """
    left_m, upper_m, right_m, lower_m = box_m
    left, upper = pixel_of(camera, x + left_m, y + upper_m, z)
    right, lower = pixel_of(camera, x + right_m, y + lower_m, z)
    return (
        min(max(left, 0.0), camera.width),
        min(max(upper, 0.0), camera.height),
        min(max(right, 0.0), camera.width),
        min(max(lower, 0.0), camera.height),
    )


@compiled(Tracks, "float64[:, ::1], float64[::1]", Intrinsics)
def _listed(
    tracks: Tracks, local: FloatArray, unseen_s: FloatArray, camera: Intrinsics
) -> tuple[NDArray[np.bool_], FloatArray]:
    """Which tracks are listed, (T,); and their boxes in the image, cut at its border, (T, 4).

    local (T, 3): centres in the camera axes. unseen_s (T,): time since they were last seen.
    """
    listed, bbox = np.zeros(len(local), np.bool_), tracks.bbox_px.copy()
    for t in range(len(local)):
        x, y, z = local[t, 0], local[t, 1], max(local[t, 2], MIN_AHEAD_M)
        moving, nearly_hidden, cells = tracks.moving[t], tracks.nearly_hidden[t], tracks.cells[t]
        spread = tracks.covariance[t]
        sigma_mps = math.sqrt(spread[3, 3] + spread[4, 4] + spread[5, 5])
        listed[t] = tracks.sightings[t] >= MIN_SIGHTINGS and local[t, 2] > 0.0
        listed[t] = listed[t] and _position_known(unseen_s[t], cells, moving, nearly_hidden, sigma_mps)
        # Something seen only above the robot may hang there. But a mover has legs, which something hides; a
        # nearly hidden one shows too little to tell.
        legs = moving and cells >= _OVERHEAD_CELLS
        listed[t] = listed[t] and (not tracks.overhead[t] or legs)
        unseen = unseen_s[t] != 0.0
        if unseen:
            u, v = pixel_of(camera, x, y, z)
            listed[t] = listed[t] and 0.0 <= u < camera.width and 0.0 <= v < camera.height
        # The box of a mover that is hidden, or nearly hidden, is that of the whole body at its
        # predicted position, not that of the visible rest.
        if moving and (unseen or nearly_hidden):
            bbox[t] = _expected_box(tracks.box_m[t], x, y, z, camera)
            if not unseen:
                seen = tracks.bbox_px[t]
                bbox[t, 0], bbox[t, 1] = min(bbox[t, 0], seen[0]), min(bbox[t, 1], seen[1])
                bbox[t, 2], bbox[t, 3] = max(bbox[t, 2], seen[2]), max(bbox[t, 3], seen[3])
    return listed, bbox


def _pieces(
    tracks: Tracks, listed: NDArray[np.bool_], bbox_px: FloatArray, depth_m: FloatArray, focal_px: float
) -> NDArray[np.bool_]:
    """(T,) new movers that may be a piece of a larger mover."""
    result = np.zeros(len(tracks), np.bool_)
    new = (tracks.moving & listed & (tracks.moving_s < _PIECE_S)).nonzero()[0]
    if len(new):
        area_px = (bbox_px[:, 2:] - bbox_px[:, :2]).prod(axis=1)
        small = area_px * np.square(depth_m / focal_px) < _PIECE_M2
        covered, own_px = overlaps(bbox_px[new, None], bbox_px), area_px[new, None]
        piece = tracks.moving & (area_px >= _PIECE_OF * own_px) & (covered >= _PIECE_SHARE)
        piece |= (small & tracks.border_is_guess)[new, None] & (area_px > own_px) & (covered > 0.0)
        piece &= listed & (np.abs(depth_m - depth_m[new, None]) <= _PIECE_M)
        result[new] = piece.any(axis=1)
    return result


def fragments(
    detection: Detection,
    owner: NDArray[np.int64],
    moving: NDArray[np.bool_],
    velocities: FragmentVelocities,
) -> Fragments:
    """The Fragments of the Percept. owner (N,): ids of their tracks. moving (N,): whether these move."""
    depth, position, velocity, sigma = _of_fragments(
        detection, detection.motion, velocities, detection.camera
    )
    return Fragments(
        ids=detection.ids,
        ends_px=detection.ends_px,
        depth_m=depth,
        position_m=position,
        velocity_mps=velocity,
        velocity_sigma_mps=sigma,
        moving=moving,
        obstacle_id=owner,
    )


@compiled(Detection, EndResiduals, FragmentVelocities, Intrinsics)
def _of_fragments(
    detection: Detection, motion: EndResiduals, velocities: FragmentVelocities, camera: Intrinsics
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Depth (N,) and position (N, 3) of the fragments' middles; velocity (N, 3) and its sigma (N, 3).

    Velocity and sigma are NaN where neither of the two ends is usable.
    """
    ends_px, near_m, count = detection.ends_px, detection.near_m, len(detection.ends_px)
    depth, position = np.empty(count), np.empty((count, 3))
    velocity, sigma = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    for k in range(count):
        depth[k] = np.float32(0.5) * (near_m[k, 0] + near_m[k, 1])
        u = np.float32(0.5) * (ends_px[k, 0, 0] + ends_px[k, 1, 0])
        v = np.float32(0.5) * (ends_px[k, 0, 1] + ends_px[k, 1, 1])
        x, y = ray_through(camera, u, v)
        position[k, 0], position[k, 1], position[k, 2] = x * depth[k], y * depth[k], depth[k]
        if motion.usable[2 * k] or motion.usable[2 * k + 1]:
            for i in range(3):
                velocity[k, i] = velocities.velocity_mps[k, i]
                sigma[k, i] = math.sqrt(velocities.covariance[k, i, i])
    return depth, position, velocity, sigma
