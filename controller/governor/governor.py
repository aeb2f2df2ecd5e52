"""Another planner's (v, w) in, the greatest safe part of it out. Both are scaled alike, which keeps the arc.

The mission's decision (controller/decision/decide.py) gets the arc as the path ahead, and the speed goes
through the same shaper. The camera cannot see the floor where a new arc begins, so that floor is remembered
(controller/governor/ground.py). A turn in place is driven if the circle that it sweeps is free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from config.decision import DecisionConfig
from config.governor import GovernorConfig
from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from config.robot import Robot
from controller.base.localise import PoseHistory
from controller.base.response_monitor import NO_CAP, SpeedCap
from controller.decision.camera_limits import condition_limit
from controller.decision.decide import DecisionMaker
from controller.decision.decision import Action, Decision, Reason
from controller.decision.lens_cover import COVERED
from controller.decision.limits import STANDING_MPS, Limit, Motion
from controller.decision.obstacle_boxes import bodies_of
from controller.decision.situation import SceneError, Situation, speed_to_decide_by
from controller.decision.surfaces import check_scan
from controller.governor.arc_ahead import ArcAhead
from controller.governor.arcs import (
    SAME_MPS,
    Kind,
    MotionRequest,
    corner_m,
    driveable,
    stop_reason_of,
    understand,
)
from controller.governor.ground import GroundMemory
from controller.governor.ground_limits import GroundLimits
from controller.governor.request import Twist
from controller.path.path import OnPath, Path
from controller.shape import SpeedShaper
from hal.types import CameraMount, PlanarPose
from vision.scene import CameraCondition, Scene

# The remembered floor stands in for the camera up to this far beyond the floor that is free by consent.
_NEAR_EXTRA_M = 0.3


@dataclass(frozen=True, slots=True)
class Governed:
    """What to command.

    decision: why; its target_speed_mps is the speed along the arc, or that of the body's corner in a turn.
    fault: the shaper's; "" if there is none.
    """

    v_mps: float
    a_mps2: float
    w_radps: float
    decision: Decision
    fault: str = ""


class SpeedGovernor:
    """Limits one request in each control period; controller/governor/loop.py steps it.

    All poses, those of the scenes included, are in one fixed frame (odometry).
    """

    def __init__(
        self,
        config: GovernorConfig,
        decision: DecisionConfig,
        robot: Robot,
        mount: CameraMount,
        period_s: float,
        noise: DepthNoise = TYPICAL_DEPTH_NOISE,
    ) -> None:
        self._decision, self._robot, self._mount = decision, robot, mount
        self._latency_s = period_s + decision.chassis_delay_s
        self._decide = DecisionMaker(decision, robot, mount, period_s, noise)
        self._shape = SpeedShaper(robot.limits, period_s, decision.chassis_delay_s)
        self._ground = GroundMemory(robot, mount, decision)
        self._ground_limits = GroundLimits(self._ground, robot, decision, config.turn_memory_s)
        self._ahead = ArcAhead(self._decide, robot, decision.sight.range_m, _NEAR_EXTRA_M)
        self._poses = PoseHistory()
        # How the robot moves now: kept until it stands, whatever is asked for meanwhile.
        self._motion = MotionRequest(Kind.STAND)
        self._has_moved = False

    @property
    def path(self) -> Path | None:
        """The arc of the last step."""
        return self._ahead.path

    @property
    def on_path(self) -> OnPath:
        """Where the robot is on that arc."""
        return self._ahead.on_path

    def rest(self) -> None:
        """Begin again from standstill: the chassis does not follow setpoints now."""
        self._shape.reset()
        self._motion = MotionRequest(Kind.STAND)

    def step(
        self,
        now_ns: int,
        scene: Scene | None,
        requested: Twist | None,
        pose: PlanarPose,
        measured_mps: float = math.nan,
        silence: str = "no command",
        cap: SpeedCap = NO_CAP,
    ) -> Governed:
        """What to command for one period from now_ns on.

        scene: the newest; the same one is given until a newer one arrives.
        requested: what is asked for; None: nothing, so the robot makes a jerk-limited stop.
        pose: of the body, by odometry.
        measured_mps: by the chassis.
        silence: why nothing is requested.
        cap: what the response of the base permits.
        """
        request = (
            MotionRequest(Kind.REFUSED, why=silence)
            if requested is None
            else understand(requested, self._robot)
        )
        if pose.finite:
            self._look(scene, pose, now_ns)
        self._choose_motion(request)
        decision = self._decided(scene, pose, measured_mps, now_ns)
        decision = self._capped_to_request(decision, request, requested)
        return self._command(decision, cap)

    def _look(self, scene: Scene | None, pose: PlanarPose, now_ns: int) -> None:
        """Remember each scene once. A scene without a pose gets the pose that the robot had at its time."""
        self._poses.append(now_ns, pose)
        self._ground.move(pose, now_ns)
        if not self._has_moved:
            self._ground.renew_consent(now_ns)
        if scene is None or not self._ahead.is_new(scene):
            return
        then = scene.robot_pose or self._poses.at(scene.captured_ns)
        if then is None or not then.finite or scene.captured_ns > now_ns:
            return
        if scene.health.condition is CameraCondition.UNTRUSTWORTHY:
            return  # the decision gets the scene and stops; the ground learns nothing from it
        try:
            check_scan(scene.free_space)
            bodies = bodies_of(scene, then, self._mount, self._decision.prediction.body_depth_m)
        except SceneError:
            return  # the decision says so and stops
        self._ahead.remember(replace(scene, robot_pose=then))
        standing = self._shape.v_mps == 0.0
        self._ground.look(scene.free_space, then, scene.captured_ns, bodies.select(bodies.moving), standing)

    def _choose_motion(self, request: MotionRequest) -> None:
        """Choose what is driven now.

        An arc may change into another arc on the way. Between an arc and a turn in place, and between turns
        in different directions, the robot comes to rest.
        """
        stands = self._shape.v_mps == 0.0 and self._shape.a_mps2 == 0.0
        if request.kind is Kind.ARC and (stands or self._motion.kind is Kind.ARC):
            # It still gets faster until its present acceleration has ended.
            more_mps = max(self._shape.a_mps2, 0.0) ** 2 / (2.0 * self._robot.limits.max_jerk_mps3)
            self._motion = driveable(request, self._shape.v_mps + more_mps, self._robot)
        elif request.kind is Kind.TURN and (
            stands or (self._motion.kind is Kind.TURN and self._motion.left == request.left)
        ):
            self._motion = request
        elif stands:
            self._motion = MotionRequest(Kind.STAND)

    def _decided(self, scene: Scene | None, pose: PlanarPose, measured_mps: float, now_ns: int) -> Decision:
        """The decision for the present motion, before it is compared with the request."""
        turns = self._motion.kind is Kind.TURN
        v_mps = 0.0 if turns else speed_to_decide_by(self._shape.v_mps, measured_mps)
        a_mps2 = 0.0 if turns else self._shape.a_mps2
        path = self._lay_out_arc(pose)
        scene, on_path = self._ahead.with_pose(scene), self._ahead.on_path
        decision = self._decide.step(Situation(scene, path, pose, on_path, v_mps, a_mps2, now_ns))
        if turns:
            return self._turn(decision, pose, now_ns)
        if self._motion.kind is Kind.ARC and decision.reason.rule != "fault":
            assert self._ahead.known is not None
            motion = Motion(v_mps, a_mps2, self._latency_s)
            corridor, to_s_m = self._ahead.known.corridor, self._ground.consent_m + _NEAR_EXTRA_M
            for limit in self._ground_limits.arc_limits(corridor, on_path.s_m, to_s_m, motion, now_ns):
                decision = self._least(decision, limit)
        return decision

    def _lay_out_arc(self, pose: PlanarPose) -> Path:
        """The arc of the present motion; a straight line if the motion is no arc."""
        v_mps, motion = self._shape.v_mps, self._motion
        if motion.kind is Kind.ARC:
            return self._ahead.lay_out(pose, motion.curvature_1pm, motion.speed_mps, v_mps)
        return self._ahead.lay_out(pose, 0.0, v_mps, v_mps)

    def _turn(self, decision: Decision, pose: PlanarPose, now_ns: int) -> Decision:
        """The decision for a turn in place, where the decision ahead counts only for its faults.

        The camera's condition is asked for separately: in the decision ahead, a lower limit may hide it.
        """
        known = self._ahead.known
        assert known is not None
        if decision.reason.rule == "fault":
            return self._with(decision, 0.0, decision.reason, emergency=False)
        camera = condition_limit(known, self._decision.sight)
        if camera is not None and camera.speed_mps <= 0.0:
            return self._with(decision, 0.0, camera.reason, emergency=False)
        covered = f"{COVERED}: stop" if known.lens.covered else ""
        objection = covered or self._ground_limits.turn_objection(known.bodies, pose, now_ns)
        if objection:
            return self._with(decision, 0.0, Reason("turn", objection), emergency=True)
        speed_mps = self._motion.speed_mps
        if camera is not None and camera.speed_mps < speed_mps:
            return self._with(decision, camera.speed_mps, camera.reason, emergency=False)
        yaw_radps = self._motion.left * speed_mps / corner_m(self._robot)
        reason = Reason("requested", f"turns in place at {yaw_radps:.2f} rad/s")
        return self._with(decision, speed_mps, reason, emergency=False)

    def _least(self, decision: Decision, limit: Limit) -> Decision:
        """The decision under one more limit. A limit below the creep speed means stop."""
        speed_mps = limit.speed_mps
        if speed_mps < self._decision.release.creep_mps:
            speed_mps = 0.0
        if speed_mps >= decision.target_speed_mps:
            return decision
        return self._with(decision, speed_mps, limit.reason, emergency=decision.emergency or limit.urgent)

    def _capped_to_request(
        self, decision: Decision, request: MotionRequest, requested: Twist | None
    ) -> Decision:
        """The decision, no faster than asked for, with the request as its reason if that is the limit."""
        stop = request.kind in (Kind.STAND, Kind.REFUSED) or request.kind is not self._motion.kind
        stop = stop or (request.kind is Kind.TURN and request.left != self._motion.left)
        if stop:
            return self._with(decision, 0.0, stop_reason_of(request, requested), emergency=decision.emergency)
        assert requested is not None
        if request.kind is Kind.TURN:
            return decision
        target_mps = min(decision.target_speed_mps, request.speed_mps)
        reason = decision.reason
        if reason.rule in ("free", "section"):
            reason = Reason(
                "requested", f"as asked: {requested.v_mps:.2f} m/s, {requested.w_radps:.2f} rad/s"
            )
            if target_mps < requested.v_mps - SAME_MPS:
                sentence = (
                    f"asked {requested.v_mps:.2f} m/s; on this arc the robot drives {target_mps:.2f} m/s"
                )
                reason = Reason("robot", sentence)
        elif reason.rule == "target":
            reason = Reason("robot", f"the arc is checked for a limited distance: {target_mps:.2f} m/s")
        return self._with(decision, target_mps, reason, emergency=decision.emergency)

    def _with(self, decision: Decision, target_mps: float, reason: Reason, *, emergency: bool) -> Decision:
        v, band = self._shape.v_mps, self._decision.release.dead_band_mps
        action = Action.KEEP
        if target_mps > v + band:
            action = Action.INCREASE
        elif target_mps < v - band or (target_mps == 0.0 and v > STANDING_MPS):
            action = Action.DECREASE
        stuck_ns = decision.stuck_since_ns if reason is decision.reason else None
        return Decision(action, target_mps, reason, emergency and v > STANDING_MPS, stuck_ns)

    def _command(self, decision: Decision, cap: SpeedCap) -> Governed:
        turns = self._motion.kind is Kind.TURN
        # In a turn the commanded speed ahead is 0, so a cap of 0 means that the base runs away: end the turn.
        target_mps = min(decision.target_speed_mps, cap.cap_mps)
        shaped = self._shape.step(target_mps, emergency=decision.emergency or cap.hard)
        self._has_moved = self._has_moved or shaped.v_mps > 0.0
        if turns:
            w_radps = self._motion.left * shaped.v_mps / corner_m(self._robot)
            return Governed(0.0, 0.0, w_radps, decision, shaped.fault)
        w_radps = self._motion.curvature_1pm * shaped.v_mps
        return Governed(shaped.v_mps, shaped.a_mps2, w_radps, decision, shaped.fault)
