"""Turns a requested (v, w) into a path: an arc of constant curvature from the robot's pose."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from config.path import ArcSpec, LineSpec, PathSpec, StartSpec
from config.robot import Robot
from controller import braking
from controller.decision.decision import Reason
from controller.governor.request import Twist
from controller.path.path import Path
from controller.path.path_speeds import YAW_RATE_FOR_THE_BEND, least_radius_m
from hal.types import PlanarPose

# A requested arc is refused if it is within this factor of the tightest one that a path may have, so that
# rounding does not make the path refuse it.
_SPARE_RADIUS = 1.01
# Slower requests count as standing: they are rounding errors of the planner or noise of encoders.
REQUESTED_REST_MPS = 0.005
REQUESTED_REST_RADPS = 0.005
SAME_MPS = 1e-3  # requested speeds that differ by less count as equal
# An arc with a radius of more than 10 km becomes a straight line (config.path.ArcSpec allows no larger one).
_STRAIGHT_1PM = 1e-4
# The path follows the arc for at most this angle, nearly half a turn.
_HALF_TURN_RAD = 3.0
# The same for a radius below the robot's width; such an arc would otherwise run into itself.
_TIGHT_TURN_RAD = 2.0
# The arc is longer than the camera's range by this, so that its end never limits the speed.
_BEYOND_M = 2.0


class Kind(Enum):
    """The kind of motion that a request asks for."""

    STAND = "stand"
    ARC = "arc"
    TURN = "turn in place"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class MotionRequest:
    """A request as a motion of this robot.

    speed_mps: along the arc, or of the body's farthest corner in a turn, within the robot's own limits; 0 for
    STAND and REFUSED.
    curvature_1pm: of the arc.
    left: direction of a turn, +1 to the left or -1.
    why: reason of a refusal.
    """

    kind: Kind
    speed_mps: float = 0.0
    curvature_1pm: float = 0.0
    left: int = 0
    why: str = ""


def corner_m(robot: Robot) -> float:
    """Distance from the centre of rotation to the body's farthest corner."""
    body = robot.body
    return math.hypot(max(body.front_m, body.rear_m), body.width_m / 2.0)


def tightest_m(robot: Robot) -> float:
    """The least radius that is driven on request."""
    return _SPARE_RADIUS * least_radius_m(robot)


def understand(twist: Twist, robot: Robot) -> MotionRequest:
    """The motion that twist asks of this robot."""
    v, w = twist.v_mps, twist.w_radps
    if not (math.isfinite(v) and math.isfinite(w)):
        return MotionRequest(Kind.REFUSED, why=f"the command is not a number: {v} m/s, {w} rad/s")
    if v < -REQUESTED_REST_MPS:
        why = f"reverse at {-v:.2f} m/s is refused: the camera does not see behind"
        return MotionRequest(Kind.REFUSED, why=why)
    if v <= REQUESTED_REST_MPS:
        if abs(w) <= REQUESTED_REST_RADPS:
            return MotionRequest(Kind.STAND)
        yaw_radps = min(abs(w), robot.limits.max_yaw_rate_radps)
        return MotionRequest(Kind.TURN, yaw_radps * corner_m(robot), left=1 if w > 0.0 else -1)
    curvature = w / v
    if abs(curvature) * tightest_m(robot) > 1.0:
        return MotionRequest(
            Kind.REFUSED,
            why=f"a radius of {1.0 / abs(curvature):.2f} m is tighter than this robot can drive "
            f"({tightest_m(robot):.2f} m): ask for a wider arc, or for v = 0 to turn in place",
        )
    yaw_radps = YAW_RATE_FOR_THE_BEND * robot.limits.max_yaw_rate_radps
    top_mps = min(robot.limits.max_speed_mps, yaw_radps / max(abs(curvature), _STRAIGHT_1PM))
    return MotionRequest(Kind.ARC, min(v, top_mps), curvature)


def stop_reason_of(request: MotionRequest, requested: Twist | None) -> Reason:
    """Why the robot stops for a request that asks for no motion, or for another one than the present.

    requested: None if there is no command.
    """
    if request.kind is Kind.REFUSED:
        return Reason("no command" if requested is None else "refused", f"{request.why}: stop")
    if request.kind is Kind.STAND:
        return Reason("requested", "asked to stand")
    return Reason("requested", f"stands before it can {'turn in place' if request.left else 'drive on'}")


def driveable(request: MotionRequest, v_mps: float, robot: Robot) -> MotionRequest:
    """The request, with its curvature limited to what the yaw rate limit allows at v_mps.

    v_mps: the highest speed that the robot will still reach. If it is too fast for the requested arc, the
    robot slows down on the tightest arc that it can drive at that speed.
    """
    most_1pm = robot.limits.max_yaw_rate_radps / max(v_mps, REQUESTED_REST_MPS)
    if abs(request.curvature_1pm) <= most_1pm:
        return request
    return replace(request, curvature_1pm=math.copysign(most_1pm, request.curvature_1pm))


def arc_path(pose: PlanarPose, curvature_1pm: float, speed_mps: float, range_m: float, robot: Robot) -> Path:
    """The arc from pose on, beyond the camera's range and the stopping distance, but less than half a turn.

    speed_mps: the requested speed. It becomes the speed limit of the path's section, so that the decision
    never assumes a higher speed than requested.
    """
    stop_m = braking.stop(robot.limits.max_speed_mps, 0.0, braking.comfort(robot.limits)).distance_m
    length_m = max(range_m, stop_m) + _BEYOND_M
    most = max(min(speed_mps, 5.0), REQUESTED_REST_MPS)
    start = StartSpec(x_m=pose.x_m, y_m=pose.y_m, heading_deg=math.degrees(pose.heading_rad))
    if abs(curvature_1pm) < _STRAIGHT_1PM:
        line = LineSpec(kind="line", length_m=length_m, max_speed_mps=most)
        return Path(PathSpec(start=start, segments=(line,)), robot)
    radius_m = 1.0 / abs(curvature_1pm)
    most_rad = _HALF_TURN_RAD if radius_m > robot.body.width_m else _TIGHT_TURN_RAD
    turn_rad = math.copysign(min(length_m / radius_m, most_rad), curvature_1pm)
    arc = ArcSpec(kind="arc", radius_m=radius_m, angle_deg=math.degrees(turn_rad), max_speed_mps=most)
    return Path(PathSpec(start=start, segments=(arc,)), robot)
