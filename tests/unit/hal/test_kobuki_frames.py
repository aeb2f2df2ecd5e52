"""Frames of a Kobuki that come late, in pieces, or after nobody listened for a while."""

from __future__ import annotations

from itertools import count

import pytest

from hal.types import ChassisMode
from tests.support.chassis_rig import MS
from tests.support.kobuki_bench import STOP, Bench


@pytest.mark.parametrize(
    ("stall_ms", "mode", "reason"),
    [
        (480, ChassisMode.ARMED, "armed"),
        (520, ChassisMode.ARMED, "armed"),
        (600, ChassisMode.ARMED, "armed"),
        (620, ChassisMode.ESTOP, "the control loop stood still for 620 ms"),
    ],
)
def test_a_loop_that_stood_still_is_no_restart(stall_ms: int, mode: ChassisMode, reason: str) -> None:
    """Its frames waited: the first of them is a period after the last one that was read, by its own clock."""
    bench = Bench()
    bench.arm()
    bench.run(50, 0.4)
    state = bench.step(0.4, after_ms=stall_ms)
    assert (state.mode, state.reason) == (mode, reason)


def test_clock_jump_behind_buffered_data_before_the_consent_is_no_restart() -> None:
    """Of five seconds the port kept the first: the base's clock jumps, behind what had waited."""
    bench = Bench()
    kept = 0

    def keep(data: bytes) -> bytes:
        nonlocal kept
        kept += len(data)
        return data if kept < 2000 else b""

    bench.near.set_filter(keep)
    bench.now_ns += 5000 * MS
    bench.emulator.advance_to(bench.now_ns)
    bench.near.restore_wire()
    bench.chassis.arm(bench.now_ns)
    assert bench.run(3).mode is ChassisMode.ARMED


@pytest.mark.parametrize("bytes_a_read", [1, 9, 60])
def test_short_reads_leave_nothing_to_grow_old(bytes_a_read: int) -> None:
    bench = Bench()
    bench.near.limit_reads(bytes_a_read)
    bench.arm()
    bench.run(200, 0.4)
    bench.emulator.bumper = 2
    assert "bumper pressed" in bench.step(0.4).reason


def test_frames_that_come_later_and_later_are_no_feedback() -> None:
    """A line that loses time passes on what was true seconds ago, and the bumper's news with it."""
    bench = Bench()
    bench.arm()
    bench.run(50, 0.4)
    waiting: list[bytes] = []
    numbers = count(1)

    def late(data: bytes) -> bytes:
        """Two of three frames; the rest waits."""
        waiting.append(data)
        return waiting.pop(0) if next(numbers) % 3 else b""

    bench.near.set_filter(late)
    states = [bench.step(0.4) for _ in range(60)]
    lost = next(state for state in states if state.mode is ChassisMode.LOST)
    assert lost.reason.startswith("no motion feedback for 2")
    assert bench.near.written == [STOP]
