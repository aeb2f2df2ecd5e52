"""Scene, path and state -> Decision: how fast to go now, and why.

Each control step collects all limits of the speed and takes the least: from the path (path_limit.py), the
camera (camera_limits.py), obstacles and depth (speed_limits.py). An increase is delayed, a decrease is not
(release.py). Input that cannot be relied on leads to a jerk-limited stop.
"""

from __future__ import annotations

import math
from dataclasses import replace
from operator import attrgetter

from config.decision import DecisionConfig
from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from config.robot import Robot
from controller import braking
from controller.decision.camera_limits import CameraLimits
from controller.decision.decision import Action, Decision, Reason
from controller.decision.limits import (
    BLOCKING_RULES,
    LEAST_TOLD_MPS,
    STANDING_MPS,
    STANDING_RULES,
    Limit,
    Motion,
    min_start_mps,
)
from controller.decision.path_limit import path_limit
from controller.decision.release import ReleaseGate, StartDelay
from controller.decision.situation import BACKWARDS_MPS, Situation
from controller.decision.speed_limits import SpeedLimits
from controller.decision.world_model import WorldModel
from controller.path.path import OnPath, Path
from hal.clocks import NS_PER_S
from hal.types import CameraMount

# Emergency braking goes on until the speed exceeds what is allowed by no more than this.
_EMERGENCY_EXIT_MPS = 0.05
_AT_END_M = 0.02  # the robot is at its target
_speed_of, _urgent = attrgetter("speed_mps"), attrgetter("urgent")


