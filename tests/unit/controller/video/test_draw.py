import math

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.video import draw
from controller.video.style import Image

WHITE = (255, 255, 255)
# An anti-aliased stroke of one pixel shares a little of its ink with its neighbours.
DRAWN = 200


def black(width: int = 40, height: int = 30) -> Image:
    return np.zeros((height, width, 3), np.uint8)


def inked(image: Image) -> NDArray[np.bool_]:
    return np.asarray(image.max(axis=2) > 0)


def test_one_call_draws_many_lines_and_leaves_out_what_is_not_finite() -> None:
    image = black()
    lines = np.array([[[2, 5], [30, 5]], [[2, 20], [30, 20]], [[2, 12], [math.nan, 12]]], float)
    draw.lines(image, lines, WHITE)
    assert (image[[5, 20], 10] > DRAWN).all()
    assert not inked(image)[9:16].any()


def test_no_lines_at_all_are_no_error() -> None:
    image = black()
    draw.lines(image, np.zeros((0, 2, 2)), WHITE)
    draw.lines(image, np.full((3, 2, 2), math.inf), WHITE)
    assert not image.any()


def test_sub_pixel_places_are_kept() -> None:
    image = black()
    draw.line(image, np.array([[2.0, 10.5], [30.0, 10.5]]), WHITE)
    assert image[10, 15, 0] == pytest.approx(image[11, 15, 0], abs=40)
    assert image[10, 15, 0] > 60


def test_a_line_with_gaps_is_not_drawn_across_the_unknown() -> None:
    image = black()
    x = np.arange(4.0, 36.0, 4.0)
    y = np.full_like(x, 10.0)
    y[3:5] = math.nan  # x 16 and 20: known up to 12 and from 24 on
    draw.line_with_gaps(image, np.column_stack([x, y]), WHITE)
    assert (image[10, [8, 28]] > DRAWN).all()
    assert not inked(image)[:, 15:22].any()


def test_dashes_leave_gaps_as_long_as_they_are() -> None:
    image = black(100)
    draw.dashed(image, np.array([[0.0, 10.0], [99.0, 10.0]]), WHITE, dash_px=8.0)
    assert (image[10, [4, 20, 36]] > DRAWN).all()
    assert not image[10, [12, 28, 44]].any()


def test_a_tint_mixes_with_what_is_beneath_and_is_clipped() -> None:
    image = black()
    image[:] = 100
    draw.tint(image, np.array([[10.0, 10.0], [60.0, 10.0], [60.0, 20.0], [10.0, 20.0]]), WHITE, 0.4)
    assert image[15, 30].tolist() == [162, 162, 162]  # 0.4 * 255 + 0.6 * 100
    assert image[15, 5].tolist() == [100, 100, 100]


def test_a_tint_outside_the_image_changes_nothing() -> None:
    image = black()
    draw.tint(image, np.array([[-50.0, 0.0], [-10.0, 0.0], [-10.0, 20.0]]), WHITE, 0.5)
    assert not image.any()


def test_an_arrow_reaches_from_tail_to_tip_and_no_further() -> None:
    image = black()
    draw.arrow(image, np.array([5.0, 15.0]), np.array([30.0, 15.0]), WHITE)
    columns = np.flatnonzero(inked(image)[15])
    assert columns.min() == pytest.approx(5, abs=2)  # the shaft is two pixels wide, with a soft end
    assert columns.max() == pytest.approx(30, abs=1)
    assert inked(image)[:, 23].sum() > inked(image)[:, 12].sum()  # the head is wider than the shaft


def test_an_arrow_without_length_is_not_drawn() -> None:
    image = black()
    draw.arrow(image, np.array([5.0, 15.0]), np.array([5.2, 15.0]), WHITE)
    assert not image.any()


def test_an_ellipse_spans_one_standard_deviation() -> None:
    image = black(80, 60)
    draw.ellipse(image, np.array([40.0, 30.0]), np.diag([20.0**2, 10.0**2]), WHITE)
    rows, columns = np.nonzero(image[:, :, 0] > 100)
    assert (columns.min(), columns.max()) == pytest.approx((20, 60), abs=1)
    assert (rows.min(), rows.max()) == pytest.approx((20, 40), abs=1)


def test_an_ellipse_turns_with_the_correlation() -> None:
    image = black(80, 60)
    draw.ellipse(image, np.array([40.0, 30.0]), np.array([[200.0, 190.0], [190.0, 200.0]]), WHITE)
    assert inked(image)[36:46, 46:56].any()  # right and down go together
    assert not inked(image)[14:24, 46:56].any()


def test_a_disc_is_filled() -> None:
    image = black()
    draw.disc(image, np.array([20.0, 15.0]), 4.0, WHITE)
    assert image[15, 20, 0] == 255
    assert image[15, 17, 0] == 255
    assert image[15, 26, 0] == 0
