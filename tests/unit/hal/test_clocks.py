from hal.clocks import MonotonicClock, SimulatedClock


def test_a_simulated_clock_stands_still_until_told() -> None:
    clock = SimulatedClock(start_ns=5)
    assert clock.now_ns() == clock.now_ns() == 5
    clock.sleep_until_ns(40)
    assert clock.now_ns() == 40


def test_a_simulated_clock_never_goes_back() -> None:
    clock = SimulatedClock(start_ns=50)
    clock.sleep_until_ns(40)
    assert clock.now_ns() == 50


def test_the_monotonic_clock_returns_at_or_after_the_deadline() -> None:
    clock = MonotonicClock()
    deadline_ns = clock.now_ns() + 2_000_000
    clock.sleep_until_ns(deadline_ns)
    assert clock.now_ns() >= deadline_ns


def test_a_passed_deadline_does_not_wait() -> None:
    clock = MonotonicClock()
    before_ns = clock.now_ns()
    clock.sleep_until_ns(before_ns - 10**12)
    assert clock.now_ns() - before_ns < 10**9
