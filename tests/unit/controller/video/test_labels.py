from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.video import text
from controller.video.labels import MAX_LABELS, Label, arrange, draw_labels
from controller.video.style import DARK_TEXT, MOVING, STATIC, Rect

BOUNDS = Rect(0, 0, 400, 300)


def label(x0: float, y0: float, x1: float, y1: float, words: str = "#1  2.0 m") -> Label:
    return Label(words, STATIC, np.array([[x0, y0], [x1, y1]]))


boxes = st.tuples(
    st.floats(-100, 500), st.floats(-100, 400), st.floats(0, 300), st.floats(0, 300), st.integers(0, 999)
)


@given(st.lists(boxes, max_size=25), st.booleans())
def test_no_label_covers_another_or_leaves_the_view(
    drawn: list[tuple[float, float, float, float, int]], banner: bool
) -> None:
    occupied = [Rect(0, 276, 400, 24)] if banner else []
    labels = [label(x, y, x + w, y + h, f"#{n}  3.2 m  1.1 m/s") for x, y, w, h, n in drawn]
    places = [place for _, place in arrange(labels, BOUNDS, occupied)]
    assert all(BOUNDS.contains(place) for place in places)
    assert not any(a.overlaps(b) for a, b in combinations([*places, *occupied], 2))


def test_a_label_stands_above_its_box_where_it_can() -> None:
    ((_, place),) = arrange([label(100, 100, 160, 200)], BOUNDS)
    assert place.x == 100
    assert 94 < place.bottom <= 100


def test_a_label_at_the_upper_edge_goes_below_the_box() -> None:
    ((_, place),) = arrange([label(100, 2, 160, 80)], BOUNDS)
    assert 80 < place.y < 90


def test_a_box_that_fills_the_view_is_labelled_inside() -> None:
    ((_, place),) = arrange([label(0, 0, 399, 299)], BOUNDS)
    assert BOUNDS.contains(place)


def test_a_label_near_the_right_edge_is_moved_in() -> None:
    ((_, place),) = arrange([label(390, 100, 399, 200)], BOUNDS)
    assert place.right <= BOUNDS.right


def test_a_thing_outside_the_view_has_no_label() -> None:
    assert arrange([label(-80, 10, -20, 60), label(500, 10, 560, 60)], BOUNDS) == []


def test_the_first_label_has_the_first_choice() -> None:
    first, second = label(100, 100, 160, 200, "first"), label(100, 100, 160, 200, "second")
    (winner, above), (other, elsewhere) = arrange([first, second], BOUNDS)
    assert (winner, other) == (first, second)
    assert above.bottom <= 100
    assert not elsewhere.overlaps(above)


def test_there_are_never_more_labels_than_can_be_read() -> None:
    crowd = [label(x, y, x + 5, y + 5, "#1") for x in range(0, 380, 60) for y in range(30, 280, 40)]
    assert len(crowd) > MAX_LABELS
    assert len(arrange(crowd, BOUNDS)) == MAX_LABELS


def test_label_of_a_mover_is_filled_and_of_a_static_obstacle_is_not() -> None:
    image = np.zeros((300, 400, 3), np.uint8)
    moving = Label("#1", MOVING, np.array([[50.0, 100.0], [90.0, 200.0]]), filled=True)
    static = Label("#2", STATIC, np.array([[250.0, 100.0], [290.0, 200.0]]))
    draw_labels(image, [moving, static])
    (_, left), (_, right) = arrange([moving, static], BOUNDS)
    assert tuple(left.of(image)[1, 1].tolist()) == MOVING
    assert tuple(right.of(image)[1, 1].tolist()) == DARK_TEXT
    assert (right.of(image) == STATIC).all(axis=2).any()  # the writing itself


def test_text_that_is_too_long_is_cut_to_the_room_and_marked() -> None:
    sentence = "an obstacle comes from the right and will be on the path"
    assert text.fit(sentence, 1000, 14) == sentence
    cut = text.fit(sentence, 120, 14)
    assert cut.endswith(text.ELLIPSIS)
    assert sentence.startswith(cut.removesuffix(text.ELLIPSIS))
    assert text.width(cut, 14) <= 120
    assert text.width(text.fit(sentence, 160, 14), 14) > 120


def test_a_long_sentence_is_broken_between_words() -> None:
    sentence = "an obstacle comes from the right and will be on the path in two seconds"
    lines = text.wrap(sentence, 300, 2, 14)
    assert len(lines) == 2
    assert " ".join(lines) == sentence
    assert all(text.width(line, 14) <= 300 for line in lines)


def test_a_sentence_too_long_for_its_lines_is_cut_in_the_last() -> None:
    lines = text.wrap("word " * 60, 200, 2, 14)
    assert len(lines) == 2
    assert lines[1].endswith(text.ELLIPSIS)
    assert not lines[0].endswith(text.ELLIPSIS)


def test_one_endless_word_does_not_hang() -> None:
    assert len(text.wrap("x" * 300, 100, 2, 14)) == 1
    assert text.wrap("", 100, 2, 14) == []
