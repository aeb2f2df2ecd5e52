"""The verdict moving or static for each track, with hysteresis, from several kinds of proof.

Kinds of proof in one frame, each a rule of vision/bodies/proof_rules.py, which has the thresholds. A velocity
is clear if it is more than settings.sigmas standard deviations from zero; for a likely one a share of that
squared threshold suffices.

* Fragments (by_fragments): the filtered velocity over ground is clear, and that of this frame's fragments
  alone supports it. Along the line of sight more ends have to agree than across it, since a few sliding ends
  look like a change of length. The surface must not contradict, except that many ends overrule it across the
  line of sight. Where it confirms the velocity, a likely one suffices, since both would have to be wrong in
  the same way.
* Unrest (by_unrest): most of many ends contradict standing still, though they may agree on no common
  velocity, as the ends on limbs. A likely filtered velocity suffices, a less likely one if the unrest lasts
  for longer than a limb swings one way.
* Arrival (by_arrival): part of the surface is where free space was seen. A likely velocity suffices. Where
  much of the surface has arrived, or some of it in each of several frames, that alone is proof, except for
  what has just stopped: its place was free a moment ago.
* Surface (by_surface): the centre of a whole, compact surface moves for longer and more clearly than a
  change of viewpoint or a growing surface explains.
* Free rims (by_rim): the outline of a compact body, where nothing nearer hides it, goes one way for longer
  than the outline of something static does, or it confirms a likely level motion of the filter.
* Approach (by_approach): the depth of the surface, cell by cell, has come nearer for longer and more clearly
  than noise explains. It needs neither an outline nor a whole body.

All kinds need a known motion of the camera and, except where arrival alone is proof, more than the minimum
speed. Bodies that are implausibly fast or wide prove nothing.

Hysteresis: evidence is a track's score. A track becomes moving at 1 and static again at 0.

* A frame with proof raises it: in proportion to its interval, faster the stronger the proof is, slower
  without odometry, and less where the camera's own motion is in doubt. No single frame proves motion.
* Without proof it falls slowly, since a moving body gives none in some frames, and even more slowly while the
  motion seems to go on.
* It falls fast where the motion is over: where this frame's fragments, or for a mover the filter, prove that
  it stands still, or where nothing distinguishes a mover from the static surface around it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray
from vision.bodies.motion_evidence import MotionEvidence
from vision.bodies.proof import Proof, prove

# Time in which the weakest proof raises the score by 1: two frames at 30 a second. With three frames the
# first detection came 0.07 s later.
_RISE_S = 0.06
# Without odometry an error of the camera's motion lasts for some frames, so one more frame is required.
_RISE_ALONE_S = 0.07
_FASTEST = 2.5  # maximum factor on the rise, with overwhelming proof
_MAX_RISE = 0.5  # maximum rise per frame: no single frame proves motion, however long the interval was
# Times in which the score falls by 1.
_FALL_S = 0.30  # without proof: in some frames a moving body gives none
_HOLD_S = 2.0  # without new proof, while the motion seems to go on
_STOP_S = 0.12  # with proof that the motion is over
_MAX_EVIDENCE = 1.5  # 1.5 times what a verdict needs, so that no mover is held for much longer
_SURE_SQUARED_SIGMAS = 30.0  # 5.5 sigmas give a confidence of 0.63; the weakest proof gives 0.4


@record(frozen=True, slots=True, eq=False)
class Verdict:
    """Of T tracks, (T,) each.

    evidence: the score.
    moving: the verdict.
    confidence: in that it moves, 0..1.
    surely_static: this frame's fragments are sure that it stands still.
    proven: this frame proved that it moves.
    """

    evidence: FloatArray
    moving: NDArray[np.bool_]
    confidence: FloatArray
    surely_static: NDArray[np.bool_]
    proven: NDArray[np.bool_]


def judge(
    seen: MotionEvidence,
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    dt_s: float,
    settings: MotionSettings,
) -> Verdict:
    """Raise or lower the evidence of each track, and decide whether it moves.

    seen: evidence of this frame. evidence, moving (T,): score and verdict of the frame before, dt_s ago.
    """
    proof = prove(seen, moving, dt_s, settings)
    new_evidence, new_moving, confidence = _updated_scores(
        proof,
        evidence,
        moving,
        seen.borne_out,
        dt_s / (_RISE_S if seen.reckoned else _RISE_ALONE_S),
        dt_s,
    )
    return Verdict(
        evidence=new_evidence,
        moving=new_moving,
        confidence=confidence,
        surely_static=proof.surely_static,
        proven=proof.moves,
    )


@compiled(Proof, "float64[::1], boolean[::1], float64, float64, float64")
def _updated_scores(
    proof: Proof,
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    borne_out: float,
    rise: float,
    dt_s: float,
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """evidence, moving and confidence of Verdict after a frame with this proof.

    rise: how much the weakest proof raises the score, before it is multiplied by borne_out (0..1).
    """
    score, now_moving, confidence = (
        np.empty(len(moving)),
        np.empty(len(moving), np.bool_),
        np.empty(len(moving)),
    )
    for t in range(len(moving)):
        if proof.moves[t] and not proof.surely_static[t]:
            # A stronger proof raises the score faster.
            pace = np.minimum(np.maximum(proof.strength[t], 1.0), _FASTEST)
            change = borne_out * np.minimum(pace * rise, _MAX_RISE)
        else:
            change = -dt_s / (_STOP_S if proof.over[t] else _HOLD_S if proof.goes_on[t] else _FALL_S)
        score[t] = np.minimum(np.maximum(evidence[t] + change, 0.0), _MAX_EVIDENCE)
        now_moving[t] = score[t] > 0.0 if moving[t] else score[t] >= 1.0
        confidence[t] = 1.0 - math.exp(-proof.squared_sigmas[t] / _SURE_SQUARED_SIGMAS)
    return score, now_moving, confidence
