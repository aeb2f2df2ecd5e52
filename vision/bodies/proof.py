"""What one frame proves of each track: that it moves, that it stands still, or neither. There is one rule for
each kind of proof; vision/bodies/judgement.py lists them and adds them up over frames."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.compiled import compiled, inlined
from hal.types import FloatArray
from vision.bodies.arrivals import ARRIVED_CELLS, ARRIVED_SHARE, MUCH_ARRIVED_CELLS, MUCH_ARRIVED_SHARE
from vision.motion.line_of_sight import decompose, second_opinion
from vision.motion.motion_evidence import MotionEvidence

BoolArray = NDArray[np.bool_]

_HOLDING_SQUARED_SIGMAS = 4.0  # two sigmas: with more, a mover still seems to move
_ENDS_ACROSS = 4  # two fragments: across the line of sight the position of each end is a measurement
_ENDS_ALONG = 8  # four fragments: along it only the distance between two ends is, and ends slide
_LEVEL_SHARE = 0.5  # of the threshold: with less level motion across, as many ends are needed as along
_MIN_AGREEMENT = 0.18  # share of agreeing ends: low, since the limbs of a body disagree
_UNREST_SHARE = 0.5  # of the threshold, for the filtered velocity of a restless body
_LASTING_UNREST_S = 0.4  # longer than a limb swings one way
_LIKELY_SHARE = 0.25  # of the threshold, 2 of 4 sigmas: a slow machine on legs reaches 2.5 at most
_FRAME_PROOF = 3.0  # squared sigmas of this frame, so that the proof does not rest on the past only
_SHARED_PROOF = 0.55  # of the threshold, where the surface confirms the velocity of the fragments
_SPEED_PER_METRE = 0.02  # m/s more minimum speed per metre of distance, since all errors grow with it
_LASTING_ARRIVAL_S = 0.12  # of no static surface do enough cells arrive in two successive frames
_STANDING_SHARE = 0.6  # of the minimum speed: a slower track stands still
_KNOWN_SPEED = 2.0  # times the minimum speed: if sigma is less, a mover below the minimum has stopped
_MEASURED_ACROSS_S = 0.25  # static surfaces seldom show a false speed across the line of sight for longer
_MEASURED_ALONG_S = 0.5  # somewhat longer along it, where neighbours share the noise of depth
_CLEAR_WAY = 4.0  # times the depth noise of one pixel: shared noise never shows so large a displacement
_MEASURED_FRAMES = 2.5  # frame intervals: at least three frames at a low frame rate
_EVEN_CELLS = 48  # fewer cells lie on 2 or 3 patches of depth noise, and move back and forth with them
_COMPACT_M = 2.2  # a tall person; larger things are seen in part only, and their centre wanders
_WANDER = 0.5  # of its size: as the view turns from front to side, the centre moves by half a width
_LARGEST_M = 3.0  # wider parts are walls and racks; movers in front of them are carved out
# Velocities: filtered; of this frame's fragments; of the surface; the difference of first and third.
_FILTERED, _FRAME, _SURFACE, _APART = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """Of T tracks, (T,) each.

    moves, strength: motion is proven, and how many times the threshold is exceeded.
    surely_static: this frame's fragments are sure that it stands still.
    over: a motion has ended, by surely_static or by another sign.
    goes_on: nothing new proves motion, but nothing speaks against it.
    squared_sigmas: squared Mahalanobis distance of the filtered velocity from zero.
    """

    moves: BoolArray
    strength: FloatArray
    surely_static: BoolArray
    over: BoolArray
    goes_on: BoolArray
    squared_sigmas: FloatArray


class _Velocity(NamedTuple):
    """A velocity of one track and its components; see Split."""

    speed_mps: float
    sigma_mps: float
    value: float
    along: float
    across: float
    total: float
    level: float


class _Opinion(NamedTuple):
    """What the surface's velocity says of the fragments' velocity; see SecondOpinion."""

    denies_along: bool
    denies_across: bool
    confirms_along: bool
    confirms_across: bool


class _Ends(NamedTuple):
    """Ends of one track's fragments: all, and agreeing, which is 0 if they are too small a share."""

    all: int
    agreeing: float
    restless: bool
    restless_s: float


class _Surface(NamedTuple):
    """Visible surface of one track. wander_mps: how fast its centre may move while the body is static."""

    cells: int
    size_m: float
    velocity_measured_s: float
    wander_mps: float
    depth_sigma_m: float


@inlined
def _by_fragments(
    filtered: _Velocity, frame: _Velocity, second: _Opinion, ends: _Ends, threshold: float
) -> bool:
    """Whether filter and fragments show a velocity that the surface does not contradict, or confirms."""
    many, some = ends.agreeing >= _ENDS_ALONG, ends.agreeing >= _ENDS_ACROSS
    across = _shown_across(filtered, frame, threshold) and (some or ends.restless)
    across = across and (not second.denies_across or many)
    across = across and (filtered.level > _LEVEL_SHARE * threshold or many or ends.restless)
    along = filtered.along > threshold and frame.along > 0.5 * threshold
    along = along and many and not second.denies_along
    less = _SHARED_PROOF * threshold
    shared = filtered.along > less and second.confirms_along and frame.along > _FRAME_PROOF
    shared = shared or (filtered.across > less and second.confirms_across and frame.across > _FRAME_PROOF)
    return across or along or (shared and (ends.agreeing >= 2 or ends.restless))


