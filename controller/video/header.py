"""The line at the top: what was decided and why, how fast, when, and whether the camera can be trusted."""

from __future__ import annotations

import math

import numpy as np

from controller.video import draw, text
from controller.video.moment import VideoMoment
from controller.video.style import (
    ACTIONS,
    ALARM,
    DARK_TEXT,
    FAINT_TEXT,
    FINE,
    GRID,
    MARGIN_PX,
    PANEL,
    TEXT,
    UNKNOWN_ACTION,
    WARNING,
    Image,
    Rect,
)
from hal.clocks import NS_PER_S
from vision.scene import CameraCondition

_BASELINE_PX = 29
_CHIP = Rect(MARGIN_PX, 7, 196, 30)
_CAMERA_X, _SPEED_RIGHT, _TIME_RIGHT, _FRAME_RIGHT = 858, 1088, 1180, 1270
_HEALTH = {
    CameraCondition.GOOD: FINE,
    CameraCondition.DEGRADED: WARNING,
    CameraCondition.UNTRUSTWORTHY: ALARM,
}


class Header:
    """Draws into one panel; time counts from the first moment."""

    def __init__(self, panel: Rect) -> None:
        self._panel = panel
        self._first_ns: int | None = None

    def draw_backdrop(self, canvas: Image) -> None:
        """What never changes."""
        self._panel.of(canvas)[:] = PANEL

    def draw(self, canvas: Image, moment: VideoMoment) -> None:
        """Action, reason, camera, speed, time."""
        view = self._panel.of(canvas)
        decision = moment.decision
        action = None if decision is None else decision.action.value
        style = ACTIONS.get(action or "", UNKNOWN_ACTION)
        _CHIP.of(view)[:] = style.colour
        if decision is None:
            text.put(view, "no decision", _CHIP.x + 10, _BASELINE_PX - 1, FAINT_TEXT, 15, text.BOLD)
        else:
            x = text.put(view, style.symbol, _CHIP.x + 10, _BASELINE_PX, DARK_TEXT, 19)
            to = "at" if action == "keep" else "to"
            wanted = f"{action} {to} {decision.target_speed_mps:.2f} m/s"
            text.put(view, wanted, x + 6, _BASELINE_PX - 1, DARK_TEXT, 15, text.BOLD)
            _draw_reason(view, decision.reason.sentence)
        self._draw_state(view, moment)

    def _draw_state(self, view: Image, moment: VideoMoment) -> None:
        condition = moment.scene.health.condition
        draw.disc(view, np.array([_CAMERA_X, _BASELINE_PX - 6.0]), 5.0, _HEALTH[condition])
        text.put(view, f"camera {condition.value}", _CAMERA_X + 12, _BASELINE_PX - 1, TEXT, 14)
        stamp_ns = moment.frame.captured_ns
        self._first_ns = stamp_ns if self._first_ns is None else self._first_ns
        speed_mps = moment.measured_mps
        known = speed_mps is not None and math.isfinite(speed_mps)
        speed = f"{speed_mps:.2f} m/s" if known else "- m/s"
        text.put_right(view, speed, _SPEED_RIGHT, _BASELINE_PX - 1, TEXT, 15, text.BOLD)
        seconds = f"{(stamp_ns - self._first_ns) / NS_PER_S:.2f} s"
        text.put_right(view, seconds, _TIME_RIGHT, _BASELINE_PX - 1, TEXT, 15, text.BOLD)
        frame = f"frame {moment.frame.sequence}"
        text.put_right(view, frame, _FRAME_RIGHT, _BASELINE_PX - 1, FAINT_TEXT, 13)
        for x in (_CAMERA_X - 14, _SPEED_RIGHT - 82, _SPEED_RIGHT + 10, _TIME_RIGHT + 8):
            view[12:-12, x] = GRID


def _draw_reason(view: Image, sentence: str) -> None:
    """Smaller where it is long, cut where it is too long."""
    x = _CHIP.right + 14
    room_px = _CAMERA_X - 24 - x
    size = 16 if text.width(sentence, 16) <= room_px else 13
    text.put(view, text.fit(sentence, room_px, size), x, _BASELINE_PX - 1, TEXT, size)
