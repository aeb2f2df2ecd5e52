"""A Roboteq driver and its emulator on a wire in memory."""

from __future__ import annotations

from hal.chassis.roboteq import RoboteqChassis
from sim.emulators.roboteq import RoboteqEmulator
from tests.support.chassis_rig import COUNTS_PER_M, PLANT, roboteq_config
from tests.support.serial_bench import SerialBench


class Bench(SerialBench[RoboteqEmulator]):
    def __init__(self, **changes: object) -> None:
        super().__init__(
            PLANT,
            lambda link, plant: RoboteqEmulator(
                link, plant, full_speed_mps=1.0, counts_per_m=COUNTS_PER_M, boot_ms=0
            ),
            lambda link: RoboteqChassis(link, roboteq_config(**changes)),
        )

    def written(self) -> list[bytes]:
        """The lines of the last exchange."""
        return b"".join(self.near.written).split(b"\r")[:-1]
