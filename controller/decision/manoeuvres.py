"""How far each watched body may change its velocity at worst, judged by how it moves relative to the robot.

controller/decision/worst_case_limit.py asks; controller/decision/reachability.py grows the bodies by it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.decision import Prediction
from controller.decision.limits import ALONG_TO_SIDE_RATIO, UNSEEN_ERROR_SIGMAS
from controller.decision.watched import Watched
from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray

# Least sideways speed that is assumed when a body's direction of motion is judged.
_MIN_SIDEWAYS_MPS = 0.1
# A body that comes towards the robot and was seen for this long has seen the robot, too.
_AWARE_AFTER_S = 1.0


@record(frozen=True, slots=True, eq=False)
class Manoeuvres:
    """What N bodies may do at worst; each (N,).

    since_s: time before now for which their motion is uncertain, too.
    spread_along_mps, spread_left_mps: uncertainty of their velocities, along the path and across it.
    surprise_along_mps, surprise_left_mps: by how much they may have changed further, as they are changing.
    speed_mps: measured speed.
    change_along_mps2, change_left_mps2: greatest change of their velocities.
    uncertain_along_m, uncertain_left_m: uncertainty of their positions.
    """

    since_s: FloatArray
    spread_along_mps: FloatArray
    spread_left_mps: FloatArray
    surprise_along_mps: FloatArray
    surprise_left_mps: FloatArray
    speed_mps: FloatArray
    change_along_mps2: FloatArray
    change_left_mps2: FloatArray
    uncertain_along_m: FloatArray
    uncertain_left_m: FloatArray


def manoeuvres_of(watched: Watched, prediction: Prediction) -> Manoeuvres:
    """What the watched bodies may do."""
    bodies, placed, velocities = watched.bodies, watched.placed, watched.velocities
    return Manoeuvres(
        *_manoeuvres(
            velocities.along_mps,
            velocities.left_mps,
            velocities.sigma_along_mps,
            velocities.sigma_left_mps,
            velocities.innovation_along_mps,
            velocities.innovation_left_mps,
            placed.d_m[:, 0],
            placed.clearance_m[:, 0],
            bodies.moving,
            bodies.age_s,
            bodies.unseen_s,
            watched.since_s,
            prediction.sigmas,
            prediction.cut_in_mps2,
            prediction.manoeuvre_mps2,
            prediction.oncoming_mps2,
            ALONG_TO_SIDE_RATIO,
            UNSEEN_ERROR_SIGMAS,
        )
    )


@compiled(
    "float64[:], float64[:], float64[:], float64[:], float64[:], float64[:], float64[:], float64[:],"
    "boolean[:], float64[:], float64[:], float64, float64, float64, float64, float64, float64, float64"
)
def _manoeuvres(
    along_mps: FloatArray,
    left_mps: FloatArray,
    sigma_along_mps: FloatArray,
    sigma_left_mps: FloatArray,
    innovation_along_mps: FloatArray,
    innovation_left_mps: FloatArray,
    d_m: FloatArray,
    clearance_m: FloatArray,
    moving: NDArray[np.bool_],
    age_s: FloatArray,
    unseen_s: FloatArray,
    since_s: float,
    sigmas: float,
    cut_in_mps2: float,
    manoeuvre_mps2: float,
    oncoming_mps2: float,
    along_to_side_ratio: float,
    unseen_error_sigmas: float,
) -> FloatArray:
    """(10, N) the fields of Manoeuvres."""
    answers = np.zeros((10, len(along_mps)))
    since, spread_along, spread_left, surprise_along, surprise_left = answers[:5]
    speed, along, sideways, uncertain_along, uncertain_left = answers[5:]
    for k in range(len(along_mps)):
        # unaware: goes in the robot's direction, so it does not see the robot coming and is beside it for
        # long. comes: comes towards the robot, sees it after a while and keeps its lane. leaves: moves away
        # from the path. All but comes and leaves may have changed their velocity since they left the view.
        # Out of view it cannot be seen to keep its lane, so there it must come nearly straight.
        aslant_mps = max(abs(left_mps[k]), _MIN_SIDEWAYS_MPS)
        outwards, beside = left_mps[k] * d_m[k] > 0.0, clearance_m[k] > 0.0
        unaware = along_mps[k] > (along_to_side_ratio if outwards else 1.0) * aslant_mps
        comes = along_mps[k] < -(along_to_side_ratio if unseen_s[k] > 0.0 else 1.0) * aslant_mps
        leaves = outwards and beside and not unaware
        if moving[k]:
            # A body that turns into the way also slows down along the path.
            along[k] = cut_in_mps2 if unaware and beside else manoeuvre_mps2
            sideways[k] = cut_in_mps2 if unaware else manoeuvre_mps2
            if comes and age_s[k] >= _AWARE_AFTER_S:
                sideways[k] = oncoming_mps2
        since[k] = since_s + (0.0 if comes or leaves else unseen_s[k])
        speed[k] = math.hypot(along_mps[k], left_mps[k])
        spread_along[k], spread_left[k] = sigmas * sigma_along_mps[k], sigmas * sigma_left_mps[k]
        surprise_along[k], surprise_left[k] = innovation_along_mps[k], innovation_left_mps[k]
        if not leaves:
            uncertain_along[k] = unseen_error_sigmas * unseen_s[k] * sigma_along_mps[k]
            uncertain_left[k] = unseen_error_sigmas * unseen_s[k] * sigma_left_mps[k]
    return answers
