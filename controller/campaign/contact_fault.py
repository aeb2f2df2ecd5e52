"""Whether a contact was the driver's fault: a reference driver with the same view and brakes avoids it."""

from __future__ import annotations

import math

import numpy as np

from controller.campaign.contacts import Contact
from controller.campaign.drive_log import DriveLog
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarCamera
from controller.profile import SpeedRamps
from hal.types import FloatArray, PlanarPose
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
    limits = stage.robot.limits
    soft = (limits.max_accel_mps2, limits.max_jerk_mps3)
    hard = (limits.emergency_decel_mps2, limits.emergency_jerk_mps3)
    blind_s = stage.case.faults.blind_since(contact.t_s, reaction_s)
    if blind_s is not None:
        last, delay_s = int(np.searchsorted(log.times_s, blind_s)), _BLIND_TIMEOUT_S + reaction_s
        if not _would_touch(contact.body, stage, log, last, delay_s, 0.0, *hard):
            return True  # It drove on blind.
    seen = _first_seen(contact, stage, log, planar_camera)
    if seen is None:
        return False
    reaction_s += stage.case.faults.late_by(log.times_s[seen])
    manoeuvres = ((0.0, *hard), (0.0, *soft), (log.v_mps[seen], *soft), (limits.max_speed_mps, *soft))
    return not all(
        _would_touch(contact.body, stage, log, seen, reaction_s, target, accel, jerk)
        for target, accel, jerk in manoeuvres
    )


def _first_seen(contact: Contact, stage: Stage, log: DriveLog, planar_camera: PlanarCamera) -> int | None:
    """The step at which the motion of the touched body could first be seen; None: not before the contact.

    Two looks are needed, 0.1 s apart. If a mover stands still in between, this starts anew once it moves
    again, because its next motion cannot be seen while it stands. If it stands until the contact, there is no
    next motion.
    """
    body, first, previous = contact.body, None, None
    looks = [k for k in range(0, len(log.times_s), _STEPS_PER_LOOK) if log.times_s[k] < contact.t_s]
    stage.world.precompute(np.array(log.times_s[::_STEPS_PER_LOOK]))
    moved = [_moves(stage, body, log.times_s[k]) for k in looks]
    last_moved = max((k for k, moves in zip(looks, moved, strict=True) if moves), default=-1)
    for k, moves in zip(looks, moved, strict=True):
        polygons, _ = stage.world.snapshot(log.times_s[k])
        if not moves and k < last_moved:
            first = previous = None
            continue
        if stage.case.faults.blind_since(log.times_s[k]) is not None:
            previous = None
            continue
        if first is None:
            seen = _in_view(body, polygons, PlanarPose(*log.poses[k]), planar_camera)
            first, previous = (previous if seen else None), (k if seen else None)
    return first


def _moves(stage: Stage, body: int, t_s: float) -> bool:
    _, velocity = stage.world.snapshot(t_s)
    return math.hypot(*velocity[body]) >= _SEEN_MOVING_MPS


def _in_view(body: int, polygons: FloatArray, pose: PlanarPose, planar_camera: PlanarCamera) -> bool:
    view = planar_camera.look(polygons, pose)
    row = np.flatnonzero(view.bodies == body)
    return bool(len(row) and np.isfinite(view.forward_m[row[0]]).any())


def _would_touch(
    body: int,
    stage: Stage,
    log: DriveLog,
    start: int,
    reaction_s: float,
    target_mps: float,
    accel_mps2: float,
    jerk_mps3: float,
) -> bool:
    """Whether a robot that changes its speed to target_mps, reaction_s after step start, touches the body. It
    starts with the speed and acceleration of the real robot: an accelerating robot needs longer to brake."""
    earlier = max(start - _STEPS_PER_LOOK, 0)
    elapsed_s = log.times_s[start] - log.times_s[earlier]
    gain_mps = log.v_mps[start] - log.v_mps[earlier]
    t = np.arange(0.0, _HORIZON_S, _STEP_S)
    ramp = SpeedRamps(
        log.v_mps[start],
        gain_mps / elapsed_s if elapsed_s > 0.0 else 0.0,
        np.array([target_mps]),
        accel_mps2=accel_mps2,
        decel_mps2=accel_mps2,
        jerk_mps3=jerk_mps3,
        latency_s=reaction_s,
    )
    travel, speed, _ = ramp.state(t[None])
    s = log.s_m[start] + travel[0]
    moving = (speed[0] > AT_FAULT_MPS) & (s <= stage.path.length_m)
    if not moving.any():
        return False
    poses = stage.path_poses(s[moving])
    polygons = stage.world.sample(log.times_s[start] + t[moving], body)
    return bool(overlap(stage.robot_polygons(poses), polygons).any())
