"""Device times on the monotonic clock: smooth, never fresh, never backwards."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hal.cameras.device_clock import DeviceClock

MS = 1_000_000


def test_the_promptest_frame_sets_the_offset_and_late_ones_do_not_move_it() -> None:
    clock = DeviceClock(latency_ns=5 * MS)
    # Device time runs 1000 ms behind; delays of 12, 10, 25 and 11 ms.
    given_ns = [
        clock.captured_ns(device * MS, (device + 1000 + delay) * MS)
        for device, delay in ((0, 12), (33, 10), (66, 25), (99, 11))
    ]
    assert given_ns == [1007 * MS, 1038 * MS, 1071 * MS, 1104 * MS]


def test_an_old_offset_is_forgotten_so_that_drift_is_followed() -> None:
    clock = DeviceClock(latency_ns=0, window=3)
    for number in range(3):
        clock.captured_ns(number * 10 * MS, (number * 10 + 5) * MS)
    later = [clock.captured_ns(number * 10 * MS, (number * 10 + 7) * MS) for number in range(3, 6)]
    assert later[-1] == 57 * MS


def test_a_device_that_starts_over_is_followed_at_once() -> None:
    clock = DeviceClock(latency_ns=0)
    clock.captured_ns(900 * MS, 1000 * MS)
    assert clock.captured_ns(5 * MS, 2000 * MS) == 2000 * MS


def test_a_device_clock_that_jumps_ahead_does_not_make_frames_of_the_future() -> None:
    clock = DeviceClock(latency_ns=0)
    clock.captured_ns(0, 100 * MS)
    assert clock.captured_ns(3_600_000 * MS, 133 * MS) == 133 * MS


def test_other_times_of_the_device_share_the_offset() -> None:
    clock = DeviceClock(latency_ns=2 * MS)
    clock.captured_ns(100 * MS, 1110 * MS)
    assert clock.monotonic_ns(95 * MS) == 1103 * MS


@given(
    st.lists(st.tuples(st.integers(-50, 500), st.integers(1, 100)), min_size=1, max_size=300),
    st.integers(0, 50),
)
def test_never_fresher_than_latency_before_arrival_and_always_later_than_the_one_before(
    steps: list[tuple[int, int]], latency_ms: int
) -> None:
    clock = DeviceClock(latency_ms * MS, window=16)
    device_ns = arrival_ns = 10_000 * MS
    before_ns = None
    for device_step_ms, arrival_step_ms in steps:
        device_ns += device_step_ms * MS
        arrival_ns += arrival_step_ms * MS
        captured_ns = clock.captured_ns(device_ns, arrival_ns)
        assert captured_ns <= arrival_ns - latency_ms * MS
        assert before_ns is None or captured_ns > before_ns
        before_ns = captured_ns
