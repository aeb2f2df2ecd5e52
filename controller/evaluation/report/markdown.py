"""Markdown for reports: tables, sections, images, numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table and the empty line after it. Raises ValueError for a row that is not as long as the head."""
    lines = [_row(head), "|" + "---|" * len(head)]
    for row in rows:
        if len(row) != len(head):
            raise ValueError(f"a row of {len(row)} cells beneath a head of {len(head)}")
        lines.append(_row(row))
    return [*lines, ""]


def section(title: str, *paragraphs: str) -> list[str]:
    """A heading of the second level and its text."""
    lines = [f"## {title}", ""]
    for paragraph in paragraphs:
        lines.extend((" ".join(paragraph.split()), ""))
    return lines


def picture(title: str, file: str) -> list[str]:
    """An image on a line of its own."""
    return [f"![{title}]({file})", ""]


def fixed(value: float, digits: int = 3) -> str:
    """A number for a table: "n/a" for NaN, "never" for infinity."""
    if math.isnan(value):
        return "n/a"
    return f"{value:.{digits}f}" if math.isfinite(value) else "never"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
