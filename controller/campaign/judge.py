"""What a drive was like, measured against the truth."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from controller.campaign.drive import DriveLog
from controller.campaign.oracle import OracleTime
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarEye
from controller.decision import Action
from controller.profile import SpeedRamps
from hal.types import FloatArray, PlanarPose
from sim.planar import overlap, separation

AT_FAULT_MPS = 0.02
FLAP_REVERSALS, FLAP_S = 3, 2.0
# Between two control steps two bodies come no closer to each other than this.
_BETWEEN_STEPS_M = 0.15
_SUBSTEPS = 4
_STRIDE, _ROUNDING_M = 10, 1e-9
_STOPPED_MPS, _MOVING_AGAIN_MPS = 0.02, 0.1
_BEFORE_STOP_S, _AFTER_STOP_S = 4.0, 2.0
_AFTER_FAULT_S = 1.5
_SIGHT_STEPS = 5
_SEEN_MOVING_MPS = 0.1
_AVOIDING_S = 15.0


@dataclass(frozen=True, slots=True)
class Contact:
    """When and with whom it began, and how fast the robot was."""

    t_s: float
    body: int
    v_mps: float


@dataclass(frozen=True, slots=True)
class Row:
    """One line of missions.jsonl. time_s: until rest on the target, None if it was not reached.
    oracle_time_s: None if not even the oracle reaches it. expected: whether it should be reached at all."""

    family: str
    seed: int
    policy: str
    mode: str
    reached: bool
    expected: bool
    contacts: int
    contacts_at_fault: int
    touched: tuple[str, ...]
    time_s: float | None
    oracle_time_s: float | None
    min_clearance_m: float
    max_jerk_mps3: float
    max_accel_mps2: float
    reversals: int
    limit_violations: int
    false_stops: int
    flaps: int

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Yardstick:
    """What a drive is measured by: the oracle's time, the field of view, and how long the fastest reaction to
    something new takes (sightings, latency of perception, control period, lag of the chassis)."""

    oracle: OracleTime
    eye: PlanarEye
    reaction_s: float


def judge(stage: Stage, log: DriveLog, policy: str, mode: str, by: Yardstick) -> Row:
    """Everything that missions.jsonl says of a drive."""
    clearance = _Clearance(stage, log)
    contacts = clearance.contacts()
    case, tally = stage.case, log.setpoints
    at_fault = [one for one in contacts if _at_fault(one, stage, log, by.eye, by.reaction_s)]
    return Row(
        family=case.family,
        seed=case.seed,
        policy=policy,
        mode=mode,
        reached=log.reached_s is not None,
        expected=case.scenario.outcome == "target" and not case.halts,
        contacts=len(contacts),
        contacts_at_fault=len(at_fault),
        touched=tuple(stage.world.names[one.body] for one in at_fault),
        time_s=None if log.reached_s is None else round(log.reached_s, 4),
        oracle_time_s=round(by.oracle.total_s, 4) if math.isfinite(by.oracle.total_s) else None,
        min_clearance_m=round(clearance.least_m, 4),
        max_jerk_mps3=tally.max_jerk_mps3,
        max_accel_mps2=tally.max_accel_mps2,
        reversals=tally.reversals,
        limit_violations=tally.violations,
        false_stops=len(false_stops(stage, log)),
        flaps=flaps(log),
    )


def _furthest(moves: FloatArray) -> FloatArray:
    """(T,) the furthest of moves (T, K, 2)."""
    furthest: FloatArray = np.sqrt((moves * moves).sum(axis=2).max(axis=1))
    return furthest


class _Clearance:
    """Distances between the robot and all bodies at its height, over the whole drive."""

    def __init__(self, stage: Stage, log: DriveLog) -> None:
        self._stage, self._log = stage, log
        self._times = np.array(log.times_s)
        self._poses = log.pose_array()
        self.least_m = math.inf
        self._contacts: list[Contact] = []
        bodies = np.flatnonzero(stage.in_height).tolist()
        around = {body: self._around(body, self._times, self._poses) for body in bodies}
        # The nearest first: of the others, only what could come nearer still is looked at closely.
        for body in sorted(bodies, key=lambda body: float(around[body][1].min(initial=math.inf))):
            self._look_at(body, *around[body])

    def contacts(self) -> list[Contact]:
        """In the order of time."""
        return sorted(self._contacts, key=lambda one: (one.t_s, one.body))

    def _look_at(self, body: int, polygons: FloatArray, gap: FloatArray) -> None:
        gap = self._gap(polygons, gap, self._poses, _BETWEEN_STEPS_M)
        close = gap < _BETWEEN_STEPS_M
        if close.any():
            # Look between the steps as well where something could happen there.
            times, poses = self._between(close)
            between = self._gap(*self._around(body, times, poses), poses, math.inf)
            self._note(body, times, between)
            gap = np.append(gap, between)
        self.least_m = min(self.least_m, float(gap.min(initial=math.inf)))

    def _around(self, body: int, times: FloatArray, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The body's polygons (T, K, 2), and (T,) the distance of circles around it and the robot."""
        robot = self._stage.robot.body
        polygons = self._stage.world.over(times, body)
        middle = polygons.mean(axis=1)
        radius = np.sqrt(((polygons - middle[:, None]) ** 2).sum(axis=2).max(axis=1))
        reach = math.hypot(max(robot.front_m, robot.rear_m), 0.5 * robot.width_m)
        gap = np.hypot(middle[:, 0] - poses[:, 0], middle[:, 1] - poses[:, 1]) - radius - reach
        return polygons, gap

    def _gap(
        self, polygons: FloatArray, gap: FloatArray, poses: FloatArray, exact_below_m: float
    ) -> FloatArray:
        """(T,) distance; that of circles, gap, where they are further apart than what matters, and inf where
        something else is certainly nearer."""
        near = np.flatnonzero(gap < max(min(self.least_m, 2.0), min(exact_below_m, 2.0)))
        if not len(near):
            return gap
        robots, others = self._stage.robots(poses[near]), polygons[near]
        # Every tenth step first: until the next ones, neither corner of both comes nearer than it has moved.
        tenth = np.arange(len(near)) // _STRIDE * _STRIDE
        sampled = separation(robots[::_STRIDE], others[::_STRIDE])
        moved = _furthest(robots - robots[tenth]) + _furthest(others - others[tenth])
        at_least = sampled[tenth // _STRIDE] - moved
        matters = (
            at_least < max(min(self.least_m, float(sampled.min())), min(exact_below_m, 2.0)) + _ROUNDING_M
        )
        exact = np.flatnonzero(matters)
        gap[near] = np.inf
        gap[near[exact]] = separation(robots[exact], others[exact])
        return gap

    def _between(self, close: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        wide = close.copy()
        wide[:-1] |= close[1:]
        wide[1:] |= close[:-1]
        index = np.flatnonzero(wide[:-1] & wide[1:])
        share = np.arange(_SUBSTEPS) / _SUBSTEPS
        dt = self._times[index + 1] - self._times[index]
        times = (self._times[index, None] + share * dt[:, None]).ravel()
        step = self._poses[index + 1] - self._poses[index]
        poses = (self._poses[index, None] + share[:, None] * step[:, None]).reshape(-1, 3)
        return times, poses

    def _note(self, body: int, times: FloatArray, gap: FloatArray) -> None:
        """A contact counts when it begins; it is another one after half a second apart."""
        speeds = np.interp(times, self._times, np.array(self._log.v_mps))
        touching = np.flatnonzero(gap <= 0.0)
        last_s = -math.inf
        for k in touching.tolist():
            fresh = times[k] > last_s + 0.5
            last_s = float(times[k])
            if fresh:
                self._contacts.append(Contact(last_s, body, float(speeds[k])))


def _at_fault(contact: Contact, stage: Stage, log: DriveLog, eye: PlanarEye, reaction_s: float) -> bool:
    """Whether the robot moved, and a driver who knows the whole motion of what it has once seen moving (or
    standing, if it never moves) avoids it: with the same field of view, reaction_s and limits, by braking
    hard, by braking comfortably, by going on, or by speeding up."""
    if contact.v_mps <= AT_FAULT_MPS:
        return False
    seen = _first_seen(contact, stage, log, eye)
    if seen is None:
        return False
    limits = stage.robot.limits
    soft = (limits.max_accel_mps2, limits.max_jerk_mps3)
    hard = (limits.emergency_decel_mps2, limits.emergency_jerk_mps3)
    choices = ((0.0, *hard), (0.0, *soft), (log.v_mps[seen], *soft), (limits.max_speed_mps, *soft))
    return not all(
        _touches(contact.body, stage, log, seen, reaction_s, target, accel, jerk)
        for target, accel, jerk in choices
    )


def _first_seen(contact: Contact, stage: Stage, log: DriveLog, eye: PlanarEye) -> int | None:
    """The step at which what was touched could first be seen as what it is; None: not before the contact.

    It takes two looks, 0.1 s apart. Somebody who stood meanwhile is seen as what it is once it moves again:
    nobody sees in who stands that it will go on.
    """
    body, first, before = contact.body, None, None
    moves = bool(stage.world.moves[body])
    stage.world.foresee(np.array(log.times_s[::_SIGHT_STEPS]))
    for k in range(0, len(log.times_s), _SIGHT_STEPS):
        if log.times_s[k] >= contact.t_s:
            break
        polygons, velocity = stage.world.look(log.times_s[k])
        if moves and math.hypot(*velocity[body]) < _SEEN_MOVING_MPS:
            first = before = None
            continue
        if first is None:
            seen = _in_view(body, polygons, PlanarPose(*log.poses[k]), eye)
            first, before = (before if seen else None), (k if seen else None)
    return first


def _in_view(body: int, polygons: FloatArray, pose: PlanarPose, eye: PlanarEye) -> bool:
    view = eye.look(polygons, pose)
    row = np.flatnonzero(view.bodies == body)
    return bool(len(row) and np.isfinite(view.forward_m[row[0]]).any())


def _touches(
    body: int,
    stage: Stage,
    log: DriveLog,
    start: int,
    reaction_s: float,
    target_mps: float,
    accel_mps2: float,
    jerk_mps3: float,
) -> bool:
    """Whether a robot that goes over to target_mps reaction_s after step start touches the body."""
    t = np.arange(0.0, _AVOIDING_S, 0.02)
    ramp = SpeedRamps(
        log.v_mps[start],
        0.0,
        np.array([target_mps]),
        accel_mps2=accel_mps2,
        decel_mps2=accel_mps2,
        jerk_mps3=jerk_mps3,
        latency_s=reaction_s,
    )
    way, speed, _ = ramp.state(t[None])
    s = log.s_m[start] + way[0]
    moving = (speed[0] > AT_FAULT_MPS) & (s <= stage.path.length_m)
    if not moving.any():
        return False
    poses = stage.path_poses(s[moving])
    polygons = stage.world.over(log.times_s[start] + t[moving], body)
    return bool(overlap(stage.robots(poses), polygons).any())


def flaps(log: DriveLog) -> int:
    """How often the decision turned round between faster and slower three times within 2 s."""
    turns: list[float] = []
    last: Action | None = None
    for t_s, action in zip(log.times_s, log.actions, strict=True):
        if action is Action.KEEP:
            continue
        if last is not None and action is not last:
            turns.append(t_s)
        last = action
    count, k = 0, 0
    while k + FLAP_REVERSALS <= len(turns):
        if turns[k + FLAP_REVERSALS - 1] - turns[k] <= FLAP_S:
            count += 1
            k += FLAP_REVERSALS
        else:
            k += 1
    return count


def false_stops(stage: Stage, log: DriveLog) -> list[float]:
    """When it came to rest before its target though nothing was on the floor that it was about to sweep,
    from some seconds before until it went on; stops for a fault of camera or chassis are right."""
    v = np.array(log.v_mps)
    found = []
    for start, end in _stops(v):
        if log.reached_s is not None and end >= len(v) - 1:
            continue
        t0, t1 = log.times_s[start] - _BEFORE_STOP_S, log.times_s[end] + _AFTER_STOP_S
        if stage.case.faults.strikes(log.times_s[start], _AFTER_FAULT_S):
            continue
        if stage.case.faults.glass and stage.case.scenario.outcome == "blocked":
            continue
        times = np.arange(max(t0, 0.0), t1, 0.2)
        s_m = log.s_m[start]
        ahead = any(high >= s_m for stretches in stage.blocked(times) for _, high in stretches)
        if not ahead:
            found.append(log.times_s[start])
    return found


def _stops(v: FloatArray) -> list[tuple[int, int]]:
    """(from, to) steps of standing between driving, or at the end; standing at the start is none."""
    stops, driving, start = [], False, 0
    for k, speed in enumerate(v.tolist()):
        if driving and speed < _STOPPED_MPS:
            driving, start = False, k
            stops.append((start, len(v) - 1))
        elif not driving and speed > _MOVING_AGAIN_MPS:
            driving = True
            if stops:
                stops[-1] = (start, k)
    return stops
