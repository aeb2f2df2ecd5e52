"""All evidence of one frame on whether the tracks move; vision/bodies/judgement.py decides by it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from hal.records import record
from hal.types import Flags, FloatArray, Integers, Matrices, Matrix, Vector
from vision.bodies.approach import ApproachSpeeds
from vision.bodies.rim_motion import RimVelocities
from vision.bodies.tracks import Tracks
from vision.depth.depth_noise import depth_sigma_m
from vision.detection import Detection
from vision.ego_motion.camera_motion import MIN_AGREEMENT
from vision.motion.least_squares import BodyVelocities
from vision.motion.limbs import believable, restless

# Without odometry: if at least this share of the fragments fits one motion of the camera, it is beyond doubt.
_AGREED = 0.65
# Minimum weight of a frame's proof, where hardly enough fragments agree: two people in front of the camera
# may be half of what it sees.
_MIN_BORNE_OUT = 0.2


@record(frozen=True, slots=True, eq=False)
class FrameMeasures:
    """What one frame measures of T tracks.

    fragments, rims, approach: their velocities by their fragments, free rims and depth.
    arrived, cells: number of newly arrived cells of each surface, and of all its cells, (T,).
    keeps_area: the surface has about as many cells as when it was last seen, (T,).
    """

    fragments: BodyVelocities
    rims: RimVelocities
    approach: ApproachSpeeds
    arrived: Integers
    cells: Integers
    keeps_area: Flags


@record(frozen=True, slots=True, eq=False)
class MotionEvidence:
    """Evidence of T tracks, (T, ...) each unless stated; vectors along the axes of the fixed frame.

    sight: unit vector from the camera, (T, 3).
    distance_m: from the camera.
    depth_sigma_m: standard deviation of one pixel's depth at that distance.
    velocity, covariance: as filtered, (T, 3) and (T, 3, 3), m/s.
    own_velocity, own_covariance: by this frame's fragments alone.
    surface_velocity, surface_covariance: by the centre of the surface alone.
    ends: number of ends that own_velocity rests on.
    agreement: share of these that agree with it.
    restless: most ends contradict standing still, whether they agree with each other or not.
    restless_s: for how long the track has been restless.
    arrived, cells: of the surface.
    arriving_s: for how long part of the surface has been newly arrived.
    keeps_area: the surface is about as large as when it was last seen.
    size_m: largest extent of the surface.
    velocity_measured_s: for how long the centre has measured the velocity without a break.
    rim_mps: speed across the line of sight by its free rims, 0 where they show none.
    rim_sigmas: how many standard deviations rim_mps is from zero.
    rim_s: for how long they have shown motion without a break.
    approach_mps: speed towards the camera by the depth of the surface, 0 where it shows none.
    approach_s: for how long it has been shown without a break.
    view_radps: how fast the viewing direction changes.
    growth_mps: speed of the centre that a growing or shrinking visible part can explain.
    advances: the centre really advances about as fast as the velocity says.
    border_is_guess: the border to the static surface beside it is a guess.
    up: the floor's normal, (3,); None where it is not known.
    trusted: the camera's motion is known.
    reckoned: it is supported by odometry, not by the images alone.
    borne_out: how well the fragments support it, 0..1.
    """

    sight: Matrix
    distance_m: Vector
    depth_sigma_m: Vector
    velocity: Matrix
    covariance: Matrices
    own_velocity: Matrix
    own_covariance: Matrices
    surface_velocity: Matrix
    surface_covariance: Matrices
    ends: Integers
    agreement: Vector
    restless: Flags
    restless_s: Vector
    arrived: Integers
    arriving_s: Vector
    cells: Integers
    keeps_area: Flags
    size_m: Vector
    velocity_measured_s: Vector
    rim_mps: Vector
    rim_sigmas: Vector
    rim_s: Vector
    approach_mps: Vector
    approach_s: Vector
    view_radps: Vector
    growth_mps: Vector
    advances: Flags
    border_is_guess: Flags
    up: FloatArray | None
    trusted: bool
    reckoned: bool
    borne_out: float


def evidence_of(
    tracks: Tracks,
    detection: Detection,
    measures: FrameMeasures,
    advances: NDArray[np.bool_],
    noise: DepthNoise,
) -> MotionEvidence:
    """Gather the evidence of this frame; the filters of tracks have to be updated before.

    advances (T,): see MotionEvidence.
    """
    body, rims, approach = measures.fragments, measures.rims, measures.approach
    rotation = detection.pose.rotation
    sight, distance_m = tracks.sight(detection.pose.translation_m)
    return MotionEvidence(
        sight=sight,
        distance_m=distance_m,
        depth_sigma_m=np.asarray(depth_sigma_m(distance_m, noise), np.float64),
        velocity=tracks.velocity_mps,
        covariance=tracks.covariance[:, 3:, 3:],
        own_velocity=body.velocity_mps @ rotation.T,
        own_covariance=rotation @ body.covariance @ rotation.T,
        surface_velocity=tracks.surface_state[:, 3:],
        surface_covariance=tracks.surface_covariance[:, 3:, 3:],
        ends=body.ends * believable(body),
        agreement=body.agreement,
        restless=restless(body),
        restless_s=tracks.restless_s,
        arrived=measures.arrived,
        arriving_s=tracks.arriving_s,
        cells=measures.cells,
        keeps_area=measures.keeps_area,
        size_m=tracks.size_m,
        velocity_measured_s=tracks.velocity_measured_s,
        rim_mps=rims.mps,
        rim_sigmas=rims.sigmas,
        rim_s=np.abs(tracks.rim_s),
        approach_mps=approach.mps,
        approach_s=tracks.approach_s,
        growth_mps=tracks.growth_mps,
        up=detection.floor_normal,
        view_radps=view_radps(detection, sight, distance_m),
        advances=advances,
        border_is_guess=tracks.border_is_guess,
        trusted=detection.motion_known,
        reckoned=detection.reckoned,
        borne_out=borne_out(detection),
    )


def view_radps(detection: Detection, sight: FloatArray, distance_m: FloatArray) -> FloatArray:
    """(T,) rate at which the camera's translation changes the viewing direction of each track.

    sight (T, 3): unit vectors from the camera to the tracks. distance_m (T,): their distances.
    """
    ego = detection.ego_motion
    if ego.dt_s <= 0.0:
        return np.zeros(len(sight))
    way = detection.pose.rotation @ ego.motion.translation_m / ego.dt_s
    return _turns(way, sight, distance_m)


@compiled("float64[:], float64[:, ::1], float64[::1]")
def _turns(way: FloatArray, sight: FloatArray, distance_m: FloatArray) -> FloatArray:
    """As view_radps. way (3,): velocity of the camera in the fixed frame, m/s."""
    squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
    turn = np.empty(len(sight))
    for t in range(len(sight)):
        ahead = sight[t, 0] * way[0] + sight[t, 1] * way[1] + sight[t, 2] * way[2]
        turn[t] = math.sqrt(max(squared - ahead * ahead, 0.0)) / max(distance_m[t], 0.1)
    return turn


def borne_out(detection: Detection) -> float:
    """Weight of this frame's proof, 0..1, according to how well the camera's own motion is known.

    Without odometry, and with hardly more agreeing fragments than the minimum, the estimated motion may be
    relative to something that moves. Then everything static seems to move for as long as the mistake lasts.
    """
    if detection.reckoned:
        return 1.0
    spare = (detection.ego_motion.inlier_ratio - MIN_AGREEMENT) / (_AGREED - MIN_AGREEMENT)
    return min(spare, 1.0) if spare > _MIN_BORNE_OUT else _MIN_BORNE_OUT  # NaN gives the minimum
