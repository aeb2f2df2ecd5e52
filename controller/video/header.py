"""The line at the top: what was decided and why, how fast, when, and whether the camera can be trusted."""

from __future__ import annotations

import math

import cv2
import numpy as np

from controller.decision.decision import Action, Decision
from controller.video import draw, text
from controller.video.moment import VideoMoment
from controller.video.style import (
    ACTIONS,
    DARK_TEXT,
    FAINT_TEXT,
    GRID,
    HEALTH,
    MARGIN_PX,
    OWN,
    PANEL,
    TEXT,
    Image,
    Rect,
)
from hal.clocks import NS_PER_S

_BASELINE_PX = 29
_CHIP = Rect(MARGIN_PX, 7, 214, 30)
_CAMERA_X, _SPEED_RIGHT, _TIME_RIGHT, _FRAME_RIGHT = 836, 1088, 1180, 1270


class Header:
    """Draws the header into one panel. Time counts from the first moment."""

    def __init__(self, panel: Rect) -> None:
        self._panel = panel
        self._first_ns: int | None = None

    def draw_backdrop(self, canvas: Image) -> None:
        """Draw what never changes."""
        self._panel.of(canvas)[:] = PANEL

    def draw(self, canvas: Image, moment: VideoMoment) -> None:
        """Draw action, reason, camera, speed and time."""
        view = self._panel.of(canvas)
        decision = moment.decision
        if decision is None:
            _CHIP.of(view)[:] = GRID
            text.put(
                view,
                moment.ending or "no decision",
                _CHIP.x + 10,
                _BASELINE_PX - 1,
                FAINT_TEXT,
                15,
                text.BOLD,
            )
        else:
            _draw_action(view, decision)
            _draw_reason(view, decision.reason.sentence)
        self._draw_state(view, moment)

    def _draw_state(self, view: Image, moment: VideoMoment) -> None:
        condition = moment.scene.health.condition
        draw.disc(view, np.array([_CAMERA_X, _BASELINE_PX - 6.0]), 5.0, HEALTH[condition])
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


def _draw_action(view: Image, decision: Decision) -> None:
    """Draw the action. An emergency has a frame in addition to its word."""
    style = ACTIONS[decision.action]
    _CHIP.of(view)[:] = style.colour
    if decision.emergency:
        cv2.rectangle(view, (_CHIP.x, _CHIP.y), (_CHIP.right - 1, _CHIP.bottom - 1), OWN, 3)
    x = text.put(view, style.symbol, _CHIP.x + 10, _BASELINE_PX, DARK_TEXT, 19)
    action = "emergency" if decision.emergency else decision.action.value
    to = "at" if decision.action is Action.KEEP else "to"
    words = f"{action} {to} {decision.target_speed_mps:.2f} m/s"
    text.put(view, words, x + 6, _BASELINE_PX - 1, DARK_TEXT, 15, text.BOLD)


def _draw_reason(view: Image, sentence: str) -> None:
    """Draw the reason in one line, or in two lines of smaller text."""
    x = _CHIP.right + 14
    max_width_px = _CAMERA_X - 24 - x
    for size in (16, 15, 14, 13):
        if text.width(sentence, size) <= max_width_px:
            text.put(view, sentence, x, _BASELINE_PX - 1, TEXT, size)
            return
    for baseline, line in zip((18, 35), text.wrap(sentence, max_width_px, 2, 13), strict=False):
        text.put(view, line, x, baseline, TEXT, 13)
