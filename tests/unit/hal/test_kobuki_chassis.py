"""The Kobuki driver by the frames it writes and hears, with switches, wraps and noise."""

from __future__ import annotations

import math
import struct

import pytest

from hal.chassis.kobuki import KobukiChassis
from hal.chassis.kobuki_packets import TICK_M, base_control
from hal.types import ChassisMode
from tests.support.chassis_rig import KOBUKI_PLANT, MS, kobuki_config
from tests.support.kobuki_bench import STOP, Bench
from tests.support.serial_bench import arming_failure_reason, every


def test_standby_says_zero_every_period() -> None:
    bench = Bench()
    for _ in range(5):
        bench.step(0.5)
        assert bench.near.written == [STOP]


def test_the_frames_of_a_drive_byte_for_byte() -> None:
    bench = Bench(slip_factor=1.25)
    bench.arm()
    bench.step(0.3, 0.4)
    assert bench.near.written == [bytes.fromhex("AA 55 06 01 04 65 01 58 02 3D")], "0.5 rad/s for 0.4 true"
    bench.near.written.clear()
    bench.chassis.stop(bench.now_ns)
    assert bench.near.written == [STOP]


def test_the_stop_goes_out_when_nothing_comes_back() -> None:
    """The vendor's driver writes only in answer to a frame."""
    bench = Bench()
    bench.arm()
    bench.run(50, 0.4)
    bench.near.cut_wire()
    state = bench.run(15, 0.4)
    assert (state.mode, bench.near.written) == (ChassisMode.LOST, [STOP])
    bench.emulator.advance_to(bench.now_ns + 100 * MS)
    assert bench.plant.twist[0] < 0.3


def test_a_zero_that_replaces_motion_does_not_wait_for_the_period() -> None:
    bench = Bench()
    bench.arm()
    bench.step(0.5)
    assert bench.step(0.6, after_ms=1).sent is None
    assert bench.step(0.0, after_ms=1).sent is not None
    assert bench.near.written == [STOP]


@pytest.mark.parametrize(
    ("switch", "bits", "words"),
    [
        ("bumper", 1, "bumper pressed (right)"),
        ("bumper", 6, "bumper pressed (centre), bumper pressed (left)"),
        ("cliff", 4, "cliff (left)"),
        ("wheel_drop", 1, "wheel dropped (right)"),
        ("wheel_drop", 8, "wheel dropped (unknown bit 3)"),
        ("charger", 22, "the charging cable is plugged in"),
        ("charger", 16, "unknown state 16 of the charger"),
    ],
)
def test_its_own_sensors_stop_and_latch(switch: str, bits: int, words: str) -> None:
    bench = Bench()
    bench.arm()
    bench.run(50, 0.4)
    setattr(bench.emulator, switch, bits)
    state = bench.run(2, 0.4)
    assert (state.mode, state.reason) == (
        ChassisMode.ESTOP,
        f"emergency stop by the base's own sensors: {words}",
    )
    assert bench.near.written == [STOP]
    setattr(bench.emulator, switch, 0)
    assert bench.run(100, 0.4).mode is ChassisMode.ESTOP, "only consent leads out"
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)
    bench.arm()


def test_docked_base_may_drive_off() -> None:
    bench = Bench()
    bench.emulator.charger = 2
    bench.arm()
    assert bench.run(100, 0.4).mode is ChassisMode.ARMED
    assert bench.plant.twist[0] == pytest.approx(0.4, abs=0.02)


def test_over_current_is_told() -> None:
    bench = Bench()
    bench.arm()
    bench.emulator.over_current = 1
    state = bench.run(2, 0.3)
    assert (state.mode, state.faults) == (ChassisMode.ARMED, ("error: motor over-current (left)",))


WARNING, ERROR = "warning: battery below 14 V", "error: battery below 13.2 V"


@pytest.mark.parametrize(
    ("battery_v", "at_once", "after_3_s"),
    [(14.0, (), ()), (13.9, (), (WARNING,)), (13.2, (), (WARNING,)), (12.5, (ERROR,), (ERROR, WARNING))],
)
def test_a_low_battery_is_told(
    battery_v: float, at_once: tuple[str, ...], after_3_s: tuple[str, ...]
) -> None:
    """A start pulls the voltage down for a moment: only what the vendor calls dangerous is told at once."""
    bench = Bench()
    bench.arm()
    bench.emulator.battery_v = battery_v
    state = bench.run(2, 0.3)
    assert (state.mode, state.faults) == (ChassisMode.ARMED, at_once)
    state = bench.run(160, 0.3)
    assert (state.mode, state.faults) == (ChassisMode.ARMED, after_3_s)


def test_ticks_and_clock_wrap() -> None:
    """65 536 ticks are 5.59 m, the clock wraps after 65.5 s: 80 s at 0.3 m/s pass both."""
    bench = Bench()
    bench.arm()
    states = [bench.step(0.3) for _ in range(4000)]
    assert {state.mode for state in states} == {ChassisMode.ARMED}
    assert pytest.approx(5.59, abs=0.01) == 65_536 * TICK_M
    assert states[-1].pose.x_m > 4 * 5.59
    assert states[-1].pose.x_m == pytest.approx(bench.plant.pose.x_m, abs=0.01)


