"""Roboteq's lines byte for byte, by the manual's grammar."""

from __future__ import annotations

import math

import pytest

from hal.chassis import roboteq_lines as lines
from hal.chassis.roboteq_lines import Line, LineReader, MotorFlags, Reply, Value


@pytest.mark.parametrize(
    ("written", "bytes_"),
    [
        (lines.motors(0, 0), b"!M 0 0\r"),
        (lines.motors(250.4, -250.6), b"!M 250 -251\r"),
        (lines.motors(-1e9, math.inf), b"!M -1000 1000\r"),
        (lines.STOP, b"!M 0 0\r"),
        (lines.set_watchdog(300), b"^RWD 300\r"),
        (lines.set_watchdog(0), b"^RWD 1\r"),  # 0 would switch it off
        (lines.set_watchdog(10**6), b"^RWD 65000\r"),
        (lines.ECHO_OFF, b"^ECHOF 1\r"),
        (lines.EMERGENCY_STOP, b"!EX\r"),
        (lines.RELEASE, b"!MG\r"),
        (lines.QUERIES["C"].line, b"?C\r"),
        (lines.QUERIES["CB"].line, b"?CB\r"),
        (lines.QUERIES["FF"].line, b"?FF\r"),
        (lines.QUERIES["FM"].line, b"?FM\r"),
        (lines.QUERIES["RWD"].line, b"~RWD\r"),
    ],
)
def test_written_byte_for_byte(written: bytes, bytes_: bytes) -> None:
    assert written == bytes_


def test_a_speed_that_is_no_number_is_not_written() -> None:
    with pytest.raises(ValueError, match="NaN"):
        lines.motors(math.nan, 0)


@pytest.mark.parametrize(
    ("line", "meaning"),
    [
        (b"+", Reply.ACCEPTED),
        (b"-", Reply.REFUSED),
        (b"!M 0 0", Reply.ECHO),
        (b"?C", Reply.ECHO),
        (b"^ECHOF 1", Reply.ECHO),
        (b"~RWD", Reply.ECHO),
        (b"C=123:-456", Value("C", (123, -456))),
        (b"FF=16", Value("FF", (16,))),
        (b"V=135:246:4998", Value("V", (135, 246, 4998))),
        (b"C=2147483647:-2147483648", Value("C", (2147483647, -2147483648))),
        (b"C=2147483648:0", None),
        (b"C=123", None),
        (b"C=1:2:3", None),
        (b"FF=", None),
        (b"FF=1.5", None),
        (b"FF= 1", None),
        (b"FF=1 ", None),
        (b"\xb2FF=1", None),
        (b"FF=\xb2", None),
        (b"ff=1", None),
        (b"++", None),
        (b"X=1", None),
        (b"", None),
        (b"123", None),
    ],
)
def test_lines_mean_what_the_grammar_says_or_nothing(line: bytes, meaning: Line | None) -> None:
    assert lines.parse(line) == meaning


def test_bytes_become_lines_however_they_arrive() -> None:
    stream = b"+\rC=12:34\r-\rFF=0\r"
    whole = LineReader().feed(stream)
    assert whole == [Reply.ACCEPTED, Value("C", (12, 34)), Reply.REFUSED, Value("FF", (0,))]
    reader = LineReader()
    assert [line for byte in stream for line in reader.feed(bytes((byte,)))] == whole


def test_a_line_without_an_end_does_not_grow_for_ever() -> None:
    reader = LineReader()
    for _ in range(1000):
        assert reader.feed(b"C=1234") == []
    assert len(reader._partial) < 200
    assert reader.feed(b"\r") == []
    assert reader.foreign_lines == 1
    assert reader.feed(b"FF=0\r") == [Value("FF", (0,))]


def test_the_end_of_an_overlong_line_is_no_line() -> None:
    """Cut at its bound, what is kept could read as a right answer."""
    reader = LineReader()
    assert reader.feed(b"C=1:2" + b"0" * 300 + b"\r") == []
    assert reader.feed(b"\r" * 3) == []
    assert reader.foreign_lines == 1, "an empty line is nothing"


def test_fault_flags_are_told_in_words_and_unknown_ones_by_number() -> None:
    assert lines.describe_faults(0) == ()
    assert lines.describe_faults(0x10) == (), "the emergency stop is told apart"
    assert lines.describe_faults(0x07) == (
        "error: controller too hot",
        "error: voltage high",
        "error: voltage low",
    )
    assert lines.describe_faults(0x8100) == ("error: unknown fault bit 8", "error: unknown fault bit 15")


def test_motor_flags_of_both_channels() -> None:
    assert lines.describe_motors((0, 0)) == MotorFlags((), ())
    assert lines.describe_motors((1, 0x86)) == MotorFlags(
        (
            "error: motor 2 stalled",
            "error: motor 2 off its speed (loop error)",
            "error: motor 2 has unknown flag bit 7",
        ),
        ("warning: motor 1 at its current limit",),
    )
