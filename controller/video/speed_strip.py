"""The speed of the last seconds: wanted, commanded and measured, with the action on a band below."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from controller.decision.decision import Action
from controller.video import draw, text
from controller.video.moment import VideoMoment
from controller.video.style import (
    ACTIONS,
    COMMANDED_SPEED,
    DARK_TEXT,
    FAINT_TEXT,
    GRID,
    MEASURED_SPEED,
    PANEL,
    TARGET_SPEED,
    Image,
    Rect,
)
from hal.clocks import NS_PER_S
from hal.types import FloatArray

_CURVES = (
    ("target", TARGET_SPEED),
    ("commanded", COMMANDED_SPEED),
    ("measured", MEASURED_SPEED),
)
_LEFT_PX, _RIGHT_PX, _TOP_PX = 36, 12, 8
_RIBBON_PX = 18
_AXIS_PX = 18
_TICK_MPS = 0.5
_HEADROOM = 1.1


class SpeedStrip:
    """Draws into one panel. It remembers the last seconds, and starts anew if the time goes back."""

    def __init__(self, panel: Rect, top_speed_mps: float, history_s: float) -> None:
        self._panel = panel
        self._history_s = history_s
        self._top_mps = _HEADROOM * top_speed_mps
        self._plot = Rect(
            _LEFT_PX,
            _TOP_PX,
            panel.width - _LEFT_PX - _RIGHT_PX,
            panel.height - _TOP_PX - _RIBBON_PX - _AXIS_PX,
        )
        self._ribbon = Rect(self._plot.x, self._plot.bottom + 3, self._plot.width, _RIBBON_PX - 3)
        self._stamps_s: deque[float] = deque()
        self._speeds_mps: deque[tuple[float, float, float]] = deque()
        self._actions: deque[Action | None] = deque()

    def to_pixels(self, age_s: FloatArray, speed_mps: FloatArray) -> FloatArray:
        """Pixels (..., 2) of the panel for ages and speeds, which are broadcast; now is at the right edge."""
        x = self._plot.right - 1 - age_s * (self._plot.width - 1) / self._history_s
        y = self._plot.bottom - 1 - speed_mps * (self._plot.height - 1) / self._top_mps
        return np.stack(np.broadcast_arrays(x, y), axis=-1)

    def draw_backdrop(self, canvas: Image) -> None:
        """Draw what never changes: title, grid and scales."""
        text.caption(canvas, self._panel, "SPEED  m/s")
        view = self._panel.of(canvas)
        view[:] = PANEL
        speeds_mps = np.arange(0.0, self._top_mps + 1e-6, _TICK_MPS)
        ages_s = np.arange(0.0, self._history_s + 1e-6, 1.0)
        sides = [self.to_pixels(np.full_like(speeds_mps, age), speeds_mps) for age in (0.0, self._history_s)]
        ends = [self.to_pixels(ages_s, np.full_like(ages_s, speed)) for speed in (0.0, self._top_mps)]
        draw.lines(view, np.stack(sides, axis=1), GRID)
        draw.lines(view, np.stack(ends, axis=1), GRID)
        for speed_mps, (x, y) in zip(speeds_mps, sides[1], strict=True):
            text.put_right(view, f"{speed_mps:.1f}", round(x) - 6, round(y) + 5, FAINT_TEXT, 12)
        for age_s, (x, _) in zip(ages_s, ends[0], strict=True):
            label = f"-{age_s:g} s" if age_s > 0.0 else "now"
            left = min(round(x) - text.width(label, 12) // 2, self._panel.width - text.width(label, 12) - 4)
            text.put(view, label, left, self._panel.height - 5, FAINT_TEXT, 12)

    def draw(self, canvas: Image, moment: VideoMoment) -> None:
        """Add this moment to the history and draw the history."""
        self._append(moment)
        view = self._panel.of(canvas)
        ages_s = self._stamps_s[-1] - np.array(self._stamps_s)
        speeds_mps = np.array(self._speeds_mps)
        self._draw_ribbon(view, ages_s)
        curves = self.to_pixels(ages_s[:, np.newaxis], np.clip(speeds_mps, 0.0, self._top_mps))
        draw.line_with_gaps(view, curves[:, 1], COMMANDED_SPEED, 2)
        draw.line_with_gaps(view, _as_steps(curves[:, 0]), TARGET_SPEED, 1)
        draw.line_with_gaps(view, curves[:, 2], MEASURED_SPEED, 1)
        self._draw_values(canvas, self._speeds_mps[-1])

    def _append(self, moment: VideoMoment) -> None:
        stamp_s = moment.frame.captured_ns / NS_PER_S
        if self._stamps_s and stamp_s < self._stamps_s[-1]:
            for history in (self._stamps_s, self._speeds_mps, self._actions):
                history.clear()
        decision = moment.decision
        target_mps = None if decision is None else decision.target_speed_mps
        self._stamps_s.append(stamp_s)
        self._speeds_mps.append(
            (_number(target_mps), _number(moment.commanded_mps), _number(moment.measured_mps))
        )
        self._actions.append(None if decision is None else decision.action)
        while self._stamps_s[0] < stamp_s - self._history_s:
            self._stamps_s.popleft()
            self._speeds_mps.popleft()
            self._actions.popleft()

    def _draw_ribbon(self, view: Image, ages_s: FloatArray) -> None:
        """Draw a band for each period with the same action, with its symbol and word if they fit."""
        actions = list(self._actions)
        starts = [0] + [i for i in range(1, len(actions)) if actions[i] != actions[i - 1]]
        x = np.rint(self.to_pixels(ages_s, np.zeros_like(ages_s))[:, 0]).astype(int)
        for begin, end in zip(starts, [*starts[1:], len(actions) - 1], strict=True):
            action = actions[begin]
            if action is None:
                continue
            style = ACTIONS[action]
            band = Rect(int(x[begin]), self._ribbon.y, int(x[end] - x[begin]), self._ribbon.height)
            band.of(view)[:] = style.colour
            for label in (f"{style.symbol} {action.value}", style.symbol):
                width = text.width(label, 12, text.MEDIUM)
                if width + 8 <= band.width:
                    text.put(view, label, band.x + 4, band.bottom - 3, DARK_TEXT, 12, text.MEDIUM)
                    break

    def _draw_values(self, canvas: Image, speeds_mps: tuple[float, float, float]) -> None:
        """Draw the newest values above the plot, in the colours of their curves."""
        right = self._panel.right
        baseline = self._panel.y - 7
        for (name, colour), speed_mps in reversed(list(zip(_CURVES, speeds_mps, strict=True))):
            value = f"{speed_mps:.2f}" if math.isfinite(speed_mps) else "-"
            right = text.put_right(canvas, value, right, baseline, colour, 13, text.BOLD) - 6
            right = text.put_right(canvas, name, right, baseline, FAINT_TEXT, 12) - 6
            draw.line(canvas, np.array([[right - 18.0, baseline - 4.0], [right, baseline - 4.0]]), colour, 2)
            right -= 40


def _as_steps(points: FloatArray) -> FloatArray:
    """Convert points (N, 2) to steps (2 N - 1, 2): each value holds until the next one."""
    doubled = np.repeat(points, 2, axis=0)
    return np.column_stack([doubled[1:, 0], doubled[:-1, 1]])


def _number(value: float | None) -> float:
    return math.nan if value is None else value
