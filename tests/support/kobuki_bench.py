"""A Kobuki driver and its emulator on a wire in memory."""

from __future__ import annotations

from hal.chassis.kobuki import KobukiChassis
from sim.emulators.kobuki import KobukiEmulator
from tests.support.chassis_rig import KOBUKI_PLANT, kobuki_config
from tests.support.serial_bench import SerialBench

STOP = bytes.fromhex("AA 55 06 01 04 00 00 00 00 03")


class Bench(SerialBench[KobukiEmulator]):
    def __init__(self, **changes: object) -> None:
        super().__init__(
            KOBUKI_PLANT,
            lambda link, plant: KobukiEmulator(link, plant, boot_ms=0),
            lambda link: KobukiChassis(link, kobuki_config(**changes)),
        )