class DecisionMaker:
    """Makes one decision a control step. Keeps what hysteresis and memory need; calls no clock.

    mount: of the camera. period_s: control period. noise: of the camera's depth.
    """

    def __init__(
        self,
        config: DecisionConfig,
        robot: Robot,
        mount: CameraMount,
        period_s: float,
        noise: DepthNoise = TYPICAL_DEPTH_NOISE,
    ) -> None:
        self._config, self._robot, self._mount, self._noise = config, robot, mount, noise
        self._comfort = braking.comfort(robot.limits)
        self._latency_s = period_s + config.chassis_delay_s
        self._path: Path | None = None
        self._known: WorldModel | None = None
        self._camera_limits = CameraLimits(config, robot, mount, self._latency_s)
        self._speed_limits = SpeedLimits(config, robot.limits)
        self._gate, self._start_delay = ReleaseGate(config.release), StartDelay()
        self._now_ns: int | None = None
        self._emergency = False
        self._stuck_since_ns: int | None = None
        self._last_limiting: Reason | None = None

    def continue_along(self, path: Path, known: WorldModel) -> None:
        """Continue along another path, of which known is known already; the hysteresis is kept."""
        self._path, self._known = path, known

    def new_world_model(self, path: Path, start_s_m: float) -> WorldModel:
        """A new WorldModel of a path of which nothing is known yet, for a robot that stands at start_s_m."""
        return WorldModel(path, self._robot, self._mount, self._config, start_s_m, self._noise)

    def step(self, at: Situation) -> Decision:
        """The decision for at.now_ns."""
        before_ns, self._now_ns = self._now_ns, at.now_ns
        fault = self._input_fault(at, before_ns)
        if fault:
            return self._halt(fault, at.v_mps, at.now_ns)
        path, on_path, v_mps, now_ns = at.path, at.on_path, max(at.v_mps, 0.0), at.now_ns
        known = self._model_of(path, on_path)
        known.update(at.scene, at.pose, on_path, v_mps, now_ns)
        if not known.has_seen:
            # The release gate is not stepped: the first scene with a free way lets the robot go at once.
            reason = Reason("camera", f"{known.fault}: stop")
            return Decision(self._action(0.0, v_mps), 0.0, reason)
        motion = Motion(v_mps, at.a_mps2, self._latency_s)
        on_way = path_limit(path, on_path, motion, self._robot.limits.max_speed_mps, self._comfort)
        limits = self._camera_limits.limits(known)
        base_mps = min(on_way.speed_mps, _least(limits).speed_mps)
        limits += self._speed_limits.limits(known, on_path.s_m, motion, base_mps, now_ns / NS_PER_S)
        return self._conclude(on_way, limits, motion, now_ns)

    def _input_fault(self, at: Situation, before_ns: int | None) -> str:
        """Why the inputs cannot be relied on; "" if they can. before_ns: time of the step before."""
        pose, on_path, v_mps, now_ns = at.pose, at.on_path, at.v_mps, at.now_ns
        if before_ns is not None and now_ns < before_ns:
            return f"time went back by {(before_ns - now_ns) / NS_PER_S:.3f} s"
        on_floor = pose.x_m + pose.y_m + pose.heading_rad
        along = on_path.s_m + on_path.d_m + on_path.heading_rad
        if not math.isfinite(on_floor + along + v_mps + at.a_mps2):
            return _unknown(on_floor, along)
        if v_mps < BACKWARDS_MPS:
            return f"the robot moves backwards at {-v_mps:.2f} m/s"
        if abs(on_path.d_m) > self._config.off_path_m:
            return f"the robot is {abs(on_path.d_m):.2f} m beside its path"
        return ""

    def _halt(self, fault: str, v_mps: float, now_ns: int) -> Decision:
        """The decision to stop, whatever the scene: the inputs cannot be relied on."""
        v = v_mps if math.isfinite(v_mps) else 0.0
        self._gate.step(0.0, v, 0.0, now_ns)
        self._stuck_since_ns = None
        reason = Reason("fault", f"{fault}: stop")
        self._last_limiting = reason
        action = Action.DECREASE if abs(v) > STANDING_MPS else Action.KEEP
        return Decision(action, 0.0, reason, self._emergency)

    def _model_of(self, path: Path, on_path: OnPath) -> WorldModel:
        """What is known along this path: a new model if it is another path than before."""
        if self._known is None or path is not self._path:
            self.continue_along(path, self.new_world_model(path, on_path.s_m))
        assert self._known is not None
        return self._known

    def _conclude(self, on_way: Limit, limits: list[Limit], motion: Motion, now_ns: int) -> Decision:
        least = _least(limits)
        allowed_mps = self._start_or_creep(least, motion)
        gated_mps = self._gated_mps(allowed_mps, least, on_way, motion, now_ns)
        target_mps = min(gated_mps, on_way.speed_mps)
        reason = self._reason(allowed_mps, gated_mps, least, on_way, motion)
        self._emergency = self._brakes_hard(limits, min(allowed_mps, on_way.speed_mps), motion)
        self._note_stuck(target_mps, motion, reason, now_ns)
        action = self._action(target_mps, motion.v_mps)
        brakes_for_target = motion.a_mps2 < 0.0 or reason.distance_m <= _AT_END_M
        if action is Action.INCREASE and reason.rule == "target" and brakes_for_target:
            # A speed that is higher only by the slack of the target's limit is no increase.
            action = Action.KEEP
        return Decision(action, target_mps, reason, self._emergency, self._stuck_since_ns)

    def _gated_mps(
        self, allowed_mps: float, least: Limit, on_way: Limit, motion: Motion, now_ns: int
    ) -> float:
        """What start delay and release gate pass on of allowed_mps, the speed that least allows now."""
        blocked = allowed_mps <= 0.0
        waits = self._start_delay.step(blocked, blocked and least.reason.rule in STANDING_RULES, now_ns)
        let_go_mps = max(motion.v_mps - motion.a_mps2**2 / (2.0 * self._comfort.jerk_mps3), 0.0)
        # Something that comes and goes does not stop a robot that still rolls, but lets it get no faster.
        rolling_mps = let_go_mps if let_go_mps >= self._config.release.creep_mps else 0.0
        released_mps = min(allowed_mps, rolling_mps if waits else self._robot.limits.max_speed_mps)
        return self._gate.step(released_mps, motion.v_mps, let_go_mps, now_ns, on_way.speed_mps)

    def _start_or_creep(self, limit: Limit, motion: Motion) -> float:
        """The limit's speed, or 0 if it is too low to go for and something blocks the way.

        The robot does not creep up to an obstacle, and does not start for a short free distance.
        """
        release, standing = self._config.release, motion.v_mps <= STANDING_MPS
        least = min_start_mps(release, self._comfort) if standing else release.creep_mps
        if limit.speed_mps >= least:
            return limit.speed_mps
        rule = limit.reason.rule
        if rule not in BLOCKING_RULES:
            return limit.speed_mps
        if standing and rule == "worst case":
            # Such a body is beside the way. One that keeps clear is passed at beside_mps, so that speed is
            # enough to start, too.
            least = min(least, max(release.creep_mps, self._config.prediction.beside_mps))
        return limit.speed_mps if limit.speed_mps >= least else 0.0

    def _reason(
        self, allowed_mps: float, gated_mps: float, least: Limit, on_way: Limit, motion: Motion
    ) -> Reason:
        """The reason for the target, which is gated_mps or what the path allows.

        Notes what limits the speed: while the release gate holds the target back, that is told.
        """
        limiting: Reason | None = None
        if allowed_mps < min(self._robot.limits.max_speed_mps, on_way.speed_mps):
            self._last_limiting = limiting = _reason_for(least, allowed_mps)
        if on_way.speed_mps <= gated_mps:
            return on_way.reason
        limiting = limiting or _reason_for(least, allowed_mps)
        if gated_mps >= allowed_mps or self._last_limiting is None:
            return limiting
        return _reason_to_wait(self._last_limiting, limiting, gated_mps, motion)

    def _brakes_hard(self, limits: list[Limit], allowed_mps: float, motion: Motion) -> bool:
        """Whether to brake harder than comfort: from an urgent limit on until the speed is allowed again.

        allowed_mps: what is allowed now, without the delay of the release gate.
        """
        if motion.v_mps <= STANDING_MPS:
            return False
        if self._emergency and motion.v_mps > allowed_mps + _EMERGENCY_EXIT_MPS:
            return True
        return any(map(_urgent, limits))

    def _note_stuck(self, target_mps: float, motion: Motion, reason: Reason, now_ns: int) -> None:
        blocked = reason.rule in BLOCKING_RULES or reason.rule == "release"
        if motion.v_mps > STANDING_MPS or target_mps > 0.0 or not blocked:
            self._stuck_since_ns = None
        elif self._stuck_since_ns is None:
            self._stuck_since_ns = now_ns

    def _action(self, target_mps: float, v_mps: float) -> Action:
        band = self._config.release.dead_band_mps
        if target_mps > v_mps + band:
            return Action.INCREASE
        stopping = target_mps == 0.0 and v_mps > STANDING_MPS
        if target_mps < v_mps - band or stopping:
            return Action.DECREASE
        return Action.KEEP


