"""What one frame proves of each track: that it moves, that it stands still, or neither.

The rules are in vision/bodies/proof_rules.py; vision/bodies/judgement.py adds their proofs up over frames.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import Flags, FloatArray, Vector
from vision.bodies.motion_evidence import MotionEvidence
from vision.bodies.proof_rules import (
    ENDS_ACROSS,
    EVEN_CELLS,
    LARGEST_M,
    STANDING_SHARE,
    Approach,
    Demand,
    Ends,
    Opinion,
    Rim,
    Shown,
    Surface,
    Velocity,
    arrival_of,
    is_evident,
    seems_to_move,
    shown_across,
    stands_surely,
)
from vision.motion.line_of_sight import SecondOpinion, Split, decompose, second_opinion

BoolArray = NDArray[np.bool_]

_MIN_AGREEMENT = 0.18  # share of agreeing ends: low, since the limbs of a body disagree
_SPEED_PER_METRE = 0.02  # m/s more minimum speed per metre of distance, since all errors grow with it
# m/s more without odometry: where much of the view moves, images alone may get the robot's own speed wrong by
# 0.1 to 0.2 m/s for some frames, and everything static seems to move by that.
_ALONE_MPS = 0.1
_KNOWN_SPEED = 2.0  # times the minimum speed: if sigma is less, a mover below the minimum has stopped
_WANDER = 0.5  # of its size: as the view turns from front to side, the centre moves by half a width
# Velocities: filtered; of this frame's fragments; of the surface; the difference of first and third.
_FILTERED, _FRAME, _SURFACE, _APART = range(4)


@record(frozen=True, slots=True, eq=False)
class Proof:
    """Of T tracks, (T,) each.

    moves, strength: motion is proven, and how many times the threshold is exceeded.
    surely_static: this frame's fragments are sure that it stands still.
    over: a motion has ended, by surely_static or by another sign.
    goes_on: nothing new proves motion, but nothing speaks against it.
    squared_sigmas: squared Mahalanobis distance of the filtered velocity from zero.
    """

    moves: Flags
    strength: Vector
    surely_static: Flags
    over: Flags
    goes_on: Flags
    squared_sigmas: Vector


@record(frozen=True, slots=True, eq=False)
class _Demands:
    """What is asked of the proofs of T tracks; see Demand.

    least_mps: (T,).
    fastest_mps, threshold, dt_s: the same for all.
    """

    least_mps: Vector
    fastest_mps: float
    threshold: float
    dt_s: float


@inlined
def _velocity(parts: Split, k: int, t: int) -> Velocity:
    """Velocity k of track t with its components."""
    return Velocity(
        speed_mps=parts.speed[k, t],
        sigma_mps=parts.sigma[k, t],
        value=parts.value[k, t],
        along=parts.along[k, t],
        across=parts.across[k, t],
        total=parts.total[k, t],
        level=parts.level[k, t],
    )


@inlined
def _ends(seen: MotionEvidence, t: int, frame: Velocity, fastest_mps: float) -> Ends:
    """The ends of track t. frame: the velocity that they agree on."""
    alike = seen.agreement[t] * seen.ends[t]
    # Ends that agree on an impossible velocity agree on a mistake, mostly of their depth.
    believed = seen.agreement[t] >= _MIN_AGREEMENT and frame.speed_mps <= fastest_mps
    return Ends(
        all=seen.ends[t],
        alike=alike,
        agreeing=alike if believed else 0.0,
        restless=seen.restless[t],
        restless_s=seen.restless_s[t],
    )


@inlined
def _shown(seen: MotionEvidence, parts: Split, second: SecondOpinion, demands: _Demands, t: int) -> Shown:
    """What this frame shows of track t."""
    frame, cells, size_m = _velocity(parts, _FRAME, t), seen.cells[t], seen.size_m[t]
    turning_mps = _WANDER * seen.view_radps[t] * size_m
    return Shown(
        filtered=_velocity(parts, _FILTERED, t),
        frame=frame,
        centre=_velocity(parts, _SURFACE, t),
        opinion=Opinion(
            denies_along=second.denies_along[t],
            denies_across=second.denies_across[t],
            confirms_along=second.confirms_along[t] and cells >= EVEN_CELLS and seen.keeps_area[t],
            confirms_across=second.confirms_across[t] and seen.keeps_area[t],
        ),
        ends=_ends(seen, t, frame, demands.fastest_mps),
        surface=Surface(
            cells=cells,
            size_m=size_m,
            velocity_measured_s=seen.velocity_measured_s[t],
            wander_mps=turning_mps + seen.growth_mps[t],
            depth_sigma_m=seen.depth_sigma_m[t],
        ),
        rim=Rim(
            speed_mps=abs(seen.rim_mps[t]) if seen.keeps_area[t] else 0.0,
            sigmas=seen.rim_sigmas[t],
            shown_s=seen.rim_s[t],
            wander_mps=turning_mps,
        ),
        approach=Approach(
            speed_mps=seen.approach_mps[t],
            shown_s=seen.approach_s[t],
            wander_mps=turning_mps,
        ),
        arrival=arrival_of(seen.arrived[t], seen.arriving_s[t], cells, demands.dt_s),
    )


@inlined
def _strength(shown: Shown, threshold: float) -> float:
    """How many times filter, fragments and number of ends exceed what a proof needs; the least of them."""
    filtered, frame = shown.filtered, shown.frame
    clear = np.minimum(np.maximum(filtered.along, filtered.across), np.maximum(frame.along, frame.across))
    result: float = np.minimum(clear / threshold, shown.ends.agreeing / ENDS_ACROSS)
    return result


@compiled(MotionEvidence, Split, SecondOpinion, _Demands, "boolean[:]")
def _proofs(
    seen: MotionEvidence, parts: Split, second: SecondOpinion, demands: _Demands, moving: BoolArray
) -> tuple[BoolArray, FloatArray, BoolArray, BoolArray, BoolArray]:
    """moves, strength, surely_static, over and goes_on of Proof.

    parts: the four velocities of each track. second: of surface on fragments. moving (T,): last verdict.
    """
    count = len(moving)
    moves, surely_static = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    over, goes_on, strength = np.zeros(count, np.bool_), np.zeros(count, np.bool_), np.zeros(count)
    for t in range(count):
        asked = Demand(
            least_mps=demands.least_mps[t],
            fastest_mps=demands.fastest_mps,
            threshold=demands.threshold,
            dt_s=demands.dt_s,
        )
        shown = _shown(seen, parts, second, demands, t)
        filtered, arrival = shown.filtered, shown.arrival
        possible = filtered.speed_mps <= asked.fastest_mps and shown.surface.size_m <= LARGEST_M
        fast = filtered.speed_mps > asked.least_mps
        # The place where a mover has stopped was free a moment ago, so its arrival there is no proof.
        stands = not fast and filtered.sigma_mps < _KNOWN_SPEED * asked.least_mps
        stopped = moving[t] and stands
        came = (arrival.much and not stopped) or (arrival.lasting and not stands)
        moves[t] = seen.trusted and possible and ((fast and is_evident(shown, asked)) or came)
        strength[t] = _strength(shown, asked.threshold)
        surely_static[t] = stands_surely(shown, asked)
        # Neither depth nor a fragment tells it from the static surface beside it, along which it would drift.
        lost = moving[t] and seen.border_is_guess[t] and shown.ends.all == 0 and not arrival.some
        slow = filtered.speed_mps < STANDING_SHARE * asked.least_mps
        over[t] = surely_static[t] or (stopped and slow) or lost
        still_moves = moving[t] and seems_to_move(shown, seen.advances[t], asked)
        # One fragment alone is no proof, but a reason to keep what more of them showed.
        one_moves = possible and fast and shown.ends.alike >= 2 and shown_across(shown, asked.threshold)
        goes_on[t] = still_moves or one_moves or (seen.restless[t] and not moving[t])
    return moves, strength, surely_static, over, goes_on


@compiled(MotionEvidence)
def _velocities(seen: MotionEvidence) -> tuple[FloatArray, FloatArray]:
    """The four velocities of T tracks (4, T, 3) with their covariances (4, T, 3, 3)."""
    count = len(seen.velocity)
    velocity, covariance = np.empty((4, count, 3)), np.empty((4, count, 3, 3))
    velocity[_FILTERED], covariance[_FILTERED] = seen.velocity, seen.covariance
    velocity[_FRAME], covariance[_FRAME] = seen.own_velocity, seen.own_covariance
    velocity[_SURFACE], covariance[_SURFACE] = seen.surface_velocity, seen.surface_covariance
    velocity[_APART] = seen.velocity - seen.surface_velocity
    covariance[_APART] = seen.covariance + seen.surface_covariance
    return velocity, covariance


def prove(seen: MotionEvidence, moving: BoolArray, dt_s: float, settings: MotionSettings) -> Proof:
    """The proofs of this frame. moving (T,): last verdict."""
    parts = decompose(*_velocities(seen), seen.sight, seen.up)
    second = second_opinion(parts, _FILTERED, _SURFACE, _APART)
    alone_mps = 0.0 if seen.reckoned else _ALONE_MPS
    least_mps = settings.min_speed_mps + alone_mps + _SPEED_PER_METRE * seen.distance_m
    demands = _Demands(least_mps, settings.implausible_mps, settings.sigmas**2, dt_s)
    moves, strength, surely_static, over, goes_on = _proofs(seen, parts, second, demands, moving)
    return Proof(
        moves=moves,
        strength=strength,
        surely_static=surely_static,
        over=over,
        goes_on=goes_on,
        squared_sigmas=parts.total[_FILTERED],
    )
