"""The Roboteq driver by the bytes it writes and reads, with a line that misbehaves."""

from __future__ import annotations

from itertools import cycle, pairwise

import pytest

from hal.types import ChassisMode
from tests.support.chassis_rig import MS
from tests.support.roboteq_bench import Bench
from tests.support.serial_bench import every, first_with_speed


def test_echo_off_watchdog_and_release_are_sent_with_consent_and_read_back() -> None:
    bench = Bench()
    bench.run(10)
    assert (bench.emulator.echo, bench.emulator.watchdog_ms) == (True, 1000), "left alone without consent"
    bench.chassis.arm(bench.now_ns)
    bench.step()
    assert bench.written()[:6] == [b"!M 0 0", b"^ECHOF 1", b"^RWD 300", b"!MG", b"!M 0 0", b"~RWD"]
    bench.arm()
    assert (bench.emulator.echo, bench.emulator.watchdog_ms) == (False, 300)


def test_one_motion_line_and_one_question_each_period() -> None:
    """0.5 m/s and 0.4 rad/s: tracks of 0.555 m * 1.1, full speed 1 m/s."""
    bench = Bench()
    bench.arm()
    half_mps = 0.5 * 0.4 * 0.555 * 1.1
    motion = f"!M {round(500 - 1000 * half_mps)} {round(500 + 1000 * half_mps)}".encode()
    assert motion == b"!M 378 622"
    asked = set()
    for _ in range(18):
        state = bench.step(0.5, 0.4)
        assert bench.written()[0] == motion
        assert len(bench.written()) == 2
        asked.add(bench.written()[1])
        assert state.sent is not None
        assert (state.sent.v_mps, state.sent.w_radps) == (0.5, 0.4)
    assert asked == {b"?C", b"?FF", b"?FM", b"~RWD", b"?V", b"?A"}


@pytest.mark.parametrize(("query", "apart"), [(b"?C", 2), (b"?FF", 6), (b"?FM", 6), (b"~RWD", 18)])
def test_either_half_of_the_status_is_asked_for_as_often(query: bytes, apart: int) -> None:
    bench = Bench()
    bench.arm()
    asked: list[bytes] = []
    for _ in range(54):
        bench.step(0.5)
        asked.append(bench.written()[1])
    turns = [turn for turn, question in enumerate(asked) if question == query]
    assert {later - turn for turn, later in pairwise(turns)} == {apart}


def test_hall_sensors_are_asked_for_by_their_own_name() -> None:
    bench = Bench(encoder="hall")
    bench.arm()
    lines: list[bytes] = []
    for _ in range(18):
        bench.step(0.3)
        lines += bench.written()
    assert b"?CB" in lines
    assert b"?C" not in lines
    assert bench.step(0.3).v_mps > 0.1


def test_a_faster_loop_does_not_flood_the_line() -> None:
    bench = Bench()
    bench.arm()
    count = 0
    for _ in range(200):
        bench.step(0.1, after_ms=5)
        count += len(bench.near.written)
    assert count == pytest.approx(50, abs=17)
    assert bench.step(0.1, after_ms=5).mode is ChassisMode.ARMED


def test_a_zero_that_replaces_motion_does_not_wait_for_the_period() -> None:
    bench = Bench()
    bench.arm()
    bench.step(0.5)
    assert bench.step(0.6, after_ms=1).sent is None
    assert bench.step(0.0, after_ms=1).sent is not None
    assert bench.written()[0] == b"!M 0 0"


def test_after_a_gap_zero_is_said_first() -> None:
    """The motors that the watchdog stopped would run on with whatever comes first."""
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    bench.step(0.5, after_ms=160)
    assert bench.written()[:2] == [b"!M 0 0", b"!M 500 500"], "no gap for the watchdog, but nearly"
    bench.step(0.5, after_ms=700)
    assert bench.written()[:2] == [b"!M 0 0", b"!M 0 0"], "the loop hung: latched"


def test_after_a_failed_write_zero_is_said_first() -> None:
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    bench.near.fail_writes(1)
    assert bench.step(0.5).mode is ChassisMode.LOST
    bench.run(40)
    bench.chassis.arm(bench.now_ns)
    bench.step()
    assert bench.written()[0] == b"!M 0 0"


def test_stop_says_zero_even_on_a_line_that_fails() -> None:
    bench = Bench()
    bench.arm()
    bench.run(20, 0.5)
    bench.near.written.clear()
    bench.chassis.stop(bench.now_ns)
    assert bench.near.written == [b"!M 0 0\r"]
    bench.near.fail_writes(1)
    bench.chassis.stop(bench.now_ns)
    bench.chassis.stop(bench.now_ns)
    assert bench.near.written == [b"!M 0 0\r"] * 2, "one was lost"


def test_single_refusals_are_survived() -> None:
    bench = Bench()
    bench.arm()
    bench.far.set_filter(every(3, lambda data: data.replace(b"!M", b"!N")))
    assert bench.run(100, 0.3).mode is ChassisMode.ARMED
    assert bench.emulator.refused > 20


