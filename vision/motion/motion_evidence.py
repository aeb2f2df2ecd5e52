"""What one frame says of whether the tracks move: vision/bodies/judgement.py adds it up and decides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray
from vision.bodies import sightings
from vision.bodies.tracks import Tracks
from vision.depth.depth_noise import depth_sigma_m
from vision.detection import LEAST_AGREEMENT, Detection
from vision.motion.least_squares import BodyVelocities
from vision.motion.limbs import believable, restless

# Without odometry: so large a share of the fragments on one motion of the camera leaves no doubt about it.
_AGREED = 0.65
_LEAST_BORNE_OUT = 0.2  # two people before the camera are half of what it sees


@dataclass(frozen=True, slots=True, eq=False)
class MotionEvidence:
    """Of T tracks, along the axes of the fixed frame.

    sight (T, 3): unit vector from the camera; distance_m (T,); depth_sigma_m (T,): of one pixel's depth
    there. velocity (T, 3), covariance (T, 3, 3): as filtered. own_velocity, own_covariance: of this
    frame's fragments alone, from ends (T,) points of which agreement (T,) agree; restless (T,): by these it
    does not stand still, whether they agree or not; unrest_s (T,): for how long it has not.
    surface_velocity, surface_covariance: from the surface's centre alone.
    arrived (T,) and cells (T,) of its surface; size_m (T,): its greatest extent; clean_s (T,): for how long
    its centre has been seen without a break; view_radps (T,): how fast the camera comes to see it from
    another side; growth_mps (T,): how fast its centre may wander because its visible part grows or shrinks.
    goes (T,): its centre really goes about as fast as the velocity says. guessed (T,): where it ends in what
    stands around it is a guess. up (3,): the floor's normal, None
    where it is not known. trusted: the camera's motion is known. reckoned: odometry says it, too, not the
    images alone. borne_out: how well the fragments bear it out, from 0 to 1.
    """

    sight: FloatArray
    distance_m: FloatArray
    depth_sigma_m: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    own_velocity: FloatArray
    own_covariance: FloatArray
    surface_velocity: FloatArray
    surface_covariance: FloatArray
    ends: NDArray[np.intp]
    agreement: FloatArray
    restless: NDArray[np.bool_]
    unrest_s: FloatArray
    arrived: NDArray[np.intp]
    cells: NDArray[np.intp]
    size_m: FloatArray
    clean_s: FloatArray
    view_radps: FloatArray
    growth_mps: FloatArray
    goes: NDArray[np.bool_]
    guessed: NDArray[np.bool_]
    up: FloatArray | None
    trusted: bool
    reckoned: bool
    borne_out: float


def evidence_of(
    tracks: Tracks,
    detection: Detection,
    body: BodyVelocities,
    goes: NDArray[np.bool_],
    arrived: NDArray[np.intp],
    cells: NDArray[np.intp],
    noise: DepthNoise,
) -> MotionEvidence:
    """What detection, and body, the velocities of the tracks by their fragments, say of the tracks, whose
    filters have taken these in. goes, arrived and cells (T,): see MotionEvidence."""
    rotation = detection.pose.rotation
    sight, distance_m = tracks.sight(detection.pose.translation_m)
    return MotionEvidence(
        sight=sight,
        distance_m=distance_m,
        depth_sigma_m=np.asarray(depth_sigma_m(distance_m, noise), np.float64),
        velocity=tracks.state[:, 3:],
        covariance=tracks.covariance[:, 3:, 3:],
        own_velocity=body.velocity_mps @ rotation.T,
        own_covariance=rotation @ body.covariance @ rotation.T,
        surface_velocity=tracks.surface_state[:, 3:],
        surface_covariance=tracks.surface_covariance[:, 3:, 3:],
        ends=np.where(believable(body), body.ends, 0),
        agreement=body.agreement,
        restless=restless(body),
        unrest_s=tracks.unrest_s,
        arrived=arrived,
        cells=cells,
        size_m=tracks.extent_m.max(axis=1),
        clean_s=tracks.clean_s,
        growth_mps=tracks.growth_mps,
        up=sightings.up(detection),
        view_radps=sightings.view_radps(detection, sight, distance_m),
        goes=goes,
        guessed=tracks.guessed,
        trusted=detection.motion_known,
        reckoned=detection.reckoned,
        borne_out=borne_out(detection),
    )


def borne_out(detection: Detection) -> float:
    """How far this frame's proof can be believed, as far as the camera's own motion goes.

    Where hardly more fragments agree on that than have to, and no odometry says it, too, it may be the motion
    of something else, and then all that stands moves, for as long as the mistake lasts.
    """
    if detection.reckoned:
        return 1.0
    spare = (detection.ego_motion.inlier_ratio - LEAST_AGREEMENT) / (_AGREED - LEAST_AGREEMENT)
    return min(spare, 1.0) if spare > _LEAST_BORNE_OUT else _LEAST_BORNE_OUT  # not where NaN
