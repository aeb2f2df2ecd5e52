"""The one request whose answer is awaited: its time, the pause after it, and how late an answer came."""

from __future__ import annotations

import pytest

from hal.chassis.outstanding import OutstandingRequest
from tests.support.chassis_rig import MS

LATE = "the last answer came 70 ms after its request, too late: the limit is 40 ms"


@pytest.fixture
def timed_out() -> OutstandingRequest[str]:
    """One that was asked for "a" at 10 ms and gave up at 50 ms."""
    outstanding = OutstandingRequest[str](timeout_ns=40 * MS, silence_ns=10 * MS)
    assert outstanding.idle(0)
    outstanding.begin("a", 10 * MS)
    assert not outstanding.idle(1000 * MS)
    assert not outstanding.expired(50 * MS - 1)
    assert outstanding.expired(50 * MS)
    outstanding.fail(50 * MS)
    return outstanding


def test_after_a_missing_answer_there_is_a_pause(timed_out: OutstandingRequest[str]) -> None:
    assert timed_out.request is None
    assert not timed_out.expired(1000 * MS)
    assert [timed_out.idle(now_ns) for now_ns in (60 * MS - 1, 60 * MS)] == [False, True]


def test_a_stray_answer_is_late_only_for_what_timed_out_and_prolongs_the_pause(
    timed_out: OutstandingRequest[str],
) -> None:
    timed_out.note_stray(lambda request: request == "b", 55 * MS)
    assert timed_out.late_answer == ""
    timed_out.note_stray(lambda request: request == "a", 80 * MS)
    assert timed_out.late_answer == LATE
    assert [timed_out.idle(now_ns) for now_ns in (90 * MS - 1, 90 * MS)] == [False, True]


def test_an_answer_in_time_ends_what_was_late_and_an_acknowledgement_does_not(
    timed_out: OutstandingRequest[str],
) -> None:
    timed_out.note_late(lambda request: True, 80 * MS)
    timed_out.begin("b", 100 * MS)
    timed_out.acknowledged()
    assert timed_out.late_answer == LATE
    assert timed_out.idle(100 * MS)
    timed_out.begin("c", 100 * MS)
    timed_out.answered()
    timed_out.note_late(lambda request: True, 120 * MS)
    assert timed_out.late_answer == "", "nothing that timed out is still to come"


def test_what_failed_in_time_is_never_late() -> None:
    outstanding = OutstandingRequest[str](timeout_ns=40 * MS, silence_ns=10 * MS)
    outstanding.begin("a", 0)
    outstanding.fail(20 * MS)
    outstanding.note_late(lambda request: True, 80 * MS)
    assert outstanding.late_answer == ""


def test_an_abandoned_request_leaves_the_line_alone_for_as_long_as_its_answer_may_take() -> None:
    outstanding = OutstandingRequest[str](timeout_ns=40 * MS, silence_ns=10 * MS)
    outstanding.abandon(5 * MS)
    assert outstanding.idle(5 * MS), "there was none"
    outstanding.begin("a", 5 * MS)
    outstanding.abandon(10 * MS)
    assert [outstanding.idle(now_ns) for now_ns in (50 * MS - 1, 50 * MS)] == [False, True]