@inlined
def _shown_across(filtered: _Velocity, frame: _Velocity, threshold: float) -> bool:
    """Whether filter and fragments show motion across the line of sight, by however few fragments."""
    return filtered.across > threshold and frame.across > 0.5 * threshold


@inlined
def _by_unrest(filtered: _Velocity, ends: _Ends, threshold: float) -> bool:
    """Whether many ends contradict standing still, even in different ways, and the filter shows a velocity.

    That of a slow body with swinging limbs never becomes clear: after _LASTING_UNREST_S a likely one will do.
    """
    share = _LIKELY_SHARE if ends.restless_s >= _LASTING_UNREST_S else _UNREST_SHARE
    return ends.restless and ends.all >= _ENDS_ALONG and filtered.total > share * threshold


@inlined
def _by_arrival(filtered: _Velocity, arrived: bool, threshold: float) -> bool:
    """Whether arrived cells support the filtered velocity."""
    return arrived and filtered.total > 0.5 * threshold


@inlined
def _by_surface(centre: _Velocity, seen: _Surface, least_mps: float, dt_s: float, threshold: float) -> bool:
    """Whether the centre of a whole, compact surface moves for too long and too clearly to be chance.

    Up to wander_mps proves nothing: the centre of a static thing moves as the viewpoint changes, and as more
    of it becomes visible. Nor does motion of a few cells along the line of sight: a wall seen through a chair
    has few. Along it a longer time is needed, unless the displacement is far beyond the error of depth.
    """
    frames_s = _MEASURED_FRAMES * dt_s
    far = abs(centre.value) * seen.velocity_measured_s >= _CLEAR_WAY * seen.depth_sigma_m
    long_s = max(_MEASURED_ACROSS_S if far else _MEASURED_ALONG_S, frames_s)
    clear = centre.across > threshold and seen.velocity_measured_s >= max(_MEASURED_ACROSS_S, frames_s)
    even = seen.cells >= _EVEN_CELLS
    clear = clear or (even and centre.along > threshold and seen.velocity_measured_s >= long_s)
    return clear and seen.size_m <= _COMPACT_M and centre.speed_mps > least_mps + seen.wander_mps


@inlined
def _still_moves(filtered: _Velocity, advances: bool, arrived: bool, least_mps: float) -> bool:
    """Whether a mover still seems to move, though nothing new proves it."""
    going = (advances and filtered.total > _HOLDING_SQUARED_SIGMAS) or arrived
    return going and filtered.speed_mps > _STANDING_SHARE * least_mps


@inlined
def _surely_static(frame: _Velocity, agreeing: float, least_mps: float) -> bool:
    """Whether this frame's fragments are sure that the track stands still."""
    slow = frame.speed_mps < _STANDING_SHARE * least_mps
    return slow and frame.sigma_mps < 0.5 * least_mps and agreeing >= _ENDS_ACROSS


@inlined
def _entry(velocity: FloatArray, covariance: FloatArray, parts: FloatArray, k: int, t: int) -> _Velocity:
    """Velocity k of track t with its components; for the arguments see _proofs."""
    v, c, of = velocity[k, t], covariance[k, t], parts[:, k, t]
    speed_mps = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    sigma_mps = math.sqrt(c[0, 0] + c[1, 1] + c[2, 2])
    return _Velocity(speed_mps, sigma_mps, of[0], of[1], of[2], of[3], of[4])


