"""Whether a contact was the driver's fault: a reference driver with the same view and brakes avoids it."""

from __future__ import annotations

import math

import numpy as np

from controller import braking
from controller.braking import BrakeLimits
from controller.campaign.contacts import Contact
from controller.campaign.drive_log import DriveLog
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarCamera
from controller.profile import SpeedRamps
from hal.types import PlanarPose
from sim.polygons import overlap

AT_FAULT_MPS = 0.02  # a slower robot stands: what touches it then has come by itself
_STEPS_PER_LOOK = 5  # 0.1 s between two looks, at the usual 50 control steps a second
# The reference driver sees a faster body move; the policies need 0.15 m/s (NoiseModel).
_SEEN_MOVING_MPS = 0.1
# For so long each manoeuvre is followed: a comfortable stop from 1.5 m/s takes 5.5 s, and driving past all
# that the camera sees some ten.
_HORIZON_S, _STEP_S = 15.0, 0.02
# The reference driver brakes hard after this time without a new image: the default of sight.blind_s.
_BLIND_TIMEOUT_S = 0.6


def at_fault(
    contact: Contact, stage: Stage, log: DriveLog, planar_camera: PlanarCamera, reaction_s: float
) -> bool:
    """Whether the robot moved at the contact, and a reference driver avoids the contact.

    The reference driver has the same field of view, reaction_s and limits. It knows the whole motion of a
    body as soon as it has seen the body moving (or standing, if it stands until the contact). It brakes hard,
    brakes comfortably, goes on, or speeds up. Faults of the mission that blind the robot or delay its scenes
    affect the reference driver in the same way; it brakes hard once it has been blind for some time.
    """
    if contact.v_mps <= AT_FAULT_MPS:
        return False
    faults, limits = stage.case.faults, stage.robot.limits
    driver = _ReferenceDriver(contact.body, stage, log)
    soft, hard = braking.comfort(limits), braking.emergency(limits)
    blind_s = faults.blind_since(contact.t_s, reaction_s)
    if blind_s is not None:
        last, delay_s = int(np.searchsorted(log.times_s, blind_s)), _BLIND_TIMEOUT_S + reaction_s
        if not driver.would_touch(last, delay_s, 0.0, hard):
            return True  # It drove on blind.
    seen = driver.first_sees_motion(planar_camera, contact.t_s)
    if seen is None:
        return False
    reaction_s += faults.late_by(log.times_s[seen])
    manoeuvres = ((0.0, hard), (0.0, soft), (log.v_mps[seen], soft), (limits.max_speed_mps, soft))
    return not all(
        driver.would_touch(seen, reaction_s, target_mps, bounds) for target_mps, bounds in manoeuvres
    )


class _ReferenceDriver:
    """Takes over the robot of a drive at one of its control steps, with a body that may be touched."""

    def __init__(self, body: int, stage: Stage, log: DriveLog) -> None:
        self._body, self._stage, self._log = body, stage, log

    def first_sees_motion(self, planar_camera: PlanarCamera, contact_s: float) -> int | None:
        """The step at which the body's motion could first be seen; None: not before the contact.

        Two looks are needed, 0.1 s apart. If a mover stands still in between, this starts anew once it moves
        again, because its next motion cannot be seen while it stands. If it stands until the contact, there
        is no next motion.
        """
        times_s, world = self._log.times_s, self._stage.world
        first, previous = None, None
        looks = [k for k in range(0, len(times_s), _STEPS_PER_LOOK) if times_s[k] < contact_s]
        world.precompute(np.array(times_s[::_STEPS_PER_LOOK]))
        moved = [self._moves(times_s[k]) for k in looks]
        last_moved = max((k for k, moves in zip(looks, moved, strict=True) if moves), default=-1)
        for k, moves in zip(looks, moved, strict=True):
            if not moves and k < last_moved:
                first = previous = None
                continue
            if self._stage.case.faults.blind_since(times_s[k]) is not None:
                previous = None
                continue
            if first is None:
                seen = self._in_view(k, planar_camera)
                first, previous = (previous if seen else None), (k if seen else None)
        return first

    def would_touch(self, start: int, reaction_s: float, target_mps: float, limits: BrakeLimits) -> bool:
        """Whether the robot touches the body if it goes to target_mps, beginning reaction_s after step start.

        It starts with the speed and acceleration of the real robot: an accelerating robot needs longer to
        brake.
        """
        log, stage = self._log, self._stage
        earlier = max(start - _STEPS_PER_LOOK, 0)
        elapsed_s = log.times_s[start] - log.times_s[earlier]
        gain_mps = log.v_mps[start] - log.v_mps[earlier]
        accel_mps2 = gain_mps / elapsed_s if elapsed_s > 0.0 else 0.0
        ramp = SpeedRamps(log.v_mps[start], accel_mps2, np.array([target_mps]), limits, latency_s=reaction_s)
        t = np.arange(0.0, _HORIZON_S, _STEP_S)
        travel, speed, _ = ramp.state(t[None])
        s = log.s_m[start] + travel[0]
        moving = (speed[0] > AT_FAULT_MPS) & (s <= stage.path.length_m)
        if not moving.any():
            return False
        poses = stage.path_poses(s[moving])
        polygons = stage.world.sample(log.times_s[start] + t[moving], self._body)
        return bool(overlap(stage.robot_polygons(poses), polygons).any())

    def _moves(self, t_s: float) -> bool:
        _, velocity = self._stage.world.snapshot(t_s)
        return math.hypot(*velocity[self._body]) >= _SEEN_MOVING_MPS

    def _in_view(self, k: int, planar_camera: PlanarCamera) -> bool:
        """Whether the body is in the view of the camera at step k."""
        polygons, _ = self._stage.world.snapshot(self._log.times_s[k])
        view = planar_camera.look(polygons, PlanarPose(*self._log.poses[k]))
        row = np.flatnonzero(view.bodies == self._body)
        return bool(len(row) and np.isfinite(view.forward_m[row[0]]).any())
