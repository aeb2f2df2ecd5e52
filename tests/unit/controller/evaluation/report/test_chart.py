"""Charts: round ticks, data where they belong, nothing outside of the frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.evaluation.report.chart import BLUE, ORANGE, Axis, Chart, blank, round_ticks
from controller.video.style import Image, Rect

AREA = Rect(0, 0, 600, 400)


def chart() -> tuple[Image, Chart]:
    image = blank(600, 400)
    return image, Chart(image, AREA, "Title", Axis("x", 0.0, 10.0), Axis("y", 0.0, 1.0))


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.0, 1.0, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (0.0, 10.0, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]),
        (0.0, 0.3, [0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3]),
        (13.0, 37.0, [15.0, 20.0, 25.0, 30.0, 35.0]),
    ],
)
def test_ticks_are_round_numbers_within_the_axis(low: float, high: float, ticks: list[float]) -> None:
    assert round_ticks(low, high) == pytest.approx(ticks)


def test_corners_of_the_data_are_corners_of_the_plot() -> None:
    _, drawn = chart()
    corners = drawn.to_px([0.0, 10.0], [0.0, 1.0])
    plot = drawn.plot
    assert corners.tolist() == [[plot.x, plot.bottom - 1], [plot.right - 1, plot.y]]


def test_decades_of_a_logarithmic_axis_are_equally_far_apart() -> None:
    axis = Axis("ms", 1.0, 100.0, log=True)
    assert axis.position(np.array([1.0, 10.0, 100.0])).tolist() == pytest.approx([0.0, 0.5, 1.0])
    assert math.isnan(axis.position(np.array([0.0]))[0])
    assert [label for _, label in axis.tick_labels()] == ["1", "10", "100"]


def painted(image: Image, colour: tuple[int, int, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.asarray((image == colour).all(axis=2))


def test_a_line_runs_through_its_points() -> None:
    image, drawn = chart()
    drawn.line([0.0, 10.0], [0.5, 0.5], BLUE)
    u, v = drawn.to_px([5.0], [0.5])[0]
    assert painted(image, BLUE)[round(v), round(u)]


def test_a_line_is_interrupted_where_nothing_is_known() -> None:
    image, drawn = chart()
    drawn.line([0.0, 2.0, 4.0, 6.0, 8.0], [0.5, 0.5, math.nan, 0.5, 0.5], BLUE)
    gap, line = drawn.to_px([4.0, 1.0], [0.5, 0.5])
    marks = painted(image, BLUE)
    assert marks[round(line[1]), round(line[0])]
    assert not marks[round(gap[1]), round(gap[0])]


def test_line_beyond_the_axis_is_clipped_to_the_frame() -> None:
    image, drawn = chart()
    drawn.line([1.0, 2.0], [5.0, 5.0], BLUE)
    rows = np.flatnonzero(painted(image, BLUE).any(axis=1))
    assert len(rows) > 0
    assert rows.min() >= drawn.plot.y - 2


def test_bars_stand_on_the_axis() -> None:
    image, drawn = chart()
    drawn.bars([2.0], [4.0], [0.5], ORANGE)
    inside, above = drawn.to_px([3.0, 3.0], [0.25, 0.75])
    marks = painted(image, ORANGE)
    assert marks[round(inside[1]), round(inside[0])]
    assert not marks[round(above[1]), round(above[0])]


@pytest.mark.parametrize("height", [1.5, math.inf])
def test_a_bar_that_goes_on_beyond_the_frame_has_an_arrow_above_it(height: float) -> None:
    image, drawn = chart()
    drawn.bars([2.0, 6.0, 7.0], [4.0, 7.0, 8.0], [height, 1.0, math.nan], ORANGE)
    rows, columns = np.nonzero(painted(image, ORANGE)[: drawn.plot.y - 2])
    assert len(rows) > 20
    assert columns.mean() == pytest.approx(drawn.to_px([3.0], [0.0])[0, 0], abs=0.7)


@pytest.mark.parametrize("marker", ["circle", "square", "diamond"])
def test_markers_are_centred_on_their_points(marker: str) -> None:
    image, drawn = chart()
    drawn.points([5.0, math.nan], [0.5, 0.5], BLUE, marker)  # type: ignore[arg-type]  # parametrised text
    rows, columns = np.nonzero(painted(image, BLUE))
    u, v = drawn.to_px([5.0], [0.5])[0]
    assert (columns.mean(), rows.mean()) == pytest.approx((u, v), abs=0.7)


def test_the_legend_names_what_was_drawn() -> None:
    image, drawn = chart()
    drawn.line([0.0, 1.0], [0.1, 0.1], BLUE, "one")
    before = np.count_nonzero(painted(image, BLUE))
    drawn.legend("upper right")
    assert np.count_nonzero(painted(image, BLUE)) > before
    image, drawn = chart()
    untouched = image.copy()
    drawn.legend("upper right")
    assert np.array_equal(image, untouched)


def test_the_key_stands_above_the_plot() -> None:
    image, drawn = chart()
    drawn.points([], [], BLUE, "square", "one")
    drawn.inline_legend()
    rows, columns = np.nonzero(painted(image, BLUE))
    assert len(rows) > 0
    assert rows.max() < drawn.plot.y
    assert columns.min() > drawn.plot.x
