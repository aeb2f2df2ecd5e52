"""The index files of a TUM RGB-D folder: exact times, index lines, pairs of colour and depth."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from pathlib import Path

from hal.cameras.recording import SkippedFrame
from hal.errors import BadRecording

# Times must fit the int64 of captured_ns.
_MAX_STAMP_S = Decimal(2**63 - 1).scaleb(-9)


@dataclass(frozen=True, slots=True)
class IndexEntry:
    """One image: its time, and its path relative to the folder."""

    stamp_ns: int
    file: str


@dataclass(frozen=True, slots=True)
class ImageIndex:
    """rgb.txt or depth.txt: entries with strictly increasing times.

    bad_lines: lines that cannot be used.
    duplicates: number of images with the time of an earlier one, which are left out: two frames of the same
        time cannot be compared.
    unsorted: number of lines with an earlier time than the line before.
    """

    entries: tuple[IndexEntry, ...]
    bad_lines: tuple[SkippedFrame, ...]
    duplicates: int
    unsorted: int


def parse_stamp_ns(text: str) -> int:
    """Convert decimal seconds to whole nanoseconds, exactly.

    A float would round 1305031236.733922 to 0.2 microseconds. Raises ValueError.
    """
    try:
        seconds = Decimal(text)
    except InvalidOperation:
        raise ValueError(f"{text!r} is not a time in seconds") from None
    if not seconds.is_finite() or not -_MAX_STAMP_S <= seconds <= _MAX_STAMP_S:
        raise ValueError(f"{text!r} is not a possible time in seconds")
    return int(seconds.scaleb(9).to_integral_value())


def format_stamp(stamp_ns: int) -> str:
    """Whole nanoseconds as decimal seconds; the inverse of parse_stamp_ns."""
    return f"{Decimal(stamp_ns).scaleb(-9):.9f}"


def content_lines(path: Path) -> list[tuple[int, str]]:
    """(line number, text) of every line that is not blank or a # comment. Raises BadRecording."""
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise BadRecording(f"{path}: cannot be read ({error.strerror}); check the recording") from error
    stripped = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in stripped if line and not line.startswith("#")]


def read_index(path: Path) -> ImageIndex:
    """Read ``time path`` lines, sorted by time. Raises BadRecording if the file cannot be read."""
    entries: list[IndexEntry] = []
    bad_lines: list[SkippedFrame] = []
    for number, line in content_lines(path):
        where = f"{path.name}:{number}"
        parts = line.split(maxsplit=1)
        if len(parts) != 2:
            bad_lines.append(SkippedFrame(where, f"is not a time and a path: {line!r}"))
            continue
        try:
            entries.append(IndexEntry(parse_stamp_ns(parts[0]), parts[1]))
        except ValueError as error:
            bad_lines.append(SkippedFrame(where, str(error)))
    unsorted = sum(b.stamp_ns < a.stamp_ns for a, b in pairwise(entries))
    first_of_time: dict[int, IndexEntry] = {}
    for entry in entries:
        first_of_time.setdefault(entry.stamp_ns, entry)
    ordered = tuple(first_of_time[stamp_ns] for stamp_ns in sorted(first_of_time))
    return ImageIndex(ordered, tuple(bad_lines), len(entries) - len(ordered), unsorted)


def associate(colour_ns: Sequence[int], depth_ns: Sequence[int], max_gap_ns: int) -> list[tuple[int, int]]:
    """Pairs (index of colour, index of depth) in time order; both inputs strictly increase.

    As in the benchmark's own associate.py: of all candidate pairs not further apart than max_gap_ns, the
    closest is taken first, and each image is used once. A couple that would reverse the order of depth next
    to a closer couple is not used.
    """
    candidates: list[tuple[int, int, int]] = []
    for i, stamp_ns in enumerate(colour_ns):
        j = bisect_left(depth_ns, stamp_ns - max_gap_ns)
        while j < len(depth_ns) and depth_ns[j] <= stamp_ns + max_gap_ns:
            candidates.append((abs(depth_ns[j] - stamp_ns), i, j))
            j += 1
    pairs: list[tuple[int, int]] = []
    for _, i, j in sorted(candidates):
        position = bisect_left(pairs, (i, j))
        follows_previous = position == 0 or (pairs[position - 1][0] < i and pairs[position - 1][1] < j)
        precedes_next = position == len(pairs) or (i < pairs[position][0] and j < pairs[position][1])
        if follows_previous and precedes_next:
            pairs.insert(position, (i, j))
    return pairs
