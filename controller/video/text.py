"""Text in OpenCV's built-in TrueType face: proportional, anti-aliased, with the few symbols used here."""

from __future__ import annotations

import re

import cv2

from controller.video.style import FAINT_TEXT, Colour, Image, Rect

REGULAR, MEDIUM, BOLD = 400, 500, 600
ELLIPSIS = "…"
_NO_BREAK = "\N{NO-BREAK SPACE}"
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(m/s|m|s|ms|degrees)\b)")
_FACE = cv2.FontFace("sans")


def put(
    image: Image, text: str, x: int, baseline: int, colour: Colour, size: int, weight: int = REGULAR
) -> int:
    """Write text that begins at x; return the x at which it ends."""
    end, _ = cv2.putText(image, text, (x, baseline), colour, _FACE, size, weight)
    return int(end[0])


def put_right(
    image: Image, text: str, right: int, baseline: int, colour: Colour, size: int, weight: int = REGULAR
) -> int:
    """Write text that ends at right; return the x at which it begins."""
    x = right - width(text, size, weight)
    put(image, text, x, baseline, colour, size, weight)
    return x


def width(text: str, size: int, weight: int = REGULAR) -> int:
    """The width of the text in pixels."""
    return int(cv2.getTextSize((0, 0), text, (0, 0), _FACE, size, weight)[2])


def fit(text: str, max_width_px: int, size: int, weight: int = REGULAR) -> str:
    """The text, shortened with an ellipsis if it does not fit."""
    if width(text, size, weight) <= max_width_px:
        return text
    shortest, longest = 0, len(text)
    while shortest < longest:
        middle = (shortest + longest + 1) // 2
        if width(text[:middle].rstrip() + ELLIPSIS, size, weight) <= max_width_px:
            shortest = middle
        else:
            longest = middle - 1
    return text[:shortest].rstrip() + ELLIPSIS


def wrap(text: str, max_width_px: int, max_lines: int, size: int, weight: int = REGULAR) -> list[str]:
    """The text, broken between words into lines that fit, but not between a number and its unit. The last
    line is shortened if there is too much text."""
    lines: list[str] = []
    words = _BEFORE_UNIT.sub(_NO_BREAK, " ".join(text.split())).split(" ")
    words = [word.replace(_NO_BREAK, " ") for word in words if word]
    while words and len(lines) < max_lines - 1:
        count = len(words)
        while count > 1 and width(" ".join(words[:count]), size, weight) > max_width_px:
            count -= 1
        lines.append(fit(" ".join(words[:count]), max_width_px, size, weight))
        words = words[count:]
    return [*lines, fit(" ".join(words), max_width_px, size, weight)] if words else lines


def caption(image: Image, panel: Rect, title: str) -> int:
    """Write the title above a panel; return the x at which it ends."""
    return put(image, title, panel.x, panel.y - 6, FAINT_TEXT, 12, BOLD)


def caption_note(image: Image, panel: Rect, note: str) -> None:
    """Write a changing note above a panel, at its right end."""
    put_right(image, note, panel.right, panel.y - 6, FAINT_TEXT, 12)
