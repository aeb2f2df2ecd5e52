"""What one frame proves of each track: that it moves, that it stands still, or neither.

The rules are in vision/bodies/proof_rules.py; vision/bodies/judgement.py adds their proofs up over frames.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.compiled import compiled, inlined
from hal.types import Flags, FloatArray, Vector
from vision.bodies.motion_evidence import MotionEvidence
from vision.bodies.proof_rules import (
    ENDS_ACROSS,
    EVEN_CELLS,
    LARGEST_M,
    STANDING_SHARE,
    Ends,
    Opinion,
    Rim,
    Surface,
    Velocity,
    arrival_of,
    by_approach,
    by_arrival,
    by_fragments,
    by_rim,
    by_surface,
    by_unrest,
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


@dataclass(frozen=True, slots=True, eq=False)
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


@inlined
def _velocity(velocity: FloatArray, covariance: FloatArray, parts: Split, k: int, t: int) -> Velocity:
    """Velocity k of track t with its components; for the arguments see _proofs."""
    v, c = velocity[k, t], covariance[k, t]
    return Velocity(
        speed_mps=math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]),
        sigma_mps=math.sqrt(c[0, 0] + c[1, 1] + c[2, 2]),
        value=parts.value[k, t],
        along=parts.along[k, t],
        across=parts.across[k, t],
        total=parts.total[k, t],
        level=parts.level[k, t],
    )


@compiled(
    MotionEvidence,
    "float64[:, :, ::1], float64[:, :, :, ::1]",
    Split,
    SecondOpinion,
    "float64[:], boolean[:], float64, float64, float64",
)
def _proofs(
    seen: MotionEvidence,
    velocity: FloatArray,
    covariance: FloatArray,
    parts: Split,
    second: SecondOpinion,
    least_mps: FloatArray,
    moving: BoolArray,
    fastest_mps: float,
    dt_s: float,
    threshold: float,
) -> tuple[BoolArray, FloatArray, BoolArray, BoolArray, BoolArray]:
    """moves, strength, surely_static, over and goes_on of Proof.

    velocity (4, T, 3), covariance (4, T, 3, 3), parts: the four velocities of each track, and their
    components. threshold: squared sigmas.
    """
    count = len(moving)
    moves, surely_static = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    over, goes_on, strength = np.zeros(count, np.bool_), np.zeros(count, np.bool_), np.zeros(count)
    for t in range(count):
        filtered = _velocity(velocity, covariance, parts, _FILTERED, t)
        frame = _velocity(velocity, covariance, parts, _FRAME, t)
        centre = _velocity(velocity, covariance, parts, _SURFACE, t)
        ends, cells, size_m = seen.ends[t], seen.cells[t], seen.size_m[t]
        opinion = Opinion(
            denies_along=second.denies_along[t],
            denies_across=second.denies_across[t],
            confirms_along=second.confirms_along[t] and cells >= EVEN_CELLS,
            confirms_across=second.confirms_across[t],
        )
        alike = seen.agreement[t] * ends
        # Ends that agree on an impossible velocity agree on a mistake, mostly of their depth.
        believed = seen.agreement[t] >= _MIN_AGREEMENT and frame.speed_mps <= fastest_mps
        agreeing = alike if believed else 0.0
        track_ends = Ends(
            all=ends, agreeing=agreeing, restless=seen.restless[t], restless_s=seen.restless_s[t]
        )
        turning_mps = _WANDER * seen.view_radps[t] * size_m
        surface = Surface(
            cells=cells,
            size_m=size_m,
            velocity_measured_s=seen.velocity_measured_s[t],
            wander_mps=turning_mps + seen.growth_mps[t],
            depth_sigma_m=seen.depth_sigma_m[t],
        )
        rim = Rim(
            speed_mps=abs(seen.rim_mps[t]),
            sigmas=seen.rim_sigmas[t],
            shown_s=seen.rim_s[t],
            wander_mps=turning_mps,
        )
        arrival = arrival_of(seen.arrived[t], seen.arriving_s[t], cells, dt_s)
        possible = filtered.speed_mps <= fastest_mps and size_m <= LARGEST_M
        fast = filtered.speed_mps > least_mps[t]
        evident = (
            by_fragments(filtered, frame, opinion, track_ends, threshold)
            or by_unrest(filtered, track_ends, threshold)
            or by_arrival(filtered, arrival.some, threshold)
            or by_surface(centre, surface, least_mps[t], dt_s, threshold)
            or by_approach(seen.approach_mps[t], seen.approach_s[t], least_mps[t] + turning_mps, dt_s)
            or (by_rim(rim, filtered, size_m, least_mps[t], dt_s, threshold) and rim.speed_mps <= fastest_mps)
        )
        # The place where a mover has stopped was free a moment ago, so its arrival there is no proof.
        stands = not fast and filtered.sigma_mps < _KNOWN_SPEED * least_mps[t]
        stopped = moving[t] and stands
        came = (arrival.much and not stopped) or (arrival.lasting and not stands)
        moves[t] = seen.trusted and possible and ((evident and fast) or came)
        shown = np.minimum(np.maximum(filtered.along, filtered.across), np.maximum(frame.along, frame.across))
        strength[t] = np.minimum(shown / threshold, agreeing / ENDS_ACROSS)
        surely_static[t] = stands_surely(frame, agreeing, least_mps[t])
        # Neither depth nor a fragment tells it from the static surface beside it, along which it would drift.
        lost = moving[t] and seen.border_is_guess[t] and ends == 0 and not arrival.some
        slow = filtered.speed_mps < STANDING_SHARE * least_mps[t]
        over[t] = surely_static[t] or (stopped and slow) or lost
        still_moves = moving[t] and seems_to_move(filtered, seen.advances[t], arrival.some, least_mps[t])
        # One fragment alone is no proof, but a reason to keep what more of them showed.
        one_moves = possible and fast and alike >= 2 and shown_across(filtered, frame, threshold)
        goes_on[t] = still_moves or one_moves or (seen.restless[t] and not moving[t])
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
    second = second_opinion(parts, _FILTERED, _SURFACE, _APART)
    alone_mps = 0.0 if seen.reckoned else _ALONE_MPS
    least_mps = settings.min_speed_mps + alone_mps + _SPEED_PER_METRE * seen.distance_m
    moves, strength, surely_static, over, goes_on = _proofs(
        seen,
        velocity,
        covariance,
        parts,
        second,
        least_mps,
        moving,
        fastest_mps,
        dt_s,
        settings.sigmas**2,
    )
    return Proof(
        moves=moves,
        strength=strength,
        surely_static=surely_static,
        over=over,
        goes_on=goes_on,
        squared_sigmas=parts.total[_FILTERED],
    )
