"""Nav2's bag metrics on simulated drives: time to stop, holding the stop, time to resume, false stops.

Nav2's collision monitor is tested on recordings with four numbers (nav2_collision_monitor/test/
collision_monitor_node_bag.cpp): time to stop, share of the time that the stop is held, time to resume, and
share of false stops. There, 0.02 m/s counts as stopped, 0.10 m/s as driving, and three samples in a row as
certain. Here, the window in which a stop is due comes from the ground truth of the simulated world, and the
recording is the log of a drive: one row per control step.
"""

from __future__ import annotations

import csv
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.robot import Robot
from controller import braking
from controller.campaign.drive_log import DriveLog
from controller.campaign.stage import Stage
from controller.decision.decision import Action
from controller.errors import UserError
from hal.types import FloatArray

STOPPED_MPS, DRIVING_MPS, MIN_SAMPLES = 0.02, 0.10, 3
# Hysteresis: the way counts as free again from this much more on than a stop needs.
_CLEAR_MARGIN_M = 0.3
_COLUMNS = ("t_s", "s_m", "v_mps", "action", "free_m")


@dataclass(frozen=True, slots=True, eq=False)
class DriveRecording:
    """One drive with N control steps; all values are the true ones.

    s_m: position along the path.
    faster: whether the decision was to go faster.
    free_m: free way before the front; inf if nothing is ahead.
    """

    times_s: FloatArray
    s_m: FloatArray
    v_mps: FloatArray
    faster: NDArray[np.bool_]
    free_m: FloatArray


@dataclass(frozen=True, slots=True)
class StopAndGo:
    """Nav2's four numbers for one drive. NaN: there was no such moment; inf: the robot never did it.

    to_stop_s: from when the free way is no longer than a comfortable stop needs (the last such moment before
        it stands) until it stands.
    braking_s: reference for to_stop_s: a comfortable stop to STOPPED_MPS from the speed and acceleration at
        that moment. A robot that began earlier takes less.
    hold_share: share of the time for which the stop is held.
    to_resume_s: from when the way is free until 0.10 m/s.
    starting_s: reference for to_resume_s: from rest to 0.10 m/s at the jerk limit. A robot that began before
        the way was free takes less.
    to_decide_s: from when the way is free until the decision is to go faster.
    false_stop_share: share of the time for which the robot stands without a reason.
    """

    to_stop_s: float
    braking_s: float
    hold_share: float
    to_resume_s: float
    starting_s: float
    to_decide_s: float
    false_stop_share: float

    def as_dict(self) -> dict[str, float | None]:
        """The numbers for JSON, with null where there is none."""
        return {key: value if math.isfinite(value) else None for key, value in asdict(self).items()}


def record(stage: Stage, log: DriveLog) -> DriveRecording:
    """The recording of a drive, with the true free way."""
    times, s = np.array(log.times_s), np.array(log.s_m)
    free = np.full(len(times), np.inf)
    for k, intervals in enumerate(stage.blocked(times)):
        ahead = [low - s[k] for low, high in intervals if high >= s[k]]
        free[k] = max(min(ahead), 0.0) if ahead else np.inf
    faster = np.array([action is Action.INCREASE for action in log.actions], np.bool_)
    return DriveRecording(times, s, np.array(log.v_mps), faster, free)


def write(path: Path, recording: DriveRecording) -> None:
    """Write a recording as CSV. Raises UserError."""
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(_COLUMNS)
            for t, s, v, faster, free in zip(
                recording.times_s, recording.s_m, recording.v_mps, recording.faster, recording.free_m,
                strict=True,
            ):  # fmt: skip
                rows.writerow((f"{t:.3f}", f"{s:.5f}", f"{v:.5f}", int(faster), f"{free:.3f}"))
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror})") from error


