"""Which bodies that are out of view move, and with which velocity they go on.

controller/decision/out_of_view.py asks these questions once a scene. Everything is in the frame of the path.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from controller.decision.bodies import MIN_TRACKED_S, Bodies
from controller.decision.view_edges import CurrentView, ahead_and_left, is_below_view
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.types import FlagMatrix, Flags, FloatArray

# A body that is judged standing counts as approaching if it is faster than both thresholds. Noise makes
# standing things beside the view seem to creep now and then; lower thresholds would slow the robot each time.
APPROACH_MIN_SIGMAS, APPROACH_MIN_MPS = 3.3, 0.2
# No person or vehicle is as narrow as this, but ends of racks are. Half of the greatest width that was seen.
MIN_MOVER_HALF_WIDTH_M = 0.1
# A speed above this many standard deviations is certain: the body will not be found where it was last seen.
# But perception also judges whether a track moves, which takes some frames. From this age on, its verdict
# "standing" is trusted more than the velocity: a body that sinks below the view may well seem to move.
_SURE_MOVE_SIGMAS, _VERDICT_TRUSTED_S = 5.0, 1.0
# A body out of view that moves away from the robot's axis may cut in only if it goes along with the robot: if
# its speed forward is more than this many times its speed outwards. Otherwise it has turned off.
_ALONG_TO_OUTWARD_RATIO = 4.0
# A speed within this many standard deviations of 0, and below this, is no motion of what is about to stop.
_AT_REST_SIGMAS, _AT_REST_MPS = 2.5, 0.25
# Velocities that differ by more standard deviations than this belong to two different bodies.
_SAME_VELOCITY_SIGMAS = 2.0


def significant_component(velocity_mps: FloatArray, covariance: FloatArray, along: FloatArray) -> float:
    """The velocity's component along a unit vector (2,); 0 if it is within one standard deviation of 0."""
    part_mps = float(velocity_mps @ along)
    return part_mps if abs(part_mps) > math.sqrt(float(along @ covariance @ along)) else 0.0


@inlined
def leftward_variance(covariance: FloatArray, cos: float, sin: float) -> float:
    """Variance of the component of a velocity to the left of a heading with this cosine and sine.

    covariance (2, 2): of the velocity.
    """
    mixed = covariance[0, 1] + covariance[1, 0]
    return float((covariance[0, 0] * sin - mixed * cos) * sin + covariance[1, 1] * cos * cos)


@inlined
def may_enter_way(bodies: Bodies, k: int, view: CurrentView) -> bool:
    """Whether body k may come into the robot's way.

    That is, it moves towards the robot's axis from either side, or along with the robot (more than
    _ALONG_TO_OUTWARD_RATIO times as fast forward as outwards), from where it may cut in.
    """
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    _, left_m = along_and_left(bodies.xy_m[k, 0] - view.x_m, bodies.xy_m[k, 1] - view.y_m, cos, sin)
    vx, vy = bodies.velocity_mps[k]
    forward_mps, leftward_mps = along_and_left(vx, vy, cos, sin)
    towards_axis = left_m * leftward_mps < 0.0
    return bool(towards_axis or forward_mps > _ALONG_TO_OUTWARD_RATIO * abs(leftward_mps))


def with_measured_velocity(bodies: Bodies, mistaken_mps: float) -> Bodies:
    """The bodies, where those that are judged standing but certainly move get their measured velocity.

    The verdict of perception takes some frames. A mover that leaves the view before its verdict would be
    remembered as standing where it no longer is, and the robot would wait for it without end. So bodies
    tracked for MIN_TRACKED_S to _VERDICT_TRUSTED_S count as moving if their measured speed is above
    _SURE_MOVE_SIGMAS and APPROACH_MIN_MPS. A speed above mistaken_mps is an error of measurement and is not
    used.
    """
    goes = _moves_before_verdict(bodies, _SURE_MOVE_SIGMAS, mistaken_mps)
    if not np.count_nonzero(goes):
        return bodies
    velocity = np.where(goes[:, None], bodies.measured_mps, bodies.velocity_mps)
    return replace(bodies, velocity_mps=velocity, moving=bodies.moving | goes)


