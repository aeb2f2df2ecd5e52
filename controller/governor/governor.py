"""Another planner's (v, w) in, the greatest safe part of it out: both scaled alike, so the arc is kept.

The decision is the mission's (controller/decision/decide.py) with the arc as the path ahead; the floor that
is too near for the camera to see along a path that begins only now is remembered
(controller/governor/ground.py); the speed goes through the same shaper. A turn in place is driven where the
circle that it sweeps is free.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

from config.decision import DecisionConfig
from config.governor import GovernorConfig
from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from config.robot import Robot
from controller.answer import ANSWERS, Answer
from controller.decision.bodies import SceneError, bodies_of
from controller.decision.camera_limits import condition_limit
from controller.decision.decide import DecisionMaker
from controller.decision.decision import Action, Decision, Reason
from controller.decision.lens_cover import COVERED
from controller.decision.limits import Limit, Motion, speed_to_decide_by
from controller.decision.situation import Situation
from controller.decision.surfaces import check_scan
from controller.decision.world_model import WorldModel
from controller.governor.arcs import Kind, Wish, arc_path, corner_m, driveable, understand, why_stop
from controller.governor.ground import GroundMemory
from controller.governor.request import Twist
from controller.governor.surroundings import near_limits, turn_objection
from controller.localise import PoseHistory
from controller.path.path import OnPath, Path
from controller.shape import SpeedShaper
from hal.types import CameraMount, PlanarPose
from vision.scene import CameraCondition, Scene

# A new arc is laid out when the robot has left the old one by this, or has come this far along it.
_OFF_M = 0.02
_OFF_RAD = 0.02
_ALONG_M = 0.25
# So far ahead of the robot's standing place the remembered floor answers instead of the camera.
_NEAR_EXTRA_M = 0.3
# As many scenes as controller/decision/sight.py compares before it believes a surface.
_SCENES = 5
_STANDING_MPS = 0.01
_SAME_MPS = 1e-3
# At the end of the camera's range 10 cm aside, and a centimetre where the robot may have to stop.
_SAME_1PM = 0.002


@dataclass(frozen=True, slots=True)
class Governed:
    """What to command. decision: why; its target_speed_mps is that of the arc, or of the body's corner in a
    turn in place. fault: the shaper's, "" if there is none."""

    v_mps: float
    a_mps2: float
    w_radps: float
    decision: Decision
    fault: str = ""


