"""Times, index files and pairs of a TUM folder."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hal.cameras.recording import SkippedFrame
from hal.cameras.tum_index import (
    associate,
    format_stamp,
    parse_stamp_ns,
    read_index,
)
from hal.errors import BadRecording

MS = 1_000_000


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("1305031236.733922", 1305031236_733922000),
        ("1305031236.7331", 1305031236_733100000),
        ("9223372036.854775807", 2**63 - 1),
        ("0", 0),
        ("-0.5", -500_000_000),
        ("1.5e3", 1500_000_000_000),
        ("0.0000000005", 0),
        ("1e-999999999", 0),
        ("0.000000000501", 1),
    ],
)
def test_a_time_is_read_exactly_to_the_nanosecond(text: str, stamp_ns: int) -> None:
    assert parse_stamp_ns(text) == stamp_ns


def test_a_float_would_not_have_been_exact() -> None:
    assert parse_stamp_ns("1305031236.733922") != round(float("1305031236.733922") * 1e9)


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "-inf", "1305031236,73", "rgb/1.png", "1e30", "1e999999999"]
)
def test_impossible_time_stamp_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="time in seconds"):
        parse_stamp_ns(text)


@given(st.integers(-(2**62), 2**62))
def test_a_written_time_is_read_back_the_same(stamp_ns: int) -> None:
    assert parse_stamp_ns(format_stamp(stamp_ns)) == stamp_ns


def write(folder: Path, text: str) -> Path:
    path = folder / "rgb.txt"
    path.write_text(text)
    return path


def test_comments_blank_lines_tabs_and_windows_ends_are_understood(tmp_path: Path) -> None:
    path = write(tmp_path, "\ufeff# color images\r\n\r\n0.5 rgb/a b.png\r\n 1.0\trgb/c.png \r\n")
    index = read_index(path)
    assert [(entry.stamp_ns, entry.file) for entry in index.entries] == [
        (500 * MS, "rgb/a b.png"),
        (1000 * MS, "rgb/c.png"),
    ]
    assert index.bad_lines == ()


def test_bad_lines_are_told_with_file_and_line_number_and_the_others_used(tmp_path: Path) -> None:
    index = read_index(
        write(tmp_path, "# head\n0.1 rgb/a.png\n0.2\nsoon rgb/b.png\n0.4 rgb/c.png\nnan rgb/d.png\n")
    )
    assert [entry.file for entry in index.entries] == ["rgb/a.png", "rgb/c.png"]
    assert index.bad_lines == (
        SkippedFrame("rgb.txt:3", "is not a time and a path: '0.2'"),
        SkippedFrame("rgb.txt:4", "'soon' is not a time in seconds"),
        SkippedFrame("rgb.txt:6", "'nan' is not a possible time in seconds"),
    )


def test_bytes_that_are_not_text_make_bad_lines_not_a_crash(tmp_path: Path) -> None:
    path = tmp_path / "rgb.txt"
    path.write_bytes(b"\x89PNG\xff\xfe\x00\n0.1 rgb/a.png\n")
    index = read_index(path)
    assert [entry.file for entry in index.entries] == ["rgb/a.png"]
    assert [bad.file for bad in index.bad_lines] == ["rgb.txt:1"]


def test_times_that_go_backwards_are_sorted_and_equal_ones_counted_and_left_out(tmp_path: Path) -> None:
    index = read_index(write(tmp_path, "0.3 c\n0.1 a\n0.2 b\n0.2 again\n0.2 and again\n"))
    assert [entry.file for entry in index.entries] == ["a", "b", "c"]
    assert index.duplicates == 2
    assert index.unsorted == 1


def test_an_index_that_cannot_be_read_is_a_bad_recording(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match=r"rgb\.txt: cannot be read"):
        read_index(tmp_path / "rgb.txt")


def test_each_image_takes_the_nearest_of_the_other_kind_once() -> None:
    colour = [0, 33 * MS, 66 * MS, 200 * MS]
    depth = [4 * MS, 40 * MS, 61 * MS, 100 * MS]
    assert associate(colour, depth, 20 * MS) == [(0, 0), (1, 1), (2, 2)]


def test_the_closest_couple_is_taken_first() -> None:
    # Colour 0 is within reach of depth 0 alone, but colour 1 is closer to it.
    assert associate([0, 12 * MS], [10 * MS], 20 * MS) == [(1, 0)]


def test_the_greatest_gap_still_counts_and_one_nanosecond_more_does_not() -> None:
    assert associate([0], [20 * MS], 20 * MS) == [(0, 0)]
    assert associate([0], [20 * MS + 1], 20 * MS) == []


def test_slow_recordings_with_equal_times_pair_one_to_one() -> None:
    stamps = [number * 120 * MS for number in range(24)]
    assert associate(stamps, stamps, 20 * MS) == [(number, number) for number in range(24)]


def test_pairs_never_cross_in_time() -> None:
    # The closest couple (0, 1) would leave colour 1 to the earlier depth 0.
    assert associate([0, 10 * MS], [-5 * MS, 1 * MS], 20 * MS) == [(0, 1)]


def test_a_couple_that_would_go_back_in_time_does_not_cost_a_closer_one() -> None:
    assert associate([0, 10 * MS], [10 * MS, 20 * MS], 20 * MS) == [(1, 0)]


@given(
    st.lists(st.integers(0, 300), unique=True).map(sorted),
    st.lists(st.integers(0, 300), unique=True).map(sorted),
    st.integers(0, 40),
)
def test_pairs_are_close_unique_and_in_time_order(colour: list[int], depth: list[int], gap: int) -> None:
    pairs = associate(colour, depth, gap)
    assert all(abs(colour[i] - depth[j]) <= gap for i, j in pairs)
    assert all(b[0] > a[0] and b[1] > a[1] for a, b in pairwise(pairs))
    # Nobody is left out who has a partner within reach that nobody else could have.
    reach = [(i, j) for i, s in enumerate(colour) for j, t in enumerate(depth) if abs(s - t) <= gap]
    for i, j in reach:
        if sum(a == i for a, _ in reach) == 1 and sum(b == j for _, b in reach) == 1:
            assert (i, j) in pairs