@compiled(
    "float64[:, :, ::1], float64[:, :, :, ::1], float64[:, :, ::1], boolean[:, ::1], float64[:], int64[:],"
    "float64[:], boolean[:], float64[:], int64[:], float64[:], int64[:], float64[:], float64[:], float64[:],"
    "float64[:], boolean[:], boolean[:], boolean[:], boolean, float64, float64, float64"
)
def _proofs(
    velocity: FloatArray,
    covariance: FloatArray,
    parts: FloatArray,
    opinion: BoolArray,
    least_mps: FloatArray,
    ends: NDArray[np.intp],
    agreement: FloatArray,
    restless: BoolArray,
    restless_s: FloatArray,
    arrived: NDArray[np.intp],
    arriving_s: FloatArray,
    cells: NDArray[np.intp],
    size_m: FloatArray,
    velocity_measured_s: FloatArray,
    wander_mps: FloatArray,
    depth_sigma_m: FloatArray,
    advances: BoolArray,
    border_is_guess: BoolArray,
    moving: BoolArray,
    trusted: bool,
    fastest_mps: float,
    dt_s: float,
    threshold: float,
) -> tuple[BoolArray, FloatArray, BoolArray, BoolArray, BoolArray]:
    """moves to goes_on of Proof. velocity (4, T, 3), covariance (4, T, 3, 3), and parts (5, 4, T), value to
    level of Split: of the four velocities. opinion (4, T): SecondOpinion. threshold: squared sigmas."""
    count = len(moving)
    moves, surely_static = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    over, goes_on, strength = np.zeros(count, np.bool_), np.zeros(count, np.bool_), np.zeros(count)
    for t in range(count):
        filtered = _entry(velocity, covariance, parts, _FILTERED, t)
        frame = _entry(velocity, covariance, parts, _FRAME, t)
        centre = _entry(velocity, covariance, parts, _SURFACE, t)
        second = _Opinion(opinion[0, t], opinion[1, t], opinion[2, t], opinion[3, t])
        alike = agreement[t] * ends[t]
        agreeing = alike if agreement[t] >= _MIN_AGREEMENT else 0.0
        track_ends = _Ends(ends[t], agreeing, restless[t], restless_s[t])
        seen = _Surface(cells[t], size_m[t], velocity_measured_s[t], wander_mps[t], depth_sigma_m[t])
        some = arrived[t] >= ARRIVED_CELLS and arrived[t] >= ARRIVED_SHARE * cells[t]
        lasting = some and arriving_s[t] >= max(_LASTING_ARRIVAL_S, _MEASURED_FRAMES * dt_s)
        much = arrived[t] >= MUCH_ARRIVED_CELLS and arrived[t] >= MUCH_ARRIVED_SHARE * cells[t]
        possible = filtered.speed_mps <= fastest_mps and size_m[t] <= _LARGEST_M
        fast = filtered.speed_mps > least_mps[t]
        evident = (
            _by_fragments(filtered, frame, second, track_ends, threshold)
            or _by_unrest(filtered, track_ends, threshold)
            or _by_arrival(filtered, some, threshold)
            or _by_surface(centre, seen, least_mps[t], dt_s, threshold)
        )
        # The place where a mover has stopped was free a moment ago, so its arrival there is no proof.
        stands = not fast and filtered.sigma_mps < _KNOWN_SPEED * least_mps[t]
        stopped = moving[t] and stands
        came = (much and not stopped) or (lasting and not stands)
        moves[t] = trusted and possible and ((evident and fast) or came)
        shown = np.minimum(np.maximum(filtered.along, filtered.across), np.maximum(frame.along, frame.across))
        strength[t] = np.minimum(shown / threshold, agreeing / _ENDS_ACROSS)
        surely_static[t] = _surely_static(frame, agreeing, least_mps[t])
        # Neither depth nor a fragment tells it from the static surface beside it, along which it would drift.
        lost = moving[t] and border_is_guess[t] and ends[t] == 0 and not some
        slow = filtered.speed_mps < _STANDING_SHARE * least_mps[t]
        over[t] = surely_static[t] or (stopped and slow) or lost
        still_moves = moving[t] and _still_moves(filtered, advances[t], some, least_mps[t])
        # One fragment alone is no proof, but a reason to keep what more of them showed.
        one_moves = possible and fast and alike >= 2 and _shown_across(filtered, frame, threshold)
        goes_on[t] = still_moves or one_moves or (restless[t] and not moving[t])
    return moves, strength, surely_static, over, goes_on


def prove(
    seen: MotionEvidence, moving: BoolArray, fastest_mps: float, dt_s: float, settings: MotionSettings
) -> Proof:
    """The proofs of this frame. moving (T,): last verdict. fastest_mps: no body is faster."""
    velocity, covariance = np.empty((4, len(moving), 3)), np.empty((4, len(moving), 3, 3))
    velocity[_FILTERED], covariance[_FILTERED] = seen.velocity, seen.covariance
    velocity[_FRAME], covariance[_FRAME] = seen.own_velocity, seen.own_covariance
    velocity[_SURFACE], covariance[_SURFACE] = seen.surface_velocity, seen.surface_covariance
    velocity[_APART] = seen.velocity - seen.surface_velocity
    covariance[_APART] = seen.covariance + seen.surface_covariance
    parts = decompose(velocity, covariance, seen.sight, seen.up)
    second = second_opinion(parts[_FILTERED], parts[_SURFACE], parts[_APART])
    least_mps = settings.min_speed_mps + _SPEED_PER_METRE * seen.distance_m
    proofs = _proofs(
        velocity,
        covariance,
        np.array((parts.value, parts.along, parts.across, parts.total, parts.level)),
        np.array((second.denies_along, second.denies_across, second.confirms_along, second.confirms_across)),
        least_mps,
        seen.ends,
        seen.agreement,
        seen.restless,
        seen.restless_s,
        seen.arrived,
        seen.arriving_s,
        seen.cells,
        seen.size_m,
        seen.velocity_measured_s,
        _WANDER * seen.view_radps * seen.size_m + seen.growth_mps,
        seen.depth_sigma_m,
        seen.advances,
        seen.border_is_guess,
        moving,
        seen.trusted,
        fastest_mps,
        dt_s,
        settings.sigmas**2,
    )
    return Proof(*proofs, parts.total[_FILTERED])
