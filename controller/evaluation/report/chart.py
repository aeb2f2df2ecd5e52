"""Charts for a report, drawn with OpenCV: axes with round ticks, lines, markers, bars, a legend.

A Chart draws into one rectangle of an image. It takes data coordinates; NaN values are left out. Strokes are
anti-aliased. The colours are those of Okabe and Ito (2008), on white.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.video import draw, text
from controller.video.style import Colour, Image, Rect, bgr
from hal.types import FloatArray

PAPER = (255, 255, 255)
INK = bgr("1B1F24")
SOFT_INK = bgr("5B6570")
GRID = bgr("E4E8EC")
FRAME = bgr("8C959F")

BLUE = bgr("0072B2")
ORANGE = bgr("D55E00")
GREEN = bgr("009E73")
PURPLE = bgr("B65C95")
SKY = bgr("56B4E9")
AMBER = bgr("E69F00")
GREY = bgr("7F8891")

_LEFT, _RIGHT, _TOP, _BOTTOM = 78, 22, 50, 62  # pixels around the plot, for title, ticks and labels
_TITLE, _LABEL, _TICK, _LEGEND, _NOTE = 21, 17, 15, 15, 14  # sizes of the lettering

Marker = Literal["circle", "square", "diamond", "cross"]


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis from low to high.

    label: its title.
    log: logarithmic to base ten; both ends must be above zero.
    ticks: values and labels; None: round values.
    """

    label: str
    low: float
    high: float
    log: bool = False
    ticks: tuple[tuple[float, str], ...] | None = None

    def position(self, values: FloatArray) -> FloatArray:
        """Position of values along the axis: 0 at low, 1 at high."""
        if not self.log:
            return (values - self.low) / (self.high - self.low)
        safe = np.where(values > 0.0, values, np.nan)
        span: FloatArray = (np.log10(safe) - math.log10(self.low)) / math.log10(self.high / self.low)
        return span

    def tick_labels(self) -> list[tuple[float, str]]:
        """The ticks: value and label."""
        if self.ticks is not None:
            return list(self.ticks)
        if self.log:
            powers = range(math.ceil(math.log10(self.low)), math.floor(math.log10(self.high)) + 1)
            return [(10.0**power, f"{10.0**power:g}") for power in powers]
        return [(value, f"{value:g}") for value in round_ticks(self.low, self.high)]