def _unknown(on_floor: float, along: float) -> str:
    """Which input is not finite. on_floor: sum of the pose; along: sum of the path coordinates."""
    if not math.isfinite(on_floor):
        return "the robot's pose is not known"
    if not math.isfinite(along):
        return "the robot's position on its path is not known"
    return "the robot's speed is not known"


def _reason_to_wait(last: Reason, now: Reason, gated_mps: float, motion: Motion) -> Reason:
    """The reason while the release gate holds the target back: what last limited the speed.

    Distances are those of the least limit now.
    """
    if gated_mps > 0.0:
        waits = f"not faster than {gated_mps:.2f} m/s yet"
    else:
        waits = "not starting yet" if motion.v_mps <= STANDING_MPS else "still stopping"
    return replace(
        now,
        rule="release",
        sentence=f"{waits}; last limit: {last.sentence}",
        obstacle_id=last.obstacle_id,
    )


def _reason_for(limit: Limit, speed_mps: float) -> Reason:
    """The limit's reason, if speed_mps is what remains of the limit."""
    reason = limit.reason
    if speed_mps < limit.speed_mps and limit.speed_mps >= LEAST_TOLD_MPS:
        return replace(reason, sentence=f"{reason.sentence}, too slow to drive")
    return reason


def _least(limits: list[Limit]) -> Limit:
    """The least limit; the first one of equal ones."""
    return min(limits, key=_speed_of)