def read(path: Path) -> DriveRecording:
    """Read a recording that write() wrote. Raises UserError."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            head, *rows = csv.reader(file)
        table = np.array([[float(cell) for cell in row] for row in rows], np.float64)
        right_shape = tuple(head) == _COLUMNS and table.shape[1:] == (len(_COLUMNS),)
        if not right_shape or not np.isfinite(table[:, :4]).all():
            raise ValueError("other columns, or values that are no numbers")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise UserError(f"{path}: is no recording of a drive ({error}); drive it again") from error
    t, s, v, faster, free = table.T
    return DriveRecording(t, s, v, faster > 0.5, free)


def measure(recording: DriveRecording, robot: Robot, decision: DecisionConfig) -> StopAndGo:
    """The four numbers of a drive in which at most one obstacle comes into the way and leaves it again."""
    comfort = braking.comfort(robot.limits)
    recording = _without_final_rest(recording)
    times, v, free = recording.times_s, recording.v_mps, recording.free_m
    needed_m = _stopping_distances_m(v, comfort, decision)
    starting_s = math.sqrt(2.0 * DRIVING_MPS / robot.limits.max_jerk_mps3)
    driving = _first_index(v >= DRIVING_MPS, 0)
    stop_due = _stop_due_step(free, needed_m, v, driving)
    if stop_due == len(v):
        return StopAndGo(
            to_stop_s=math.nan,
            braking_s=math.nan,
            hold_share=math.nan,
            to_resume_s=math.nan,
            starting_s=starting_s,
            to_decide_s=math.nan,
            false_stop_share=_standing_share(v[driving:]),
        )
    clear_step = _first_index(~np.isfinite(free) | (free > needed_m[stop_due] + 1.0), stop_due, min_run=1)
    stopped = _first_index(v <= STOPPED_MPS, stop_due)
    to_stop_s, hold = math.inf, 0.0
    if stopped < clear_step:
        to_stop_s = float(times[stopped] - times[stop_due])
        hold = _standing_share(v[stopped:clear_step])
    resumed = _first_index(v >= DRIVING_MPS, clear_step) if clear_step < len(v) else len(v)
    decided = _first_index(recording.faster, clear_step, min_run=1) if clear_step < len(v) else len(v)
    stop_expected = np.zeros(len(v), np.bool_)
    stop_expected[stop_due : max(resumed, clear_step)] = True
    return StopAndGo(
        to_stop_s=to_stop_s,
        braking_s=_braking_s(times, v, stop_due, comfort),
        hold_share=hold,
        to_resume_s=_elapsed_s(times, clear_step, resumed),
        starting_s=starting_s,
        to_decide_s=_elapsed_s(times, clear_step, decided),
        false_stop_share=_standing_share(v[driving:], ~stop_expected[driving:]),
    )


def _stopping_distances_m(
    v_mps: FloatArray, limits: braking.BrakeLimits, decision: DecisionConfig
) -> FloatArray:
    """The free way that a stop from each speed needs, margin included."""
    return np.array(
        [
            braking.required_distance(
                max(speed, 0.0), 0.0, 0.0, decision.chassis_delay_s, limits, decision.margins.stop_m
            )
            for speed in v_mps
        ]
    )


def _braking_s(times_s: FloatArray, v_mps: FloatArray, step: int, limits: braking.BrakeLimits) -> float:
    """The time that a stop to STOPPED_MPS takes from the speed and acceleration at this step."""
    accel_mps2 = float(np.gradient(v_mps, times_s)[step])
    to_rest_s = braking.stop(max(float(v_mps[step]), 0.0), accel_mps2, limits).time_s
    # A stop ends with the deceleration fading at the jerk limit: v = j t^2 / 2 before the end.
    return max(to_rest_s - math.sqrt(2.0 * STOPPED_MPS / limits.jerk_mps3), 0.0)


def _stop_due_step(free_m: FloatArray, needed_m: FloatArray, v_mps: FloatArray, driving: int) -> int:
    """The last step before the robot stands from which the free way is no longer than a comfortable stop
    needs. A robot that slowed down in time has room again, and need not stop yet."""
    first = _first_index(free_m <= needed_m, driving, min_run=1)
    stopped = _first_index(v_mps <= STOPPED_MPS, first)
    until = min(stopped, _first_index(~np.isfinite(free_m), first, min_run=1))
    clear_steps = np.flatnonzero(free_m[first:until] > needed_m[first:until] + _CLEAR_MARGIN_M)
    if not len(clear_steps):
        return first
    return _first_index(free_m <= needed_m, first + int(clear_steps[-1]), min_run=1)


def _without_final_rest(recording: DriveRecording) -> DriveRecording:
    """The recording without the time at rest on the target, which is not a stop. If the drive ends with
    something in its way, all of it is kept."""
    moving = np.flatnonzero(recording.v_mps > STOPPED_MPS)
    if not len(moving) or np.isfinite(recording.free_m[-1]):
        return recording
    end = int(moving[-1]) + 1
    return DriveRecording(*(getattr(recording, field.name)[:end] for field in fields(recording)))


def _first_index(condition: NDArray[np.bool_], start: int, min_run: int = MIN_SAMPLES) -> int:
    """The first index from start on at which condition is true for min_run samples in a row; the length if
    none."""
    run = 0
    for k in range(start, len(condition)):
        run = run + 1 if condition[k] else 0
        if run == min_run:
            return k - min_run + 1
    return len(condition)


def _elapsed_s(times_s: FloatArray, start: int, end: int) -> float:
    if start >= len(times_s):
        return math.nan
    return float(times_s[end] - times_s[start]) if end < len(times_s) else math.inf


def _standing_share(v_mps: FloatArray, mask: NDArray[np.bool_] | None = None) -> float:
    selected = v_mps if mask is None else v_mps[mask]
    return float(np.mean(selected <= STOPPED_MPS)) if len(selected) else 0.0