def test_lost_answers_are_survived() -> None:
    """Every fifth answer loses its name: the drive goes on, and nothing wrong is believed."""
    bench = Bench()
    bench.arm()
    bench.near.set_filter(every(5, lambda data: data.replace(b"=", b"?")))
    states = [bench.step(0.5) for _ in range(400)]
    assert {state.mode for state in states} == {ChassisMode.ARMED}
    assert states[-1].v_mps == pytest.approx(0.5, abs=0.005)
    assert states[-1].pose.x_m == pytest.approx(bench.plant.pose.x_m, abs=0.02)


def test_echo_is_no_answer() -> None:
    """A controller that goes on echoing is understood all the same."""
    bench = Bench()
    bench.far.set_filter(lambda data: data.replace(b"^ECHOF 1\r", b""))
    bench.arm()
    assert bench.emulator.echo
    assert bench.run(100, 0.5).v_mps == pytest.approx(0.5, abs=0.005)


def test_a_counter_that_noise_made_is_dropped_like_a_lost_answer() -> None:
    """One wrong digit in every third answer of the counters."""
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    spoil = every(3, lambda line: line.replace(b"C=", b"C=9"))
    bench.near.set_filter(lambda data: spoil(data) if b"C=" in data else data)
    states = [bench.step(0.5) for _ in range(100)]
    assert {state.mode for state in states} == {ChassisMode.ARMED}
    assert all(state.v_mps == pytest.approx(0.5, abs=0.01) for state in states)
    assert states[-1].pose.x_m == pytest.approx(bench.plant.pose.x_m, abs=0.02)
    assert max(s.stamp_ns - s.feedback_ns for s in states if s.feedback_ns is not None) <= 100 * MS


def test_a_counter_that_jumps_and_stays_there_is_a_restart_within_two_answers() -> None:
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    bench.near.set_filter(lambda data: data.replace(b"C=", b"C=9"))
    state = bench.run(5, 0.5)
    assert state.reason.startswith("the base no longer obeys: its counters jumped: restarted")
    assert state.pose.x_m < 1.0


def test_counters_that_are_never_plausible_end_the_drive_as_silence_does() -> None:
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    noise = cycle((b"C=9", b"C=-7", b"C=5"))
    bench.near.set_filter(lambda data: data.replace(b"C=", next(noise)) if b"C=" in data else data)
    state = bench.run(17, 0.5)
    assert (state.mode, state.reason) == (ChassisMode.LOST, "no motion feedback for 320 ms")
    assert state.pose.x_m < 1.2


@pytest.mark.parametrize(("delay_ms", "told_ms"), [(40, 60), (60, 80)])
def test_answers_that_come_too_late_are_told_so(delay_ms: int, told_ms: int) -> None:
    late = f"the last answer came {told_ms} ms after its request, too late: the limit is 40 ms"
    bench = Bench()
    bench.arm()
    bench.delay_answers(delay_ms)
    state = bench.run(40)
    assert (state.mode, state.reason) == (ChassisMode.LOST, f"no motion feedback for 320 ms: {late}")
    unheard = Bench()
    unheard.delay_answers(delay_ms)
    unheard.chassis.arm(0)
    assert unheard.run(160).reason == f"arming gave up after 3.0 s: no status heard from the base: {late}"


def test_mirrored_motors_drive_and_count_the_other_way() -> None:
    bench = Bench(invert_right=True)
    bench.arm()
    bench.step(0.5)
    assert bench.written()[0] == b"!M 500 -500"
    state = bench.run(60, 0.5)
    assert abs(bench.plant.track_twist[0]) < 0.01, "in the emulator channel 2 is not mirrored: it turns"
    assert state.v_mps == pytest.approx(0.5, abs=0.01), "but the driver believes in its mirror"


def test_the_fastest_speed_holds_for_each_track() -> None:
    bench = Bench()
    bench.arm()
    state = bench.step(0.9, 1.8)
    assert state.sent is not None
    assert state.sent.v_mps + 0.5 * state.sent.w_radps * 0.555 * 1.1 == pytest.approx(1.0)
    assert state.sent.w_radps == pytest.approx(2.0 * state.sent.v_mps)
    assert bench.written()[0].endswith(b" 1000")


def test_nothing_is_known_before_the_second_counter_answer() -> None:
    bench = Bench()
    assert first_with_speed([bench.step() for _ in range(20)]) >= 3


def test_silence_after_answers_in_time_is_not_told_as_late() -> None:
    bench = Bench()
    bench.arm()
    bench.delay_answers(40)
    bench.run(6)
    bench.delay_answers(0)
    assert bench.run(30).mode is ChassisMode.ARMED
    bench.near.cut_wire()
    assert bench.run(20).reason == "no motion feedback for 320 ms"
