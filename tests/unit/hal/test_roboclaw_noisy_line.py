"""The RoboClaw driver on a line that garbles answers or delays them."""

from __future__ import annotations

from random import Random

import pytest

from hal.types import ChassisMode
from tests.support.chassis_rig import MS
from tests.support.roboclaw_bench import Bench
from tests.support.serial_bench import every


def flipped(data: bytes, draw: Random) -> bytes:
    """With one wrong bit somewhere."""
    return bytes(
        a ^ b for a, b in zip(data, (1 << draw.randrange(8 * len(data))).to_bytes(len(data)), strict=True)
    )


def test_a_noisy_line_ends_no_drive() -> None:
    """One wrong bit in 5 % of the answers, for two minutes."""
    bench, draw = Bench(), Random(0)
    bench.arm()
    bench.near.set_filter(lambda data: flipped(data, draw) if draw.random() < 0.05 else data)
    assert {bench.step(0.5).mode for _ in range(6000)} == {ChassisMode.ARMED}


def test_garbled_encoders_are_asked_for_again_before_the_next_motion_command() -> None:
    bench = Bench()
    bench.arm()
    bench.near.set_filter(
        every(2, lambda data: data[:-1] + bytes((data[-1] ^ 1,)) if len(data) == 10 else data)
    )
    ages_ms = []
    for _ in range(200):
        state = bench.step(0.5)
        assert state.feedback_ns is not None
        ages_ms.append((state.stamp_ns - state.feedback_ns) / MS)
    assert max(ages_ms) <= 100


def test_encoders_that_are_garbled_for_good_end_the_drive_as_silence_does() -> None:
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    bench.near.set_filter(lambda data: data[:-1] + b"?" if len(data) == 10 else data)
    states = [bench.step(0.5)]
    while states[-1].mode is ChassisMode.ARMED:
        states.append(bench.step(0.5))
    assert states[-1].reason.startswith("no motion feedback for 3")
    assert len(states) <= 17
    assert {state.v_mps for state in states} == {states[0].v_mps}, "nothing garbled is believed"
    assert bench.run(50, 0.5).mode is ChassisMode.LOST
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=0.01), "zeros have their turn all the same"


@pytest.mark.parametrize(("delay_ms", "told_ms"), [(40, 60), (60, 80)])
def test_answers_that_come_too_late_are_told_so(delay_ms: int, told_ms: int) -> None:
    late = f"the last answer came {told_ms} ms after its request, too late: the limit is 30 ms"
    bench = Bench()
    bench.arm()
    bench.delay_answers(delay_ms)
    state = bench.run(40)
    assert state.mode is ChassisMode.LOST
    assert state.reason == f"no motion feedback for 320 ms: {late}"
    unheard = Bench()
    unheard.delay_answers(delay_ms)
    unheard.chassis.arm(0)
    assert unheard.run(160).reason == f"arming gave up after 3.0 s: no status heard from the base: {late}"
