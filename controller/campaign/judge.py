"""The results of a drive, measured against the ground truth."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from controller.campaign.contact_fault import at_fault
from controller.campaign.contacts import DriveClearance
from controller.campaign.drive_log import DriveLog
from controller.campaign.oracle import OracleTime
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarCamera
from controller.decision.decision import Action
from hal.types import FloatArray

# A flap: this many changes between faster and slower within this time.
FLAP_REVERSALS, FLAP_S = 3, 2.0
_STOPPED_MPS, _MOVING_AGAIN_MPS = 0.02, 0.1  # as in Nav2's bag metrics (stop_and_go.py)
# An obstacle justifies a stop if it is in the way at any time from this long before to this long after it:
# a comfortable stop takes up to 5.5 s, and a robot goes on a second or two after its way is free.
_BEFORE_STOP_S, _AFTER_STOP_S = 4.0, 2.0
_WAY_STEP_S = 0.2  # how often the way is looked at within that time
# A fault justifies a stop for this long after its end: new scenes have to arrive, and the speed rises late.
_AFTER_FAULT_S = 1.5


@dataclass(frozen=True, slots=True)
class Row:
    """One line of missions.jsonl.

    expected: whether the target should be reached at all.
    touched: names of the bodies of contacts at fault.
    touched_not_at_fault, touched_at_mps: names of the bodies of the other contacts, and the robot's speed at
        each. Rows of earlier versions have neither.
    time_s: until rest on the target; None if it was not reached.
    min_clearance_m: inf if there is nothing to come near to.
    oracle_time_s: None if not even the oracle reaches the target.
    """

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
    touched_not_at_fault: tuple[str, ...] = ()
    touched_at_mps: tuple[float, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """The row as a dictionary for JSON, which has no infinity: null."""
        clearance_m = self.min_clearance_m if math.isfinite(self.min_clearance_m) else None
        return {**asdict(self), "min_clearance_m": clearance_m}


@dataclass(frozen=True, slots=True)
class JudgeReference:
    """What a drive is compared with: the oracle's time, the field of view, and the fastest possible reaction
    to something new (sightings, latency of perception, control period, lag of the chassis)."""

    oracle: OracleTime
    planar_camera: PlanarCamera
    reaction_s: float


def judge(stage: Stage, log: DriveLog, policy: str, mode: str, reference: JudgeReference) -> Row:
    """The row of a drive in missions.jsonl."""
    clearance = DriveClearance(stage, log)
    contacts = clearance.contacts()
    case, tally = stage.case, log.setpoints
    faulty = [
        contact
        for contact in contacts
        if at_fault(contact, stage, log, reference.planar_camera, reference.reaction_s)
    ]
    blameless = [contact for contact in contacts if contact not in faulty]
    return Row(
        family=case.family,
        seed=case.seed,
        policy=policy,
        mode=mode,
        reached=log.reached_s is not None,
        expected=case.expects_arrival,
        contacts=len(contacts),
        contacts_at_fault=len(faulty),
        touched=tuple(stage.world.names[contact.body] for contact in faulty),
        time_s=None if log.reached_s is None else round(log.reached_s, 4),
        oracle_time_s=round(reference.oracle.total_s, 4) if math.isfinite(reference.oracle.total_s) else None,
        min_clearance_m=round(clearance.min_distance_m, 4),
        max_jerk_mps3=tally.max_jerk_mps3,
        max_accel_mps2=tally.max_accel_mps2,
        reversals=tally.reversals,
        limit_violations=tally.violations,
        false_stops=len(false_stops(stage, log)),
        flaps=flaps(log),
        touched_not_at_fault=tuple(stage.world.names[contact.body] for contact in blameless),
        touched_at_mps=tuple(round(contact.v_mps, 3) for contact in blameless),
    )


def flaps(log: DriveLog) -> int:
    """How often the decision changed between faster and slower three times within 2 s."""
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
    """The times of false stops: the robot came to rest before its target, although nothing was in the way
    from some seconds before the stop until some seconds after it went on. Stops for a fault of camera or
    chassis are not false."""
    v = np.array(log.v_mps)
    found = []
    for start, end in _stops(v):
        if log.reached_s is not None and end >= len(v) - 1:
            continue
        t0, t1 = log.times_s[start] - _BEFORE_STOP_S, log.times_s[end] + _AFTER_STOP_S
        if stage.case.faults.demands_stop(log.times_s[start], _AFTER_FAULT_S):
            continue
        if stage.case.glass and stage.case.scenario.outcome == "blocked":
            continue
        times = np.arange(max(t0, 0.0), t1, _WAY_STEP_S)
        s_m = log.s_m[start]
        ahead = any(high >= s_m for intervals in stage.blocked(times) for _, high in intervals)
        if not ahead:
            found.append(log.times_s[start])
    return found


def _stops(v: FloatArray) -> list[tuple[int, int]]:
    """Stops as (first, last) control steps, between driving or at the end. Standing at the start is not a
    stop."""
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
