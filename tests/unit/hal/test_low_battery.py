"""A low battery is told by voltage alone, with every base that reports one."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from config.chassis import AgilexChassisConfig
from hal.chassis.agilex_models import battery_low_v_of
from hal.chassis.low_battery import LowBattery
from hal.chassis.roboclaw import RoboclawChassis
from hal.clocks import NS_PER_S
from hal.types import ChassisMode, ChassisState
from sim.emulators.roboclaw import RoboclawEmulator
from sim.emulators.roboteq import RoboteqEmulator
from tests.support.agilex_bench import Bench, state
from tests.support.chassis_rig import COUNTS_PER_M, PLANT, roboclaw_config
from tests.support.kobuki_bench import Bench as KobukiBench
from tests.support.roboteq_bench import Bench as RoboteqBench
from tests.support.serial_bench import SerialBench

LINK = {"interface": "virtual", "channel": "test"}


def told(limit_v: float | None, *voltages_v: float) -> list[str]:
    """What is told, with one voltage a second."""
    battery = LowBattery(limit_v)
    sentences = []
    for second, voltage_v in enumerate(voltages_v):
        battery.step(voltage_v, second * NS_PER_S)
        sentences.append(battery.sentence)
    return sentences


def test_lasting_low_voltage_is_reported_and_a_dip_is_not() -> None:
    low = "warning: battery below 22.5 V"
    assert told(22.5, 24.0, 22.0, 22.0, 22.0, 22.0, 24.0) == ["", "", "", "", low, ""]
    assert not any(told(22.5, 22.0, 22.0, 23.0, 22.0, 22.0, 22.0))


def test_without_a_limit_or_a_voltage_nothing_is_told() -> None:
    assert not any(told(None, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert not any(told(22.5, *[math.nan] * 6))


def driven(bench: Bench, battery_v: float) -> ChassisState:
    bench.arm()
    for _ in range(200):
        bench.deliver(state(battery_v=battery_v))
        now = bench.exchange(0.0)
    return now


def test_agilex_tells_of_a_voltage_without_a_fault_bit() -> None:
    faults = driven(Bench(model="bunker", battery_low_v=46.0), 45.5).faults
    assert faults == ("warning: battery below 46 V",)
    assert driven(Bench(model="bunker", battery_low_v=46.0), 46.0).faults == ()
    assert driven(Bench(model="bunker"), 1.0).faults == (), "no manual gives its voltage"
    assert driven(Bench(model="scout", actuators=2), 22.0).faults == ("warning: battery below 22.5 V",)


@pytest.mark.parametrize(
    ("keys", "low_v"),
    [
        ({"model": "scout"}, 22.5),
        ({"model": "tracer"}, 22.5),
        ({"model": "bunker"}, None),
        ({"model": "scout", "battery_low_v": None}, None),
        ({"model": "scout", "battery_low_v": 23.5}, 23.5),
    ],
)
def test_the_voltage_is_the_files_or_the_models(keys: dict[str, object], low_v: float | None) -> None:
    config = AgilexChassisConfig.model_validate({"kind": "agilex", "link": LINK, **keys})
    assert battery_low_v_of(config) == low_v


def test_a_kobuki_has_the_limit_of_its_file() -> None:
    bench = KobukiBench(battery_low_v=15.0)
    bench.arm()
    bench.emulator.battery_v = 14.5
    now = bench.run(160, 0.3)
    assert (now.mode, now.faults) == (ChassisMode.ARMED, ("warning: battery below 15 V",))


def roboclaw_bench() -> SerialBench[RoboclawEmulator]:
    return SerialBench(
        PLANT,
        lambda link, plant: RoboclawEmulator(link, plant, counts_per_m=COUNTS_PER_M, boot_ms=0),
        lambda link: RoboclawChassis(link, roboclaw_config(battery_low_v=22.0)),
    )


@pytest.mark.parametrize("make", [lambda: RoboteqBench(battery_low_v=22.0), roboclaw_bench])
def test_motor_controllers_tell_of_the_voltage_in_their_file(
    make: Callable[[], SerialBench[RoboteqEmulator] | SerialBench[RoboclawEmulator]],
) -> None:
    bench = make()
    bench.arm()
    assert bench.run(200).faults == ()
    bench.emulator.battery_v = 21.5
    assert bench.run(250).faults == ("warning: battery below 22 V",)
