"""Labels beside the things they name, placed so that none covers another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2

from controller.video import text
from controller.video.draw import Points
from controller.video.style import DARK_TEXT, OWN, Colour, Image, Rect

_PAD_PX = 4
# Maximum number of labels in one view, the most important first. More would cover the obstacles: a distant
# wall falls into a dozen pieces.
MAX_LABELS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A text beside a box.

    box: (2, 2), opposite corners.
    filled: the background has the colour, for more important labels; else the text has it.
    outlined: the label names the obstacle that the decision is based on.
    """

    text: str
    colour: Colour
    box: Points
    filled: bool = False
    outlined: bool = False


def draw_labels(image: Image, labels: Iterable[Label], occupied: Iterable[Rect] = (), size: int = 13) -> None:
    """Draw the labels in the order given, each where there is room; labels without room are left out."""
    height, width = image.shape[:2]
    for label, place in arrange(labels, Rect(0, 0, width, height), occupied, size):
        _draw(image, label, place, size)


def arrange(
    labels: Iterable[Label], bounds: Rect, occupied: Iterable[Rect] = (), size: int = 13
) -> list[tuple[Label, Rect]]:
    """A place inside bounds for each label for which there is room; no two places overlap."""
    occupied_places = list(occupied)
    arranged = []
    for label in labels:
        place = next(
            (p for p in _candidates(label, bounds, size) if not any(p.overlaps(t) for t in occupied_places)),
            None,
        )
        if place is not None:
            occupied_places.append(place)
            arranged.append((label, place))
        if len(arranged) == MAX_LABELS:
            break
    return arranged


def _candidates(label: Label, bounds: Rect, size: int) -> list[Rect]:
    """Possible places: above the box, below it, inside it at top and bottom, to its right and left; those
    that fit into bounds."""
    width = text.width(label.text, size, text.MEDIUM) + 2 * _PAD_PX
    height = size + 2 * _PAD_PX - 2
    x0, y0, x1, y1 = (round(float(edge)) for edge in label.box.ravel())
    if x1 < bounds.x or y1 < bounds.y or x0 >= bounds.right or y0 >= bounds.bottom:
        return []
    x = max(bounds.x, min(x0, bounds.right - width))
    left, right = x0 - width - 3, x1 + 3
    middle = (y0 + y1 - height) // 2
    places = (
        Rect(x, y0 - height - 3, width, height),
        Rect(x, y1 + 3, width, height),
        Rect(x, max(y0 + 3, bounds.y + 3), width, height),
        Rect(x, min(y1, bounds.bottom) - height - 3, width, height),
        Rect(right, middle, width, height),
        Rect(left, middle, width, height),
        Rect(right, y0, width, height),
        Rect(left, y0, width, height),
    )
    return [place for place in places if bounds.contains(place)]


def _draw(image: Image, label: Label, place: Rect, size: int) -> None:
    place.of(image)[:] = label.colour if label.filled else DARK_TEXT
    if label.outlined:
        cv2.rectangle(image, (place.x - 1, place.y - 1), (place.right, place.bottom), OWN, 2)
    colour = DARK_TEXT if label.filled else label.colour
    text.put(image, label.text, place.x + _PAD_PX, place.bottom - _PAD_PX - 1, colour, size, text.MEDIUM)
