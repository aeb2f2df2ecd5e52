"""Moving or static, for each track: a verdict with hysteresis, from several kinds of proof.

Kinds of proof in one frame (threshold: settings.sigmas squared; ends: end points of the track's fragments):

* Fragments (_by_fragments): the velocity over ground, as filtered and by this frame's fragments alone,
  differs clearly from zero. If it is level and across the line of sight, 4 agreeing ends suffice. Along the
  line of sight 8 are needed: a few sliding ends look like a change of length. The surface must not contradict
  (across, 8 ends outvote it); where the surface confirms the velocity, less will do.
* Unrest (_by_unrest): of 8 ends or more, at least 70 % contradict standing still, though, as limbs do, they
  may agree on no velocity. The filtered velocity needs half of the threshold only, after 0.4 s a quarter.
* Arrival (_by_arrival): part of the surface stands where free space was seen. Half of the threshold suffices.
  Where much of the surface has arrived, that alone is proof, except for a mover that has just stopped.
* Surface (_by_surface): the centre of a whole, compact surface moves for longer and more clearly than a new
  viewpoint or a growing surface explains.

All kinds need a known motion of the camera and, except for much arrival, more than the least speed. Bodies
too fast or too wide to be true prove nothing.

Hysteresis: evidence is a track's score from 0 to 1.5. A frame with proof raises it by dt / 0.06 s (0.07 s
without odometry) or more, by 0.5 at most, and by less where the camera's own motion is in doubt. Without
proof it falls by dt / 0.30 s, by dt / 2 s while the motion seems to go on, and by dt / 0.12 s where
fragments, or of a mover the filter, prove that it stands still, or where nothing tells a mover from what
stands around it. A track becomes moving at 1.0 and static again at 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.types import FloatArray
from vision.motion.line_of_sight import Split, second_opinion, split
from vision.motion.motion_evidence import MotionEvidence

# Two frames at 30 a second: with three of them the first detection came 0.07 s later.
_RISE_S = 0.06
# Without odometry an error of the camera's motion stays for some frames: one more of them is asked for.
_RISE_ALONE_S = 0.07
_FASTEST = 2.5  # times, with overwhelming proof
_MOST_A_FRAME = 0.5  # no single frame proves motion, however long ago the one before was
_FALL_S = 0.30  # without proof: in some frames there is none of what moves
_HOLD_S = 2.0  # without new proof
_HOLDING_SQUARED_SIGMAS = 4.0  # two sigmas: it still seems to go
_STOP_S = 0.12  # with proof of standing still
_MAX_EVIDENCE = 1.5  # half as much again as a verdict takes: no mover is held for much longer
_ENDS_ACROSS = 4  # two fragments: across, where an end is seen tells by itself
_ENDS_ALONG = 8  # four fragments: along, only how far ends are apart tells, and that slides
_LEVEL_SHARE = 0.5  # of the threshold: with less than that, what goes up or down needs as many ends as along
_MIN_AGREEMENT = 0.18  # of the ends: bodies whose limbs disagree still speak
_UNREST_SHARE = 0.5  # of the threshold
_LASTING_UNREST_S = 0.4  # longer than a limb swings one way
_LIKELY_SHARE = 0.25  # of the threshold: two of four sigmas; a slow machine on legs stays at two and a half
_OWN_PROOF = 3.0  # squared sigmas of this frame alone: the filter does not speak of the past only
_SHARED_PROOF = 0.55  # of the threshold, where fragments and surface say the same
_SPEED_PER_METRE = 0.02  # of distance: by so much more the least speed is, as all errors grow with it
_ARRIVED_CELLS = 8  # fewer come and go with noise at a rim
_ARRIVED_SHARE = 0.05  # of the surface: who walks arrives with one side of himself
_MUCH_CELLS = 20  # about a forearm 4 m away
_MUCH_SHARE = 0.2  # of the surface: more than a rim that noise widens
_STANDING_SHARE = 0.6  # of the least speed: what is slower stands
_KNOWN_SPEED = 2.0  # of the least speed: with less doubt than this, a slow mover has stopped
IMPLAUSIBLE = 1.6  # times the greatest speed: faster things are mistakes
_CLEAN_ACROSS_S = 0.25  # static surfaces seldom feign a speed for longer, and along the line of sight,
_CLEAN_ALONG_S = 0.5  # where the noise of depth is shared by neighbours, somewhat longer
_CLEAR_WAY = 4.0  # times the noise of one pixel's depth: no noise that neighbours share feigns so long a way
_CLEAN_LOOKS = 2.5  # three of them, where frames are few
_EVEN_CELLS = 48  # fewer lie on two or three patches of depth noise, and go to and fro with these
_COMPACT_M = 2.2  # a tall person; larger things are seen in part only, and their middle wanders
_WANDER = 0.5  # of its size: from front to side the middle of the visible surface goes half a width
_SURE_SQUARED_SIGMAS = 30.0  # five and a half sigmas: a confidence of 0.63, and 0.4 at the least proof
_LARGEST_M = 3.0  # wider parts are walls and racks; what moves in front of them is carved out


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """evidence, moving, confidence 0..1, whether its fragments are sure that it stands, and whether this
    frame proved that it moves: (T,) each."""

    evidence: FloatArray
    moving: NDArray[np.bool_]
    confidence: FloatArray
    stands: NDArray[np.bool_]
    proven: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Reading:
    """What the rules ask of T tracks. threshold: squared sigmas. speed_mps (T,) as filtered; least_mps (T,):
    what is slower counts as static; agreeing (T,): ends that agree, 0 where they are too small a share;
    shown_across (T,): filter and fragments say that it goes across the line of sight, however few these are;
    arrived (T,): some of the surface is where free space was seen. The velocity as filtered, of this frame's
    fragments and of the surface; apart: the first less the last."""

    threshold: float
    speed_mps: FloatArray
    least_mps: FloatArray
    agreeing: FloatArray
    shown_across: NDArray[np.bool_]
    arrived: NDArray[np.bool_]
    filtered: Split
    own: Split
    surface: Split
    apart: Split


def judge(
    seen: MotionEvidence,
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    dt_s: float,
    settings: MotionSettings,
) -> Verdict:
    """Raise or lower the evidence of each track, and decide."""
    read = _read(seen, settings)
    possible = (read.speed_mps <= IMPLAUSIBLE * settings.max_speed_mps) & (seen.size_m <= _LARGEST_M)
    evident = (
        _by_fragments(seen, read) | _by_unrest(seen, read) | _by_arrival(read) | _by_surface(seen, read, dt_s)
    )
    much = (seen.arrived >= _MUCH_CELLS) & (seen.arrived >= _MUCH_SHARE * seen.cells)
    fast = read.speed_mps > read.least_mps
    # Where a mover has stopped was free space until a moment ago: no proof that it still goes.
    sigma_mps = np.sqrt(seen.covariance.trace(axis1=1, axis2=2))
    stopped = moving & ~fast & (sigma_mps < _KNOWN_SPEED * read.least_mps)
    rising = possible & ((evident & fast) | (much & ~stopped)) & seen.trusted
    stands = _stands(seen, read)
    slow = read.speed_mps < _STANDING_SHARE * read.least_mps
    over = stands | (stopped & slow) | (moving & _lost(seen, read))
    kept = _holds(seen, read, moving) | (possible & _waits(seen, read)) | (seen.restless & ~moving)
    falling = np.where(over, dt_s / _STOP_S, np.where(kept, dt_s / _HOLD_S, dt_s / _FALL_S))
    change = np.where(rising & ~stands, _rise(seen, read, dt_s), -falling)
    new_evidence = np.minimum(np.maximum(evidence + change, 0.0), _MAX_EVIDENCE)
    new_moving = np.where(moving, new_evidence > 0.0, new_evidence >= 1.0)
    confidence = 1.0 - np.exp(-read.filtered.total / _SURE_SQUARED_SIGMAS)
    return Verdict(
        evidence=new_evidence, moving=new_moving, confidence=confidence, stands=stands, proven=rising
    )


def _read(seen: MotionEvidence, settings: MotionSettings) -> _Reading:
    threshold = settings.sigmas**2
    filtered, own, surface, apart = _split_all(seen)
    return _Reading(
        threshold=threshold,
        speed_mps=np.sqrt(np.square(seen.velocity).sum(axis=1)),
        least_mps=settings.min_speed_mps + _SPEED_PER_METRE * seen.distance_m,
        agreeing=np.where(seen.agreement >= _MIN_AGREEMENT, seen.agreement * seen.ends, 0.0),
        shown_across=(filtered.across > threshold) & (own.across > 0.5 * threshold),
        arrived=(seen.arrived >= _ARRIVED_CELLS) & (seen.arrived >= _ARRIVED_SHARE * seen.cells),
        filtered=filtered,
        own=own,
        surface=surface,
        apart=apart,
    )


def _by_fragments(seen: MotionEvidence, read: _Reading) -> NDArray[np.bool_]:
    """(T,) whether filter and fragments show a velocity that the surface does not deny, or that it shares."""
    second = second_opinion(read.filtered, read.surface, read.apart)
    many = read.agreeing >= _ENDS_ALONG
    across = read.shown_across & ((read.agreeing >= _ENDS_ACROSS) | seen.restless)
    across &= ~second.denies_across | many
    across &= (read.filtered.level > _LEVEL_SHARE * read.threshold) | many | seen.restless
    along = (read.filtered.along > read.threshold) & (read.own.along > 0.5 * read.threshold)
    along &= many & ~second.denies_along
    few = (read.agreeing >= 2) | seen.restless
    less = _SHARED_PROOF * read.threshold
    shared = (read.filtered.along > less) & second.confirms_along & (read.own.along > _OWN_PROOF)
    shared |= (read.filtered.across > less) & second.confirms_across & (read.own.across > _OWN_PROOF)
    result: NDArray[np.bool_] = across | along | (shared & few)
    return result


def _by_unrest(seen: MotionEvidence, read: _Reading) -> NDArray[np.bool_]:
    """(T,) whether many ends, by whatever each of them does, bear out the filter's velocity.

    That of a slow body with swinging limbs never becomes clear. Where its ends have denied for longer than
    any limb swings one way, it need only be likely.
    """
    share = np.where(seen.unrest_s >= _LASTING_UNREST_S, _LIKELY_SHARE, _UNREST_SHARE)
    result: NDArray[np.bool_] = (
        seen.restless & (seen.ends >= _ENDS_ALONG) & (read.filtered.total > share * read.threshold)
    )
    return result


def _by_arrival(read: _Reading) -> NDArray[np.bool_]:
    """(T,) whether what has arrived bears out the filter's velocity."""
    result: NDArray[np.bool_] = read.arrived & (read.filtered.total > 0.5 * read.threshold)
    return result


