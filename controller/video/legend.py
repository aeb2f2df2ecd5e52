"""The legend of colours and strokes, drawn with the same strokes as the views."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controller.video import draw, text
from controller.video.style import (
    ACTIONS,
    DARK_TEXT,
    FAINT_TEXT,
    FREE_SPACE,
    GRID,
    MOVING,
    OWN,
    PANEL,
    STATIC,
    SURFACE,
    TEXT,
    UNMEASURED,
    Image,
    Rect,
)

_SWATCH_PX = 46
_PAD_PX = 10


def draw_legend(canvas: Image, panel: Rect) -> None:
    """Draw the legend, which never changes."""
    text.caption(canvas, panel, "LEGEND")
    view = panel.of(canvas)
    view[:] = PANEL
    rows: tuple[tuple[Callable[[Image], None], str], ...] = (
        (_static, "static"),
        (_moving, "moving"),
        (_unmeasured, "edge, speed unknown yet"),
        (_predicted, "not seen now, predicted"),
        (_is_deciding, "decides the speed"),
        (_velocity, "motion in 1 s, ±1 sigma"),
        (_surface, "nearest surface by depth"),
        (_free, "seen to be free"),
        (_path, "planned path, its corridor"),
    )
    row_px = (panel.height - 8) / (len(rows) + 1)
    for index, (swatch, label) in enumerate(rows):
        row = Rect(_PAD_PX, round(4 + index * row_px), _SWATCH_PX, round(row_px))
        swatch(row.of(view))
        text.put(view, label, row.right + 10, row.y + row.height // 2 + 5, TEXT, 13)
    _draw_actions(view, round(4 + len(rows) * row_px), round(row_px))


def _horizontal(
    swatch: Image, fraction: float = 0.5, left: int = 0, right: int = _SWATCH_PX - 1
) -> draw.Points:
    y = fraction * (swatch.shape[0] - 1)
    return np.array([[left, y], [right, y]], np.float64)


def _static(swatch: Image) -> None:
    draw.line(swatch, _horizontal(swatch, left=0, right=16), STATIC)
    draw.line(swatch, draw.box((24, 5, 44, swatch.shape[0] - 6)), STATIC, 2, closed=True)


def _moving(swatch: Image) -> None:
    draw.line(swatch, _horizontal(swatch, left=0, right=16), MOVING)
    draw.line(swatch, draw.box((24, 5, 44, swatch.shape[0] - 6)), MOVING, 3, closed=True)


def _unmeasured(swatch: Image) -> None:
    draw.line(swatch, _horizontal(swatch), UNMEASURED)


def _predicted(swatch: Image) -> None:
    corners = draw.box((12, 5, 44, swatch.shape[0] - 6))
    draw.dashed(swatch, np.concatenate([corners, corners[:1]]), STATIC, 2, dash_px=4.0)


def _is_deciding(swatch: Image) -> None:
    corners = draw.box((12, 5, 44, swatch.shape[0] - 6))
    draw.line(swatch, corners, OWN, 6, closed=True)
    draw.line(swatch, corners, DARK_TEXT, 4, closed=True)
    draw.line(swatch, corners, STATIC, 2, closed=True)


def _velocity(swatch: Image) -> None:
    tail, tip = _horizontal(swatch, left=2, right=34)
    draw.arrow(swatch, tail, tip, MOVING)
    draw.ellipse(swatch, tip, np.diag([80.0, 36.0]), MOVING)


def _surface(swatch: Image) -> None:
    draw.line(swatch, _horizontal(swatch), SURFACE, 2)


def _free(swatch: Image) -> None:
    swatch[4:-4, :_SWATCH_PX] = FREE_SPACE


def _path(swatch: Image) -> None:
    height = swatch.shape[0]
    draw.tint(swatch, draw.box((0, 5, _SWATCH_PX, height - 6)), OWN, 0.13)
    draw.lines(
        swatch,
        np.stack([_horizontal(swatch, 5 / (height - 1)), _horizontal(swatch, 1 - 5 / (height - 1))]),
        FAINT_TEXT,
    )
    draw.line(swatch, _horizontal(swatch), OWN, 2)


def _draw_actions(view: Image, y: int, height: int) -> None:
    view[y, _PAD_PX : view.shape[1] - _PAD_PX] = GRID
    x = _PAD_PX
    for action, style in ACTIONS.items():
        x = text.put(view, style.symbol, x, y + height // 2 + 6, style.colour, 14)
        x = text.put(view, action.value, x + 3, y + height // 2 + 6, TEXT, 13) + 12