def test_speed_is_by_the_base_s_own_clock() -> None:
    """Frames that waited in a buffer and come together do not make it faster."""
    bench = Bench()
    bench.arm()
    bench.run(60, 0.4)
    for after_ms in (20, 60, 10, 30, 20, 90, 20):
        assert bench.step(0.4, after_ms=after_ms).v_mps == pytest.approx(0.4, abs=0.006)


@pytest.mark.parametrize("gyro", [True, False])
def test_yaw_is_the_gyro_s_or_the_wheels(gyro: bool) -> None:
    """With the wrong slip factor only the gyro knows how far it really turned."""
    bench = Bench(slip_factor=1.0)
    bench.emulator.gyro = gyro
    bench.arm()
    bench.run(100, 0.2, 0.5)
    state = bench.run(50)
    believed = 1.0 if gyro else KOBUKI_PLANT.slip_factor
    assert state.pose.heading_rad == pytest.approx(believed * bench.plant.pose.heading_rad, abs=0.005)
    assert bench.plant.pose.heading_rad > 0.8


def test_the_gyro_s_angle_wraps() -> None:
    bench = Bench()
    bench.arm()
    turned = 0.0
    last = 0.0
    for _ in range(500):
        heading = bench.step(0.0, 1.0).pose.heading_rad
        turned += math.remainder(heading - last, math.tau)
        last = heading
    assert turned > 1.4 * math.tau
    # The pose is brought forward to the exchange by up to one period.
    assert math.remainder(last - bench.plant.pose.heading_rad, math.tau) == pytest.approx(0.0, abs=0.03)


def test_a_restart_shows_in_clock_or_ticks() -> None:
    driving, standing = Bench(), Bench()
    driving.arm()
    driving.run(100, 0.4)
    driving.emulator.restart()
    assert driving.run(3, 0.4).reason.startswith("the base no longer obeys: its clock or its ticks jumped")
    standing.arm()
    standing.run(50)
    standing.emulator.restart()
    state = standing.run(3)
    assert (state.mode, state.reason.split(";")[0]) == (
        ChassisMode.ESTOP,
        "the base no longer obeys: its clock or its ticks jumped: restarted",
    )
    standing.arm()


def test_wrong_checksums_on_the_line_are_survived() -> None:
    bench = Bench()
    bench.arm()
    bench.near.set_filter(every(4, lambda data: data[:9] + bytes((data[9] ^ 0x40,)) + data[10:]))
    states = [bench.step(0.4) for _ in range(300)]
    assert {state.mode for state in states} == {ChassisMode.ARMED}
    assert states[-1].pose.x_m == pytest.approx(bench.plant.pose.x_m, abs=0.01)


def test_nothing_is_known_before_the_second_frame() -> None:
    bench = Bench()
    first, second = bench.step(after_ms=0), bench.step()
    assert (first.feedback_ns, math.isnan(first.v_mps), first.battery_v) == (None, True, 16.2)
    assert (second.feedback_ns, second.v_mps) == (20 * MS, 0.0)


@pytest.mark.parametrize(
    ("babble", "hint"),
    [
        (b"", "not one byte came; check port, power and the switch on the base"),
        (b"FF=0\r", "bytes came, no frame of a Kobuki; check port and baud (115200)"),
    ],
)
def test_a_device_that_is_no_kobuki_is_told_when_arming_gives_up(babble: bytes, hint: str) -> None:
    assert hint in arming_failure_reason(lambda link: KobukiChassis(link, kobuki_config()), babble)


def test_the_fastest_is_the_wire_s_too() -> None:
    bench = Bench()
    bench.arm()
    bench.step(9.0)
    assert bench.near.written == [base_control(0.7, 0.0)]


def test_no_wheel_is_told_to_be_faster_than_it_can() -> None:
    """0.7 m/s and 1 rad/s are 0.84375 m/s of the outer wheel, by 0.115 m and slip."""
    bench = Bench(slip_factor=1.25)
    bench.arm()
    sent = bench.step(0.7, 1.0).sent
    ratio = 0.7 / (0.7 + 0.115 * 1.25)
    assert sent is not None
    assert (sent.v_mps, sent.w_radps) == pytest.approx((0.7 * ratio, ratio))
    assert bench.near.written == [base_control(0.7 * ratio, 1.25 * ratio)]
    speed, radius = struct.unpack_from("<hh", bench.near.written[0], 5)
    assert (speed, radius) == (700, 560)


@pytest.mark.parametrize("gain", [0.0, -1.0, 3.0])
def test_a_gyro_that_does_not_agree_with_the_wheels_latches(gain: float) -> None:
    """Stuck, mounted upside down, or the wheels turn and the base does not."""
    bench = Bench()
    bench.arm()
    bench.emulator.gyro_gain = gain
    for _ in range(125):
        state = bench.step(0.1, 0.8)
        if state.mode is not ChassisMode.ARMED:
            break
    assert state.mode is ChassisMode.ESTOP
    assert state.reason.startswith("gyro and wheels disagree: ")
    assert bench.near.written == [STOP]


def test_an_ordinary_slip_is_no_disagreement() -> None:
    bench = Bench(slip_factor=1.0)  # the plant's is 1.1
    bench.arm()
    assert bench.run(300, 0.2, 1.2).mode is ChassisMode.ARMED
