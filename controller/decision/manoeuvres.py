"""How far each watched body may change its velocity at worst, judged by how it moves relative to the robot.

controller/decision/worst_case_limit.py asks; controller/decision/reachability.py grows the bodies by it.
"""

from __future__ import annotations

import math

import numpy as np

from config.decision import Prediction
from controller.decision.bodies import Bodies
from controller.decision.corridor import PathVelocities, Placed
from controller.decision.limits import UNSEEN_ERROR_SIGMAS
from controller.decision.watched import Watched
from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray, Vector

# Least sideways speed that is assumed when a body's direction of motion is judged.
_MIN_SIDEWAYS_MPS = 0.1
# A body that moves away from the path goes along with the robot only if its speed along the path is more than
# this many times its sideways speed. Otherwise it is leaving the path.
_ALONG_TO_SIDE_RATIO = 2.0
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

    since_s: Vector
    spread_along_mps: Vector
    spread_left_mps: Vector
    surprise_along_mps: Vector
    surprise_left_mps: Vector
    speed_mps: Vector
    change_along_mps2: Vector
    change_left_mps2: Vector
    uncertain_along_m: Vector
    uncertain_left_m: Vector


def manoeuvres_of(watched: Watched, prediction: Prediction) -> Manoeuvres:
    """What the watched bodies may do."""
    return Manoeuvres(
        *_manoeuvres(watched.bodies, watched.placed, watched.velocities, watched.since_s, prediction)
    )


@compiled(Bodies, Placed, PathVelocities, "float64", Prediction)
def _manoeuvres(
    bodies: Bodies, placed: Placed, velocities: PathVelocities, since_s: float, prediction: Prediction
) -> FloatArray:
    """(10, N) the fields of Manoeuvres."""
    count = len(bodies.moving)
    answers = np.zeros((10, count))
    since, spread_along, spread_left, surprise_along, surprise_left = answers[:5]
    speed, along, sideways, uncertain_along, uncertain_left = answers[5:]
    for k in range(count):
        along_mps, left_mps, unseen_s = velocities.along_mps[k], velocities.left_mps[k], bodies.unseen_s[k]
        sigma_along_mps, sigma_left_mps = velocities.sigma_along_mps[k], velocities.sigma_left_mps[k]
        # unaware: goes in the robot's direction, so it does not see the robot coming and is beside it for
        # long. comes: comes towards the robot, sees it after a while and keeps its lane. leaves: moves away
        # from the path. All but comes and leaves may have changed their velocity since they left the view.
        # Out of view it cannot be seen to keep its lane, so there it must come nearly straight.
        aslant_mps = max(abs(left_mps), _MIN_SIDEWAYS_MPS)
        outwards, beside = left_mps * placed.d_m[k, 0] > 0.0, placed.clearance_m[k, 0] > 0.0
        unaware = along_mps > (_ALONG_TO_SIDE_RATIO if outwards else 1.0) * aslant_mps
        comes = along_mps < -(_ALONG_TO_SIDE_RATIO if unseen_s > 0.0 else 1.0) * aslant_mps
        leaves = outwards and beside and not unaware
        if bodies.moving[k]:
            # A body that turns into the way also slows down along the path.
            along[k] = prediction.cut_in_mps2 if unaware and beside else prediction.manoeuvre_mps2
            sideways[k] = prediction.cut_in_mps2 if unaware else prediction.manoeuvre_mps2
            if comes and bodies.age_s[k] >= _AWARE_AFTER_S:
                sideways[k] = prediction.oncoming_mps2
        since[k] = since_s + (0.0 if comes or leaves else unseen_s)
        speed[k] = math.hypot(along_mps, left_mps)
        spread_along[k] = prediction.sigmas * sigma_along_mps
        spread_left[k] = prediction.sigmas * sigma_left_mps
        surprise_along[k] = velocities.innovation_along_mps[k]
        surprise_left[k] = velocities.innovation_left_mps[k]
        if not leaves:
            uncertain_along[k] = UNSEEN_ERROR_SIGMAS * unseen_s * sigma_along_mps
            uncertain_left[k] = UNSEEN_ERROR_SIGMAS * unseen_s * sigma_left_mps
    return answers
