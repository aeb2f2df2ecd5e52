"""What differs from one AgileX model to the next, as data. The manuals contradict each other, so
nothing here is shared between models unless a source says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from config.chassis import AgilexChassisConfig

VEHICLE_NORMAL = 0
VEHICLE_ESTOP = 1

# 0x261+n byte 5. Bit 0x10 is "sensor" in the vendor's SDK and "CAN lost" in the SCOUT manual; 0x40 and
# 0x80 are no faults (enabled, reset).
DRIVER_FAULTS: Mapping[int, str] = MappingProxyType(
    {
        0x01: "supply voltage low",
        0x02: "motor too hot",
        0x04: "over-current",
        0x08: "driver too hot",
        0x10: "sensor fault or CAN lost",
        0x20: "driver fault",
    }
)
_DRIVER_NO_FAULTS = 0x40 | 0x80


@dataclass(frozen=True, slots=True)
class AgilexModel:
    """Limits, mode bytes and fault bits of one model.

    mode_names: 0x211 byte 1. mode_can: the value that means "obeys us"; modes_manual: somebody else
    drives. system_faults: bits of 0x211 bytes 4-5; a set bit without an entry is reported too.
    base_timeout_ms: after so long without 0x111 the base stops by itself. mode_period_ms: how
    often 0x421 must be repeated while driving; None: once is enough, and repeating it would
    take a base that restarted out of standby without anybody's consent.
    """

    name: str
    max_speed_mps: float
    max_yaw_rate_radps: float
    mode_names: Mapping[int, str]
    mode_standby: int
    mode_can: int
    modes_manual: frozenset[int]
    system_faults: Mapping[int, str]
    base_timeout_ms: int
    mode_period_ms: int | None

    def describe_system_faults(self, bits: int) -> tuple[str, ...]:
        """One sentence for each set bit of 0x211 bytes 4-5."""
        return _describe(bits, self.system_faults, "system fault")

    def describe_mode(self, mode: int) -> str:
        """The name of 0x211 byte 1."""
        return self.mode_names.get(mode, f"unknown mode {mode}")


def describe_driver_state(index: int, bits: int) -> tuple[str, ...]:
    """One sentence for each fault bit of 0x261 + index byte 5."""
    return _describe(bits & ~_DRIVER_NO_FAULTS, DRIVER_FAULTS, f"driver {index}")


def _describe(bits: int, names: Mapping[int, str], what: str) -> tuple[str, ...]:
    found = []
    while bits:
        bit = bits & -bits
        found.append(f"{what}: {names.get(bit, f'unknown bit 0x{bit:04X}')}")
        bits ^= bit
    return tuple(found)


# Limits: the vendor's SDK for BUNKER (robot_limits). Its fault table was published as pictures only,
# so every bit is reported by number until it has been checked on a robot.
BUNKER = AgilexModel(
    name="bunker",
    max_speed_mps=3.0,
    max_yaw_rate_radps=2.5235,
    mode_names=MappingProxyType({0: "standby", 1: "CAN", 2: "serial", 3: "remote control"}),
    mode_standby=0,
    mode_can=1,
    modes_manual=frozenset({2, 3}),
    system_faults=MappingProxyType({}),
    base_timeout_ms=500,
    mode_period_ms=None,
)

_MODELS: Mapping[str, AgilexModel] = MappingProxyType({BUNKER.name: BUNKER})


def model_of(config: AgilexChassisConfig) -> AgilexModel:
    """The data of the model that the configuration names."""
    return _MODELS[config.model]