def _holds(seen: MotionEvidence, read: _Reading, moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T,) movers that still go, though nothing new proves it."""
    result: NDArray[np.bool_] = (
        moving
        & (read.speed_mps > _STANDING_SHARE * read.least_mps)
        & ((seen.goes & (read.filtered.total > _HOLDING_SQUARED_SIGMAS)) | read.arrived)
    )
    return result


def _waits(seen: MotionEvidence, read: _Reading) -> NDArray[np.bool_]:
    """(T,) what one fragment alone shows is no proof, but no reason either to forget what more of them
    showed."""
    result: NDArray[np.bool_] = (
        (read.speed_mps > read.least_mps) & read.shown_across & (seen.agreement * seen.ends >= 2)
    )
    return result


def _lost(seen: MotionEvidence, read: _Reading) -> NDArray[np.bool_]:
    """(T,) what nothing tells apart from what stands around it, and no fragment tells of: its cells would go
    on over a wall for as long as its velocity has them go."""
    result: NDArray[np.bool_] = seen.guessed & (seen.ends == 0) & ~read.arrived
    return result


def _stands(seen: MotionEvidence, read: _Reading) -> NDArray[np.bool_]:
    """(T,) whether this frame's fragments are sure that it stands."""
    speed = np.sqrt(np.square(seen.own_velocity).sum(axis=1))
    sigma = np.sqrt(seen.own_covariance.trace(axis1=1, axis2=2))
    result: NDArray[np.bool_] = (
        (speed < _STANDING_SHARE * read.least_mps)
        & (sigma < 0.5 * read.least_mps)
        & (read.agreeing >= _ENDS_ACROSS)
    )
    return result