@inlined
def _squared_and_variance(velocity_mps: FloatArray, covariance: FloatArray) -> tuple[float, float]:
    """The square of a speed, v'v, and v' C v: over v'v that is the speed's variance in its own direction."""
    x, y = velocity_mps
    mixed = covariance[0, 1] + covariance[1, 0]
    return x * x + y * y, x * covariance[0, 0] * x + x * mixed * y + y * covariance[1, 1] * y


@compiled(Bodies, CurrentView)
def stopped_below_view(bodies: Bodies, view: CurrentView) -> Flags:
    """(N,) which movers are below the view, ahead of the camera, and hardly moved when last seen.

    A verdict takes some frames: what has stopped still counts as moving when it sinks below the view. Their
    speed was within _AT_REST_SIGMAS standard deviations of 0, and at most _AT_REST_MPS. Nothing is said of
    bodies that were tracked for MIN_TRACKED_S or less: their velocity is hardly known.
    """
    stopped = np.zeros(len(bodies.moving), np.bool_)
    for k in range(len(stopped)):
        ahead, left = ahead_and_left(bodies.xy_m[k], view)
        near = ahead - bodies.half_view_m[k]
        hardly_tracked = bodies.tracked_s[k] <= MIN_TRACKED_S
        if not bodies.moving[k] or hardly_tracked or abs(left) > view.edge_tan * ahead:
            continue
        squared, variance = _squared_and_variance(bodies.velocity_mps[k], bodies.covariance[k])
        at_rest = squared <= _AT_REST_MPS**2 and squared**2 <= _AT_REST_SIGMAS**2 * variance
        stopped[k] = at_rest and is_below_view(bodies, k, near, view)
    return stopped


def hardly_stood(bodies: Bodies) -> Flags:
    """(N,) which bodies were judged standing before a verdict can be trusted, and measured as moving."""
    return _moves_before_verdict(bodies, APPROACH_MIN_SIGMAS, math.inf)


@inlined
def agrees(bodies: Bodies, k: int, seen: Bodies, m: int) -> bool:
    """Whether the measured velocity of the seen body m agrees with that of body k.

    A seen body that was tracked for MIN_TRACKED_S or less agrees with none: its velocity is hardly known and
    would fit any body.
    """
    agree = seen.tracked_s[m] > MIN_TRACKED_S
    for axis in range(2):
        differs = bodies.velocity_mps[k, axis] - seen.measured_mps[m, axis]
        spread = bodies.covariance[k, axis, axis] + seen.covariance[m, axis, axis]
        agree &= differs**2 <= _SAME_VELOCITY_SIGMAS**2 * spread
    return bool(agree)


@compiled(Bodies, Bodies)
def velocities_agree(bodies: Bodies, seen: Bodies) -> FlagMatrix:
    """(N, M) whether the velocity of each of M seen bodies agrees with that of each of N bodies."""
    agree = np.empty((len(bodies.velocity_mps), len(seen.measured_mps)), np.bool_)
    for k in range(agree.shape[0]):
        for m in range(agree.shape[1]):
            agree[k, m] = agrees(bodies, k, seen, m)
    return agree


@compiled(Bodies, "float64, float64")
def _moves_before_verdict(bodies: Bodies, sigmas: float, max_mps: float) -> Flags:
    """(N,) which bodies are judged standing and tracked for MIN_TRACKED_S to _VERDICT_TRUSTED_S only, but
    were measured as moving.

    Their speed is above this many standard deviations, above APPROACH_MIN_MPS, and at most max_mps.
    """
    moves = np.zeros(len(bodies.moving), np.bool_)
    for k in range(len(moves)):
        if bodies.moving[k] or not MIN_TRACKED_S <= bodies.tracked_s[k] < _VERDICT_TRUSTED_S:
            continue
        squared, variance = _squared_and_variance(bodies.measured_mps[k], bodies.covariance[k])
        fast = squared**2 > sigmas**2 * variance and squared > APPROACH_MIN_MPS**2
        moves[k] = fast and math.sqrt(squared) <= max_mps
    return moves
