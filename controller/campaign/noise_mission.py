"""A mission without renderer and buses: noisy scenes, the real decision and shaper, a base with lag.

The robot stays within a centimetre or two of its path (path tracking is tested elsewhere). Along the path,
the base follows the commanded speed with the lag of sim.plant, and the odometry has a small error.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from config.app import AppConfig, LockstepRunner, SimulationConfig
from config.camera import SimulatedCameraConfig
from controller.campaign.drive_log import DriveLog
from controller.campaign.noisy_camera import NoisyCamera
from controller.campaign.stage import Stage
from controller.control import ARRIVED_M, Decides
from controller.decision.decision import Decision
from controller.decision.situation import Situation
from controller.path.path import OnPath
from controller.record.tally import SetpointTally
from controller.shape import SpeedShaper
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import FloatArray, PlanarPose, Setpoint
from sim.plant import PLANT_REST_MPS, Track
from vision.scene import CameraCondition, CameraHealth, Scene

# If the robot still stands this long after everything else has come to rest, it will stand for ever.
GIVE_UP_S = 6.0
# The lateral offset that path tracking leaves (a centimetre or two), and how slowly it changes.
_OFFSET_SIGMA_M, _OFFSET_TIME_CONSTANT_S = 0.01, 2.0
_ODOMETRY_SIGMA = 0.003  # relative error of its distance: 6 cm on 20 m
_FEEDBACK_TIMEOUT_S = 0.2  # the default of chassis.feedback_timeout_ms
_FROZEN_FRAMES = 2  # as in vision/camera/health.py
_ROUNDING_S = 1e-9  # of times that are multiples of a period


@compiled("int64, float64, float64")
def _exposure_times(steps: int, dt_s: float, fps: float) -> FloatArray:
    """The times of the control steps, of steps in total, at which a frame is exposed."""
    times, count = np.empty(steps), 0
    for k in range(steps):
        if count / fps <= k * dt_s + _ROUNDING_S:
            times[count] = k * dt_s
            count += 1
    return times[:count]


class _DelayedCamera:
    """The camera with its faults, and the delay of its scenes until the decision."""

    def __init__(self, camera: NoisyCamera, stage: Stage, fps: float, latency_s: float) -> None:
        self._camera, self._faults = camera, stage.case.faults
        self._fps, self._latency_s = fps, latency_s
        self._frame = 0
        self._repeats = 0
        self._last: Scene | None = None
        self._in_transit: deque[tuple[float, Scene]] = deque()
        self.known: Scene | None = None

    def due(self, t_s: float) -> bool:
        """Whether the next frame is exposed at this control step."""
        return self._frame / self._fps <= t_s + _ROUNDING_S

    def expose(self, t_s: float, true_pose: PlanarPose, odometry_pose: PlanarPose) -> None:
        """Expose one frame. odometry_pose: the pose by odometry."""
        faults = self._faults
        self._frame += 1
        if faults.is_silent(t_s):
            return
        if faults.is_frozen(t_s) and self._last is not None:
            scene = self._repeat_scene(self._last, t_s)
        else:
            self._repeats = 0
            scene = self._camera.look(t_s, self._frame, true_pose, odometry_pose)
        self._last = scene
        self._in_transit.append((t_s + self._latency_s + faults.late_by(t_s), scene))

    def _repeat_scene(self, last: Scene, t_s: float) -> Scene:
        """The same image with a new stamp, judged as by vision/camera/health.py."""
        self._repeats += 1
        health = last.health
        if self._repeats >= _FROZEN_FRAMES:
            reason = f"image has not changed by a single grey level for {self._repeats} frames"
            health = CameraHealth(CameraCondition.UNTRUSTWORTHY, reason, health.valid_depth_ratio)
        return replace(last, captured_ns=round(t_s * NS_PER_S), sequence=self._frame, health=health)

    def newest_scene(self, t_s: float) -> Scene | None:
        while self._in_transit and self._in_transit[0][0] <= t_s + _ROUNDING_S:
            self.known = self._in_transit.popleft()[1]
        return self.known


def drive_noise(stage: Stage, config: AppConfig, policy: Decides) -> DriveLog:
    """Drive from rest at the start until rest at the target, or until nothing more will happen."""
    return _NoiseDrive(stage, config, policy).run()


class _NoiseDrive:
    """One drive of a robot with a relative error of its odometry, and a lateral error of a centimetre or
    two."""

    def __init__(self, stage: Stage, config: AppConfig, policy: Decides) -> None:
        assert isinstance(config.camera, SimulatedCameraConfig)
        assert isinstance(config.runner, LockstepRunner)
        plant = (config.simulation or SimulationConfig(scenario=stage.case.family)).plant
        seed, fps = stage.case.seed, config.camera.fps
        self._stage, self._policy, self._faults = stage, policy, stage.case.faults
        self._dt_s = 1.0 / config.runner.control_rate_hz
        random = np.random.default_rng((seed, 0xB0))
        scale_error = _ODOMETRY_SIGMA * float(random.standard_normal())
        self._odometry_scale = 1.0 + (self._faults.distance_slip or 0.0) + scale_error
        steps = math.ceil(stage.case.scenario.duration_s / self._dt_s)
        self._lateral_offsets_m = _lateral_noise(random.standard_normal(steps + 1)[:-1], self._dt_s)
        self._camera_link = _DelayedCamera(
            NoisyCamera(stage, config.camera, seed), stage, fps, config.runner.perception_latency_s
        )
        self._plant, self._base = plant, Track()
        self._shaper = SpeedShaper(config.robot.limits, self._dt_s, config.decision.chassis_delay_s)
        self._log = DriveLog(SetpointTally(config.robot.limits, self._dt_s))
        self._standing_s = 0.0
        stage.world.precompute(_exposure_times(steps, self._dt_s, fps))

    def run(self) -> DriveLog:
        """Run control steps until the drive is over."""
        for k, offset_m in enumerate(self._lateral_offsets_m.tolist()):
            t_s = k * self._dt_s
            pose = self._stage.pose(self._base.travel_m, offset_m)
            decision = self._decide(t_s, pose, offset_m)
            self._log.add(t_s, pose, self._base.travel_m, self._base.speed_mps, decision)
            self._move(t_s, decision)
            if self._is_over(t_s):
                break
        return self._log

    @property
    def _odometry_s_m(self) -> float:
        """The position along the path by odometry."""
        return self._base.travel_m * self._odometry_scale

    def _decide(self, t_s: float, pose: PlanarPose, offset_m: float) -> Decision:
        """The decision of one control step. pose: the true one; the policy gets the pose by odometry."""
        odometry_s_m = self._odometry_s_m
        odometry_pose = self._stage.pose(odometry_s_m, offset_m)
        if self._camera_link.due(t_s):
            self._camera_link.expose(t_s, pose, odometry_pose)
        return self._policy.step(
            Situation(
                scene=self._camera_link.newest_scene(t_s),
                path=self._stage.path,
                pose=odometry_pose,
                on_path=OnPath(odometry_s_m, offset_m, 0.0),
                v_mps=max(self._shaper.v_mps, self._base.speed_mps),
                a_mps2=self._shaper.a_mps2,
                now_ns=round(t_s * NS_PER_S),
            )
        )

    def _move(self, t_s: float, decision: Decision) -> None:
        if self._has_lost_feedback(t_s):
            # The driver has stopped the base (hal/chassis/arming.py); only consent would end that.
            self._advance_base(0.0)
            return
        shaped = self._shaper.step(
            decision.target_speed_mps,
            emergency=decision.emergency,
            distance_to_end_m=self._stage.path.length_m - self._odometry_s_m,
        )
        self._log.setpoints.add(Setpoint(round(t_s * NS_PER_S), shaped.v_mps, shaped.a_mps2, 0.0))
        self._advance_base(shaped.v_mps)

    def _advance_base(self, command_mps: float) -> None:
        self._base.target_mps = command_mps
        self._base.advance(self._dt_s, self._plant.lag_s, self._plant.max_accel_mps2)

    def _has_lost_feedback(self, t_s: float) -> bool:
        lost_s = self._faults.feedback_lost_s
        return lost_s is not None and t_s >= lost_s + _FEEDBACK_TIMEOUT_S

    def _is_over(self, t_s: float) -> bool:
        """Whether the robot is at rest, and on the target, stopped for good, or given up."""
        if self._base.speed_mps >= PLANT_REST_MPS:
            self._standing_s = 0.0
            return False
        self._standing_s += self._dt_s
        if self._has_lost_feedback(t_s):
            return True
        if self._shaper.v_mps == 0.0 and self._stage.path.length_m - self._odometry_s_m <= ARRIVED_M:
            self._log.reached_s = t_s + self._dt_s
            return True
        return self._standing_s >= GIVE_UP_S and t_s > max(self._stage.world.end_s, 0.0) + GIVE_UP_S


@compiled("float64[:], float64")
def _lateral_noise(white_noise: FloatArray, dt_s: float) -> FloatArray:
    """The lateral offset of the robot from its path at each control step (N,): white noise, low-pass
    filtered."""
    decay = math.exp(-dt_s / _OFFSET_TIME_CONSTANT_S)
    noise_m = _OFFSET_SIGMA_M * math.sqrt(1.0 - decay * decay)
    offset_m, offsets_m = 0.0, np.empty(len(white_noise))
    for k in range(len(white_noise)):
        offset_m = decay * offset_m + noise_m * white_noise[k]
        offsets_m[k] = offset_m
    return offsets_m