def _rise(seen: MotionEvidence, read: _Reading, dt_s: float) -> FloatArray:
    """(T,) by how much one more frame of proof raises the evidence: the faster, the stronger it is."""
    by_filter = np.maximum(read.filtered.along, read.filtered.across)
    strength = np.minimum(by_filter, np.maximum(read.own.along, read.own.across)) / read.threshold
    pace = np.minimum(np.maximum(np.minimum(strength, read.agreeing / _ENDS_ACROSS), 1.0), _FASTEST)
    rise = np.minimum(pace * dt_s / (_RISE_S if seen.reckoned else _RISE_ALONE_S), _MOST_A_FRAME)
    result: FloatArray = seen.borne_out * rise
    return result


def _by_surface(seen: MotionEvidence, read: _Reading, dt_s: float) -> NDArray[np.bool_]:
    """(T,) whether the centre of a whole, compact surface moves too long and too clearly for an accident.

    A new viewpoint shows other sides of a thing that stands still, so its centre wanders with the view, and
    it wanders while more and more of it comes to be seen: that much speed proves nothing. Nor does a few
    cells' way along the line of sight: a wall seen through a chair has not many more. Along it a longer time
    is asked for, unless the way is far beyond what depth is off by.
    """
    speed = np.sqrt(np.square(seen.surface_velocity).sum(axis=1))
    looks_s = _CLEAN_LOOKS * dt_s
    clear = (read.surface.across > read.threshold) & (seen.clean_s >= max(_CLEAN_ACROSS_S, looks_s))
    even = seen.cells >= _EVEN_CELLS
    far = np.abs(read.surface.value) * seen.clean_s >= _CLEAR_WAY * seen.depth_sigma_m
    long_s = np.maximum(np.where(far, _CLEAN_ACROSS_S, _CLEAN_ALONG_S), looks_s)
    clear |= even & (read.surface.along > read.threshold) & (seen.clean_s >= long_s)
    wander = _WANDER * seen.view_radps * seen.size_m + seen.growth_mps
    result: NDArray[np.bool_] = clear & (seen.size_m <= _COMPACT_M) & (speed > read.least_mps + wander)
    return result


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
    every = split(velocity, covariance, seen.sight, seen.up)
    return every[0], every[1], every[2], every[3]
