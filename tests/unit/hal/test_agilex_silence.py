"""What an AgileX base does not say, and what is told of it when arming gives up."""

from __future__ import annotations

import pytest

from hal.chassis.agilex_messages import AgilexMessage, MotionFeedback, Odometer, encode
from hal.types import CanFrame, ChassisMode
from tests.support.agilex_bench import Bench, state


@pytest.mark.parametrize(
    ("frames", "hint"),
    [
        ([], "not one frame came; check power, wiring, termination and 500 kbit/s"),
        ([CanFrame(0x151, bytes(8)), CanFrame(0x171, bytes(8))], "frames of protocol V1 came"),
        ([CanFrame(0x7E8, bytes(8))], "only foreign frames came, such as 0x7E8; is this the base's bus?"),
        ([encode(MotionFeedback(0.0, 0.0))], "0x221 came, but no 0x211"),
    ],
)
def test_failed_arming_reports_what_was_received_instead(frames: list[CanFrame], hint: str) -> None:
    bench = Bench()
    bench.chassis.arm(0)
    for _ in range(160):
        bench.link.deliver(*frames)
        seen = bench.exchange()
    assert seen.mode is ChassisMode.STANDBY
    assert seen.reason.startswith("arming gave up after 3.0 s: no status heard from the base: ")
    assert hint in seen.reason


@pytest.mark.parametrize(
    ("heard", "hint"),
    [
        (
            MotionFeedback(0.0, 0.0),
            "0x221 came, but no odometer 0x311; set chassis.track_width_m: null to reckon",
        ),
        (Odometer(0, 0), "0x211 came, but no 0x221"),
    ],
)
def test_failed_arming_reports_what_dead_reckoning_lacks(heard: AgilexMessage, hint: str) -> None:
    bench = Bench(track_width_m=0.5)
    bench.chassis.arm(0)
    for _ in range(160):
        bench.deliver(state(), heard)
        seen = bench.exchange()
    assert seen.mode is ChassisMode.STANDBY
    begins = "arming gave up after 3.0 s: no motion feedback heard from the base: "
    assert seen.reason.startswith(begins + hint)
