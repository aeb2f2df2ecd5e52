"""A RoboClaw driver and its emulator on a wire in memory."""

from __future__ import annotations

from hal.chassis.roboclaw import RoboclawChassis
from sim.emulators.roboclaw import RoboclawEmulator
from tests.support.chassis_rig import COUNTS_PER_M, PLANT, roboclaw_config
from tests.support.serial_bench import SerialBench


class Bench(SerialBench[RoboclawEmulator]):
    def __init__(self, **changes: object) -> None:
        super().__init__(
            PLANT,
            lambda link, plant: RoboclawEmulator(link, plant, counts_per_m=COUNTS_PER_M, boot_ms=0),
            lambda link: RoboclawChassis(link, roboclaw_config(**changes)),
        )