class SpeedGovernor:
    """One step a control period. Calls no clock, keeps no socket: controller/governor/loop.py does the rest.

    Poses, and robot_pose of the scenes where they have one, are in one frame that does not move (odometry).
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
        self._config, self._decision, self._robot, self._mount = config, decision, robot, mount
        self._latency_s = period_s + decision.chassis_delay_s
        self._decide = DecisionMaker(decision, robot, mount, period_s, noise)
        self._shape = SpeedShaper(robot.limits, period_s, decision.chassis_delay_s)
        self._ground = GroundMemory(robot, mount, decision)
        self._poses = PoseHistory()
        self._scenes: deque[Scene] = deque(maxlen=_SCENES)
        # How the robot moves now: kept until it stands, whatever is asked for meanwhile.
        self._motion = Wish(Kind.STAND)
        self._path: Path | None = None
        self._known: WorldModel | None = None
        self._laid_out = (0.0, 0.0)
        self._on_path = OnPath(0.0, 0.0, 0.0)
        self._has_moved = False

    @property
    def path(self) -> Path | None:
        """The arc that is looked along now."""
        return self._path

    @property
    def on_path(self) -> OnPath:
        """Where the robot is on it."""
        return self._on_path

    def rest(self) -> None:
        """The chassis does not obey now: begin again from standstill."""
        self._shape.reset()
        self._motion = Wish(Kind.STAND)

    def step(
        self,
        now_ns: int,
        scene: Scene | None,
        requested: Twist | None,
        pose: PlanarPose,
        measured_mps: float = math.nan,
        silence: str = "no command",
        answer: Answer = ANSWERS,
    ) -> Governed:
        """What to command for one period from now_ns on.

        scene: the newest there is, in every step until a newer one comes. requested: what is asked for now;
        None: nothing, which means a jerk-limited stop, and silence says why. pose: of the body, by odometry.
        measured_mps: by the chassis. answer: whether it does what it is told.
        """
        wish = Wish(Kind.REFUSED, why=silence) if requested is None else understand(requested, self._robot)
        if pose.finite:
            self._look(scene, pose, now_ns)
        self._choose_motion(wish)
        decision = self._decided(scene, pose, measured_mps, now_ns)
        decision = self._as_asked(decision, wish, requested)
        return self._command(decision, answer)

    def _look(self, scene: Scene | None, pose: PlanarPose, now_ns: int) -> None:
        """Every scene is remembered once; one without a pose gets the one that the robot had then."""
        self._poses.append(now_ns, pose)
        self._ground.move(pose, now_ns)
        if not self._has_moved:
            self._ground.renew_consent(now_ns)
        if scene is None or (self._scenes and scene.captured_ns <= self._scenes[-1].captured_ns):
            return
        then = scene.robot_pose or self._poses.at(scene.captured_ns)
        if then is None or not then.finite or scene.captured_ns > now_ns:
            return
        if scene.health.condition is CameraCondition.UNTRUSTWORTHY:
            return  # the decision gets it and stops; nothing is learned of the ground
        try:
            check_scan(scene.free_space)
            bodies = bodies_of(scene, then, self._mount, self._decision.prediction.body_depth_m)
        except SceneError:
            return  # the decision says so and stops
        self._scenes.append(replace(scene, robot_pose=then))
        standing = self._shape.v_mps == 0.0
        self._ground.look(scene.free_space, then, scene.captured_ns, bodies.select(bodies.moving), standing)

    def _choose_motion(self, wish: Wish) -> None:
        """An arc may bend into another one while it is driven; between an arc and a turn in place, and
        between two directions of turning, the robot stands."""
        stands = self._shape.v_mps == 0.0 and self._shape.a_mps2 == 0.0
        if wish.kind is Kind.ARC and (stands or self._motion.kind is Kind.ARC):
            # Until its acceleration has come to nothing it still gets faster.
            more_mps = max(self._shape.a_mps2, 0.0) ** 2 / (2.0 * self._robot.limits.max_jerk_mps3)
            self._motion = driveable(wish, self._shape.v_mps + more_mps, self._robot)
        elif wish.kind is Kind.TURN and (
            stands or (self._motion.kind is Kind.TURN and self._motion.left == wish.left)
        ):
            self._motion = wish
        elif stands:
            self._motion = Wish(Kind.STAND)

    def _decided(self, scene: Scene | None, pose: PlanarPose, measured_mps: float, now_ns: int) -> Decision:
        """The mission's decision along the present motion, before it is compared with what is asked."""
        turns = self._motion.kind is Kind.TURN
        v_mps = 0.0 if turns else speed_to_decide_by(self._shape.v_mps, measured_mps)
        a_mps2 = 0.0 if turns else self._shape.a_mps2
        path = self._arc(pose)
        if scene is not None and self._scenes and scene.captured_ns == self._scenes[-1].captured_ns:
            scene = self._scenes[-1]
        decision = self._decide.step(Situation(scene, path, pose, self._on_path, v_mps, a_mps2, now_ns))
        if turns:
            return self._turn(decision, pose, now_ns)
        if self._motion.kind is Kind.ARC and decision.reason.rule != "fault":
            assert self._known is not None
            motion = Motion(v_mps, a_mps2, self._latency_s)
            near = near_limits(
                self._ground, self._known.corridor, self._on_path.s_m, self._near_m, motion,
                self._robot, self._decision, now_ns,
            )  # fmt: skip
            for limit in near:
                decision = self._least(decision, limit)
        return decision

    @property
    def _near_m(self) -> float:
        """Along the arc, from where it was laid out."""
        return self._ground.consent_m + _NEAR_EXTRA_M

    def _arc(self, pose: PlanarPose) -> Path:
        """The arc of the present motion; straight ahead where it is none. Laid out anew where it no longer
        fits: what was seen lately is then looked at again, along the new arc."""
        arc = self._motion.kind is Kind.ARC
        wanted = (self._motion.curvature_1pm, self._motion.speed_mps) if arc else (0.0, self._shape.v_mps)
        if not pose.finite:
            pose = PlanarPose(0.0, 0.0, 0.0) if self._path is None else self._path.start
        if self._path is not None:
            self._on_path = on = self._path.project(pose, self._on_path.s_m)
            fits = abs(on.d_m) <= _OFF_M and abs(on.heading_rad) <= _OFF_RAD and on.s_m <= _ALONG_M
            bends = abs(wanted[0] - self._laid_out[0]) <= _SAME_1PM
            if fits and bends and abs(wanted[1] - self._laid_out[1]) < _SAME_MPS:
                return self._path
        path = arc_path(pose, *wanted, self._decision.sight.range_m, self._robot)
        on_start = OnPath(0.0, 0.0, 0.0)
        before = self._known
        known = self._decide.world_model(path, _NEAR_EXTRA_M)
        for scene in self._scenes:
            assert scene.robot_pose is not None
            if before is None or before.has_taken_in(scene):
                known.update(scene, scene.robot_pose, on_start, self._shape.v_mps, scene.captured_ns)
        if before is not None:
            known.take_over(before)
        self._decide.take_path(path, known)
        self._path, self._known, self._laid_out, self._on_path = path, known, wanted, on_start
        return path

    def _turn(self, decision: Decision, pose: PlanarPose, now_ns: int) -> Decision:
        """A turn in place: of the decision ahead only the faults count. The camera's condition is asked for
        by itself: as the reason ahead, it may stand behind another limit that is lower for the moment."""
        assert self._known is not None
        if decision.reason.rule == "fault":
            return self._with(decision, 0.0, decision.reason, emergency=False)
        camera = condition_limit(self._known, self._decision.sight)
        if camera is not None and camera.speed_mps <= 0.0:
            return self._with(decision, 0.0, camera.reason, emergency=False)
        objection = f"{COVERED}: stop" if self._known.lens.covered else turn_objection(
            self._ground, self._known.bodies, pose, self._robot, self._decision,
            self._config.turn_memory_s, now_ns,
        )  # fmt: skip
        if objection:
            return self._with(decision, 0.0, Reason("turn", objection), emergency=True)
        speed_mps = self._motion.speed_mps
        if camera is not None and camera.speed_mps < speed_mps:
            return self._with(decision, camera.speed_mps, camera.reason, emergency=False)
        yaw_radps = self._motion.left * speed_mps / corner_m(self._robot)
        reason = Reason("requested", f"turns in place at {yaw_radps:.2f} rad/s")
        return self._with(decision, speed_mps, reason, emergency=False)

    def _least(self, decision: Decision, limit: Limit) -> Decision:
        """The decision under one more limit; what hardly lets the robot move does not let it start."""
        speed_mps = limit.speed_mps
        if speed_mps < self._decision.release.creep_mps:
            speed_mps = 0.0
        if speed_mps >= decision.target_speed_mps:
            return decision
        return self._with(decision, speed_mps, limit.reason, emergency=decision.emergency or limit.urgent)

    def _as_asked(self, decision: Decision, wish: Wish, requested: Twist | None) -> Decision:
        """Never faster than asked for; and the reason, if that is what holds it back."""
        stop = wish.kind in (Kind.STAND, Kind.REFUSED) or wish.kind is not self._motion.kind
        stop = stop or (wish.kind is Kind.TURN and wish.left != self._motion.left)
        if stop:
            return self._with(decision, 0.0, why_stop(wish, requested), emergency=decision.emergency)
        assert requested is not None
        if wish.kind is Kind.TURN:
            return decision
        target_mps = min(decision.target_speed_mps, wish.speed_mps)
        reason = decision.reason
        if reason.rule in ("free", "section"):
            reason = Reason(
                "requested", f"as asked: {requested.v_mps:.2f} m/s, {requested.w_radps:.2f} rad/s"
            )
            if target_mps < requested.v_mps - _SAME_MPS:
                sentence = (
                    f"asked {requested.v_mps:.2f} m/s; on this arc the robot drives {target_mps:.2f} m/s"
                )
                reason = Reason("robot", sentence)
        elif reason.rule == "target":
            reason = Reason("robot", f"such an arc is looked along only so far: {target_mps:.2f} m/s")
        return self._with(decision, target_mps, reason, emergency=decision.emergency)

    def _with(self, decision: Decision, target_mps: float, reason: Reason, *, emergency: bool) -> Decision:
        v, band = self._shape.v_mps, self._decision.release.dead_band_mps
        action = Action.KEEP
        if target_mps > v + band:
            action = Action.INCREASE
        elif target_mps < v - band or (target_mps == 0.0 and v > _STANDING_MPS):
            action = Action.DECREASE
        stuck_ns = decision.stuck_since_ns if reason is decision.reason else None
        return Decision(action, target_mps, reason, emergency and v > _STANDING_MPS, stuck_ns)

    def _command(self, decision: Decision, answer: Answer) -> Governed:
        turns = self._motion.kind is Kind.TURN
        target_mps = decision.target_speed_mps if turns else min(decision.target_speed_mps, answer.cap_mps)
        shaped = self._shape.step(target_mps, emergency=decision.emergency or answer.hard)
        self._has_moved = self._has_moved or shaped.v_mps > 0.0
        if turns:
            w_radps = self._motion.left * shaped.v_mps / corner_m(self._robot)
            return Governed(0.0, 0.0, w_radps, decision, shaped.fault)
        w_radps = self._motion.curvature_1pm * shaped.v_mps
        return Governed(shaped.v_mps, shaped.a_mps2, w_radps, decision, shaped.fault)
