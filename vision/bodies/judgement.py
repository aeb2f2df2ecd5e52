"""Moving or static, for each track: a verdict with hysteresis, from several kinds of proof.

Kinds of proof in one frame, each of them a rule of vision/bodies/proof.py (threshold: settings.sigmas
squared; ends: end points of the track's fragments):

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

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.compiled import compiled
from hal.types import FloatArray
from vision.bodies.proof import prove
from vision.motion.motion_evidence import MotionEvidence

# Two frames at 30 a second: with three of them the first detection came 0.07 s later.
_RISE_S = 0.06
# Without odometry an error of the camera's motion stays for some frames: one more of them is asked for.
_RISE_ALONE_S = 0.07
_FASTEST = 2.5  # times, with overwhelming proof
_MOST_A_FRAME = 0.5  # no single frame proves motion, however long ago the one before was
_FALL_S = 0.30  # without proof: in some frames there is none of what moves
_HOLD_S = 2.0  # without new proof
_STOP_S = 0.12  # with proof of standing still
_MAX_EVIDENCE = 1.5  # half as much again as a verdict takes: no mover is held for much longer
IMPLAUSIBLE = 1.6  # times the greatest speed: faster things are mistakes
_SURE_SQUARED_SIGMAS = 30.0  # five and a half sigmas: a confidence of 0.63, and 0.4 at the least proof


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """evidence, moving, confidence 0..1, whether its fragments are sure that it stands, and whether this
    frame proved that it moves: (T,) each."""

    evidence: FloatArray
    moving: NDArray[np.bool_]
    confidence: FloatArray
    stands: NDArray[np.bool_]
    proven: NDArray[np.bool_]


def judge(
    seen: MotionEvidence,
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    dt_s: float,
    settings: MotionSettings,
) -> Verdict:
    """Raise or lower the evidence of each track, and decide."""
    proof = prove(seen, moving, IMPLAUSIBLE * settings.max_speed_mps, dt_s, settings)
    new_evidence, new_moving, confidence = _added_up(
        evidence,
        moving,
        proof.moves,
        proof.strength,
        proof.stands,
        proof.over,
        proof.goes_on,
        proof.sigmas,
        seen.borne_out,
        dt_s / (_RISE_S if seen.reckoned else _RISE_ALONE_S),
        dt_s,
    )
    return Verdict(
        evidence=new_evidence,
        moving=new_moving,
        confidence=confidence,
        stands=proof.stands,
        proven=proof.moves,
    )


@compiled(
    "float64[::1], boolean[::1], boolean[::1], float64[::1], boolean[::1], boolean[::1], boolean[::1],"
    "float64[::1], float64, float64, float64"
)
def _added_up(
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    proven: NDArray[np.bool_],
    strength: FloatArray,
    stands: NDArray[np.bool_],
    over: NDArray[np.bool_],
    goes_on: NDArray[np.bool_],
    sigmas: FloatArray,
    borne_out: float,
    rise: float,
    dt_s: float,
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """evidence, moving and confidence of Verdict, after a frame with that Proof. rise: by so much the least
    proof raises the evidence, as far as it is borne_out."""
    score, goes, confidence = np.empty(len(moving)), np.empty(len(moving), np.bool_), np.empty(len(moving))
    for t in range(len(moving)):
        if proven[t] and not stands[t]:
            # The faster, the stronger the proof is.
            pace = np.minimum(np.maximum(strength[t], 1.0), _FASTEST)
            change = borne_out * np.minimum(pace * rise, _MOST_A_FRAME)
        else:
            change = -dt_s / (_STOP_S if over[t] else _HOLD_S if goes_on[t] else _FALL_S)
        score[t] = np.minimum(np.maximum(evidence[t] + change, 0.0), _MAX_EVIDENCE)
        goes[t] = score[t] > 0.0 if moving[t] else score[t] >= 1.0
        confidence[t] = 1.0 - math.exp(-sigmas[t] / _SURE_SQUARED_SIGMAS)
    return score, goes, confidence
