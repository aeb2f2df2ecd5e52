"""Moving or static, with hysteresis: a verdict needs consistent evidence over time, of several kinds.

Fragments: the body's velocity over ground differs from zero by many sigmas, and most of its fragments
agree with it. Across the line of sight that is enough; along it, where a few sliding ends can feign a
change of length, the body's own depth must not contradict. Unrest: nearly all of many fragments deny that
the body stands still, though as limbs do they agree on no velocity. Arrivals: the body stands where free
space was seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.types import FloatArray
from vision.symmetric import inverse

_RISE_S = 0.06
# Without odometry an error of the camera's motion stays for some frames: one more of them is asked for.
_RISE_ALONE_S = 0.07
_FASTEST = 2.5  # times, with overwhelming proof
_MOST_A_FRAME = 0.5  # no single frame proves motion, however long ago the one before was
_FALL_S = 0.30
_HOLD_S = 2.0  # without new proof
_STOP_S = 0.12  # with proof of standing still
_MAX_EVIDENCE = 1.5
_ENDS_ACROSS = 4
_ENDS_ALONG = 8
_MIN_AGREEMENT = 0.18
_CONTRADICTION_SIGMAS = 2.5
_CONFIRMING_SIGMAS = 2.5
_OWN_PROOF = 3.0
_SHARED_PROOF = 0.55  # of the threshold, where fragments and surface say the same
_SPEED_PER_METRE = 0.02
_FLOOR_SIGMA_MPS = 0.03
_ARRIVED_CELLS = 8
_ARRIVED_SHARE = 0.05
_MUCH_CELLS = 20
_MUCH_SHARE = 0.2
_IMPLAUSIBLE = 1.6  # times the greatest speed: faster things are mistakes
_CLEAN_ACROSS_S = 0.25  # static surfaces seldom feign a speed for longer, and along the line of sight,
_CLEAN_ALONG_S = 0.5  # where the noise of depth is shared by neighbours, somewhat longer
_CLEAN_LOOKS = 2.5  # three of them, where frames are few
_COMPACT_M = 2.2
_WANDER = 0.5  # of its size: from front to side the middle of the visible surface goes half a width
_SURE_SQUARED_SIGMAS = 30.0
_IDENTITY = np.eye(3)
_FLOOR = _IDENTITY * _FLOOR_SIGMA_MPS**2
_LARGEST_M = 3.0  # wider parts are walls and racks; what moves in front of them is carved out


@dataclass(frozen=True, slots=True, eq=False)
class MotionEvidence:
    """Of T tracks, along the axes of the fixed frame.

    sight (T, 3): unit vector from the camera; distance_m (T,). velocity (T, 3), covariance (T, 3, 3): as
    filtered. own_velocity, own_covariance: of this frame's fragments alone, from ends (T,) points of
    which agreement (T,) agree; restless (T,): by these it does not stand still, whether they agree or not.
    surface_velocity, surface_covariance: from the surface's centre alone.
    arrived (T,) and cells (T,) of its surface; size_m (T,): its greatest extent; clean_s (T,): for how long
    its centre has been seen without a break; view_radps (T,): how fast the camera comes to see it from
    another side; growth_mps (T,): how fast its centre may wander because its visible part grows or shrinks.
    trusted: the camera's motion is known. reckoned: odometry says it, too, not the images alone.
    """

    sight: FloatArray
    distance_m: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    own_velocity: FloatArray
    own_covariance: FloatArray
    surface_velocity: FloatArray
    surface_covariance: FloatArray
    ends: NDArray[np.intp]
    agreement: FloatArray
    restless: NDArray[np.bool_]
    arrived: NDArray[np.intp]
    cells: NDArray[np.intp]
    size_m: FloatArray
    clean_s: FloatArray
    view_radps: FloatArray
    growth_mps: FloatArray
    trusted: bool
    reckoned: bool


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """evidence (T,), moving (T,) and confidence (T,) 0..1 after this frame."""

    evidence: FloatArray
    moving: NDArray[np.bool_]
    confidence: FloatArray


def judge(
    seen: MotionEvidence,
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    dt_s: float,
    settings: MotionSettings,
) -> Verdict:
    """Raise or lower the evidence of each track, and decide."""
    threshold = settings.sigmas**2
    speed = np.sqrt(np.square(seen.velocity).sum(axis=1))
    least = settings.min_speed_mps + _SPEED_PER_METRE * seen.distance_m
    significance = squared_sigmas(seen.velocity, seen.covariance)
    filtered, own, surface, apart = _split_all(seen)
    along, across, own_along, own_across = filtered.along, filtered.across, own.along, own.across
    agreeing = np.where(seen.agreement >= _MIN_AGREEMENT, seen.agreement * seen.ends, 0.0)
    second = _second_opinion(seen, filtered, surface, apart)
    enough = (agreeing >= _ENDS_ACROSS) | seen.restless
    shown_across = (across > threshold) & (own_across > 0.5 * threshold)
    by_fragments_across = shown_across & enough
    by_fragments_across &= ~second.denies_across | (agreeing >= _ENDS_ALONG)
    many = (own_along > 0.5 * threshold) & (agreeing >= _ENDS_ALONG) & ~second.denies_along
    few = (agreeing >= 2) | seen.restless
    shared = _SHARED_PROOF * threshold
    by_fragments_along = ((along > threshold) & many) | (
        (along > shared) & second.confirms_along & few & (own_along > _OWN_PROOF)
    )
    by_fragments_across |= (across > shared) & second.confirms_across & few & (own_across > _OWN_PROOF)
    by_surface = _by_surface(seen, surface.along, surface.across, threshold, least, dt_s)
    has_arrived = (seen.arrived >= _ARRIVED_CELLS) & (seen.arrived >= _ARRIVED_SHARE * seen.cells)
    by_arrival = has_arrived & (significance > 0.5 * threshold)
    much = (seen.arrived >= _MUCH_CELLS) & (seen.arrived >= _MUCH_SHARE * seen.cells)
    possible = (speed <= _IMPLAUSIBLE * settings.max_speed_mps) & (seen.size_m <= _LARGEST_M)
    by_unrest = seen.restless & (seen.ends >= _ENDS_ALONG) & (significance > 0.5 * threshold)
    evident = by_unrest | by_fragments_across | by_fragments_along | by_arrival | by_surface
    rising = possible & ((evident & (speed > least)) | much) & seen.trusted
    holding = moving & (speed > 0.6 * least) & ((significance > 4.0) | has_arrived)
    own_speed = np.sqrt(np.square(seen.own_velocity).sum(axis=1))
    own_sigma = np.sqrt(np.trace(seen.own_covariance, axis1=1, axis2=2))
    stands = (own_speed < 0.6 * least) & (own_sigma < 0.5 * least) & (agreeing >= _ENDS_ACROSS)
    # What one fragment alone shows is no proof, but no reason either to forget what more of them showed. Nor
    # is it one that limbs do not agree, where hardly any of them stands still.
    waiting = possible & (speed > least) & shown_across & (seen.agreement * seen.ends >= 2)
    waiting |= seen.restless & ~moving
    slowly = np.where(holding | waiting, dt_s / _HOLD_S, dt_s / _FALL_S)
    falling = np.where(stands, dt_s / _STOP_S, slowly)
    strength = np.minimum(np.maximum(along, across), np.maximum(own_along, own_across)) / threshold
    pace = np.minimum(np.maximum(np.minimum(strength, agreeing / _ENDS_ACROSS), 1.0), _FASTEST)
    rise_s = _RISE_S if seen.reckoned else _RISE_ALONE_S
    rise = np.minimum(pace * dt_s / rise_s, _MOST_A_FRAME)
    change = np.where(rising & ~stands, rise, -falling)
    new_evidence = np.minimum(np.maximum(evidence + change, 0.0), _MAX_EVIDENCE)
    new_moving = np.where(moving, new_evidence > 0.0, new_evidence >= 1.0)
    confidence = 1.0 - np.exp(-significance / _SURE_SQUARED_SIGMAS)
    return Verdict(new_evidence, new_moving, confidence)


def _by_surface(
    seen: MotionEvidence,
    along: FloatArray,
    across: FloatArray,
    threshold: float,
    least_mps: FloatArray,
    dt_s: float,
) -> NDArray[np.bool_]:
    """(T,) whether the centre of a whole, compact surface moves too long and too clearly for an accident.

    along, across (T,): its squared sigmas. A new viewpoint shows other sides of a thing that stands still,
    so its centre wanders with the view, and it wanders while more and more of it comes to be seen: that much
    speed proves nothing.
    """
    speed = np.sqrt(np.square(seen.surface_velocity).sum(axis=1))
    looks_s = _CLEAN_LOOKS * dt_s
    clear = ((across > threshold) & (seen.clean_s >= max(_CLEAN_ACROSS_S, looks_s))) | (
        (along > threshold) & (seen.clean_s >= max(_CLEAN_ALONG_S, looks_s))
    )
    wander = _WANDER * seen.view_radps * seen.size_m + seen.growth_mps
    result: NDArray[np.bool_] = clear & (seen.size_m <= _COMPACT_M) & (speed > least_mps + wander)
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _SecondOpinion:
    """What the surface's centre says of the fragments' speed, along the line of sight and across: (T,)."""

    denies_along: NDArray[np.bool_]
    denies_across: NDArray[np.bool_]
    confirms_along: NDArray[np.bool_]
    confirms_across: NDArray[np.bool_]


def _second_opinion(seen: MotionEvidence, fragments: Split, surface: Split, apart: Split) -> _SecondOpinion:
    """fragments, surface: of the two velocities; apart: of the one less the other."""
    limit = _CONTRADICTION_SIGMAS**2
    denies_along = np.square(apart.value) > limit * apart.variance
    same_way = surface.value * fragments.value > 0
    least = _CONFIRMING_SIGMAS**2
    same_side = (fragments.rest * surface.rest).sum(axis=1) > 0
    return _SecondOpinion(
        denies_along,
        apart.across > limit,
        (surface.along > least) & same_way & ~denies_along,
        (surface.across > least) & same_side,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """A velocity along the line of sight and across. value, variance (..., T): the component along it; rest
    (..., T, 3): what is left. along, across (..., T): squared distance from zero in sigmas, of either."""

    value: FloatArray
    variance: FloatArray
    rest: FloatArray
    along: FloatArray
    across: FloatArray

    def __getitem__(self, k: int) -> Split:
        """Of the first axis, entry k."""
        return Split(self.value[k], self.variance[k], self.rest[k], self.along[k], self.across[k])


def _split_all(seen: MotionEvidence) -> tuple[Split, Split, Split, Split]:
    """The velocity as filtered, of this frame's fragments, of the surface, and the first less the last: in
    one call, which costs more than what it computes."""
    count = len(seen.sight)
    velocity, covariance = np.empty((4, count, 3)), np.empty((4, count, 3, 3))
    velocity[0], covariance[0] = seen.velocity, seen.covariance
    velocity[1], covariance[1] = seen.own_velocity, seen.own_covariance
    velocity[2], covariance[2] = seen.surface_velocity, seen.surface_covariance
    velocity[3] = seen.velocity - seen.surface_velocity
    covariance[3] = seen.covariance + seen.surface_covariance
    every = split(velocity, covariance, seen.sight)
    return every[0], every[1], every[2], every[3]


def split(velocity: FloatArray, covariance: FloatArray, sight: FloatArray) -> Split:
    """Of velocity (..., T, 3) with covariance (..., T, 3, 3), seen along sight (T, 3)."""
    upright, level = sight[:, :, None], sight[:, None, :]
    value = (velocity * sight).sum(axis=-1)
    variance = (level @ covariance @ upright)[..., 0, 0]
    along = value * value / (variance + _FLOOR_SIGMA_MPS**2)
    onto_sight = upright * level
    onto = _IDENTITY - onto_sight
    rest = velocity - value[..., None] * sight
    doubt = onto @ covariance @ onto + (onto_sight + _FLOOR)
    across = _squared_length(rest, doubt)
    return Split(value, variance, rest, along, across)


def squared_sigmas(velocity: FloatArray, covariance: FloatArray) -> FloatArray:
    """(T,) squared distance of velocity (T, 3) from zero in its own standard deviations."""
    return _squared_length(velocity, covariance + _FLOOR)


def _squared_length(vector: FloatArray, covariance: FloatArray) -> FloatArray:
    """(...,) of vector (..., 3) in sigmas of covariance (..., 3, 3)."""
    result: FloatArray = (vector[..., None, :] @ inverse(covariance) @ vector[..., :, None])[..., 0, 0]
    return result
