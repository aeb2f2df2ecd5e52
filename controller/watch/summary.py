"""What is printed at the end of watching."""

from __future__ import annotations

import math

from config.app import AppConfig
from controller.mission.summary import perception_rows
from controller.watch.loop import WatchLoop
from controller.watch.result import WatchResult
from controller.watch.view import base_text, floor_text, odometry_text

# Less turning says nothing of the slip: the images measure a frame to a tenth of a degree.
_LEAST_TURN_RAD = math.radians(90.0)


def summary_rows(config: AppConfig, loop: WatchLoop, result: WatchResult) -> list[tuple[str, str]]:
    """The summary as (subject, text)."""
    rows = [("watched", f"{result.duration_s:.1f} s ({loop.reason}); nothing was commanded")]
    if result.frames.processed:
        rows += [("camera", result.camera.line()), ("floor", _floor_text(config, result))]
        rows.append(("obstacles", result.seen.line()))
    if result.last is not None:
        state = result.last.chassis
        rows.append(("base", base_text(state)))
        if state.pose.finite:
            rows.append(("odometry", odometry_text(state, result.odometry_turn_rad)))
        if result.turned_rad >= _LEAST_TURN_RAD:
            rows.append(("turns", turns_text(result, loop.localiser.yaw_ratio, config.chassis.slip_factor)))
    if result.complaints.reported:
        rows.append(("reported", result.complaints.line()))
    return rows + perception_rows(result.timing, result.frames, result.cut_off)


def _floor_text(config: AppConfig, result: WatchResult) -> str:
    floor = result.floor_in_all()
    looks = "" if floor is None else f"; median of {floor.looks} looks"
    return floor_text(floor, config.robot.camera_mount) + looks


def turns_text(result: WatchResult, yaw_ratio: float, slip_factor: float) -> str:
    """Turning by the odometry beside that by the images, and the slip factor that would make them equal.

    The odometry divides by slip_factor, so it must divide by yaw_ratio less.
    """
    return (
        f"{math.degrees(result.turned_rad):.0f} degrees by the odometry, of which the images show "
        f"{yaw_ratio:.1%}: chassis.slip_factor {slip_factor / yaw_ratio:.2f} would fit, "
        f"{slip_factor:g} is configured"
    )