def round_ticks(low: float, high: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between low and high, about six of them."""
    raw = (high - low) / 6
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(index * step, 12) for index in range(first, last + 1)]


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """A line, a marker, or both, with the label."""

    label: str
    colour: Colour
    line: bool = True
    marker: Marker | None = None
    dashed: bool = False


class Chart:
    """Draws one diagram into the given area of an image."""

    def __init__(self, image: Image, area: Rect, title: str, x: Axis, y: Axis) -> None:
        self._image = image
        self._x, self._y = x, y
        self.plot = Rect(
            area.x + _LEFT, area.y + _TOP, area.width - _LEFT - _RIGHT, area.height - _TOP - _BOTTOM
        )
        self._legend: list[LegendEntry] = []
        self._draw_axes(area, title)

    def to_px(self, x: Sequence[float] | FloatArray, y: Sequence[float] | FloatArray) -> FloatArray:
        """Data (N,), (N,) to pixels (N, 2)."""
        u = self.plot.x + self._x.position(np.asarray(x, np.float64)) * (self.plot.width - 1)
        v = self.plot.bottom - 1 - self._y.position(np.asarray(y, np.float64)) * (self.plot.height - 1)
        return np.stack([u, v], axis=1)

    def line(
        self,
        x: Sequence[float] | FloatArray,
        y: Sequence[float] | FloatArray,
        colour: Colour,
        label: str | None = None,
        marker: Marker | None = None,
        dashed: bool = False,
    ) -> None:
        """A line through the points; points outside the axes are moved to the frame."""
        points = self._clip_to_plot(self.to_px(x, y))
        if dashed:
            finite = points[np.isfinite(points).all(axis=1)]
            if len(finite) > 1:
                draw.dashed(self._image, finite, colour, 2, 8.0)
        else:
            draw.line_with_gaps(self._image, points, colour, 3)
        if marker is not None:
            self._markers(points, colour, marker)
        self._add_to_legend(label, colour, True, marker, dashed)

    def points(
        self,
        x: Sequence[float] | FloatArray,
        y: Sequence[float] | FloatArray,
        colour: Colour,
        marker: Marker,
        label: str | None = None,
    ) -> None:
        """Markers alone."""
        self._markers(self.to_px(x, y), colour, marker)
        self._add_to_legend(label, colour, False, marker, False)

    def bars(
        self,
        left: Sequence[float] | FloatArray,
        right: Sequence[float] | FloatArray,
        height: Sequence[float] | FloatArray,
        colour: Colour,
        label: str | None = None,
    ) -> None:
        """Vertical bars from the lower end of the axis; an arrow marks a bar that is higher than the plot."""
        base = np.full(len(height), self._y.low)
        tops, bottoms = self.to_px(left, height), self.to_px(right, base)
        for (u0, v0), (u1, v1) in zip(self._clip_to_plot(tops), bottoms, strict=True):
            if np.isfinite([u0, v0, u1, v1]).all() and v1 - v0 >= 0.5:
                draw.area(self._image, draw.box((u0, v0, u1, v1)), colour)
        for u0, u1, too_high in zip(
            tops[:, 0], bottoms[:, 0], np.asarray(height) > self._y.high, strict=True
        ):
            if too_high:
                self._arrow_up(0.5 * (u0 + u1), colour)
        self._add_to_legend(label, colour, True, None, False)

    def target_line(self, value: float, colour: Colour, label: str) -> None:
        """A dashed horizontal line, for a target."""
        self.line([self._x.low, self._x.high], [value, value], colour, label, dashed=True)

    def annotate(self, x: float, y: float, words: str) -> None:
        """Words centred above a point."""
        u, v = self.to_px([x], [y])[0]
        if np.isfinite([u, v]).all():
            left = round(u) - text.width(words, _NOTE) // 2
            text.put(self._image, words, left, round(v) - 7, SOFT_INK, _NOTE)

    def legend(self, where: Literal["upper right", "lower right", "lower left", "upper left"]) -> None:
        """A legend box with all labelled items, in the order in which they were drawn."""
        if not self._legend:
            return
        row = 24
        width = max(text.width(entry.label, _LEGEND) for entry in self._legend) + 58
        height = row * len(self._legend) + 12
        vertical, horizontal = where.split()
        x = self.plot.right - width - 12 if horizontal == "right" else self.plot.x + 12
        y = self.plot.bottom - height - 12 if vertical == "lower" else self.plot.y + 12
        box = draw.box((x, y, x + width, y + height))
        draw.tint(self._image, box, PAPER, 0.9)
        draw.line(self._image, box, GRID, 1, closed=True)
        for index, entry in enumerate(self._legend):
            middle = y + 6 + row * index + row // 2
            self._sample(entry, x + 10, middle)
            text.put(self._image, entry.label, x + 48, middle + 5, INK, _LEGEND)

    def inline_legend(self) -> None:
        """A legend in one row, at the right end of the title's line."""
        widths = [text.width(entry.label, _LEGEND) + 46 for entry in self._legend]
        x, middle = self.plot.right - sum(widths), self.plot.y - 24
        for entry, width in zip(self._legend, widths, strict=True):
            self._sample(entry, x, middle)
            text.put(self._image, entry.label, x + 36, middle + 5, INK, _LEGEND)
            x += width

    def _sample(self, entry: LegendEntry, x: int, middle: int) -> None:
        ends = np.array([[x, middle], [x + 30.0, middle]])
        if entry.dashed:
            draw.dashed(self._image, ends, entry.colour, 2, 6.0)
        elif entry.line:
            draw.line(self._image, ends, entry.colour, 3)
        if entry.marker is not None:
            self._markers(np.array([[x + 15.0, middle]]), entry.colour, entry.marker)

    def _add_to_legend(
        self, label: str | None, colour: Colour, line: bool, marker: Marker | None, dashed: bool
    ) -> None:
        if label is not None:
            self._legend.append(LegendEntry(label, colour, line, marker, dashed))

    def _clip_to_plot(self, points: FloatArray) -> FloatArray:
        """Pixels (N, 2), limited to the plot; NaN stays NaN."""
        low = (self.plot.x, self.plot.y)
        high = (self.plot.right - 1, self.plot.bottom - 1)
        clipped: FloatArray = np.clip(points, low, high)
        return clipped

    def _arrow_up(self, u: float, colour: Colour) -> None:
        base = self.plot.y - 3.0
        draw.area(self._image, np.array([[u - 6.0, base], [u, base - 9.0], [u + 6.0, base]]), colour)

    def _markers(self, points: FloatArray, colour: Colour, marker: Marker) -> None:
        for point in points[np.isfinite(points).all(axis=1)]:
            outline = point + _MARKERS[marker]
            if marker == "cross":
                draw.lines(self._image, outline.reshape(2, 2, 2), colour, 3)
            else:
                draw.area(self._image, outline, colour)
                draw.line(self._image, outline, PAPER, 1, closed=True)

    def _draw_axes(self, area: Rect, title: str) -> None:
        image, plot = self._image, self.plot
        text.put(image, title, plot.x, area.y + 32, INK, _TITLE, text.BOLD)
        for value, label in self._x.tick_labels():
            u = float(self.to_px([value], [self._y.low])[0, 0])
            draw.line(image, np.array([[u, plot.y], [u, plot.bottom - 1]]), GRID)
            x = round(u) - text.width(label, _TICK) // 2
            text.put(image, label, x, plot.bottom + 21, SOFT_INK, _TICK)
        for value, label in self._y.tick_labels():
            v = float(self.to_px([self._x.low], [value])[0, 1])
            draw.line(image, np.array([[plot.x, v], [plot.right - 1, v]]), GRID)
            text.put_right(image, label, plot.x - 9, round(v) + 5, SOFT_INK, _TICK)
        frame = np.array([[plot.x, plot.y], [plot.x, plot.bottom - 1], [plot.right - 1, plot.bottom - 1]])
        draw.line(image, frame, FRAME, 1)
        centre = plot.x + (plot.width - text.width(self._x.label, _LABEL)) // 2
        text.put(image, self._x.label, centre, plot.bottom + 48, INK, _LABEL)
        _put_vertical_text(image, self._y.label, area.x + 8, plot.y + plot.height // 2)


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 25)[:-1]
_MARKERS: dict[Marker, NDArray[np.float64]] = {
    "circle": 6.0 * np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1),
    "square": 5.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
    "diamond": 8.0 * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]),
    "cross": 6.0 * np.array([[-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]]),
}


def blank(width: int, height: int) -> Image:
    """A white picture."""
    return np.full((height, width, 3), 255, np.uint8)


def _put_vertical_text(image: Image, words: str, x: int, middle: int) -> None:
    """Text that reads upwards, its middle at the given row."""
    length = text.width(words, _LABEL)
    strip = blank(length + 4, _LABEL + 10)
    text.put(strip, words, 2, _LABEL + 1, INK, _LABEL)
    rotated = np.asarray(cv2.rotate(strip, cv2.ROTATE_90_COUNTERCLOCKWISE), np.uint8)
    top = max(middle - rotated.shape[0] // 2, 0)
    part = image[top : top + rotated.shape[0], x : x + rotated.shape[1]]
    np.minimum(part, rotated[: part.shape[0], : part.shape[1]], out=part)
