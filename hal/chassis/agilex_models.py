"""The differences between AgileX models, as data; their top speeds are in config/agilex.py. The manuals
contradict each other, so models share a value only where a source says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from config.chassis import AgilexChassisConfig, SerialLinkConfig

VEHICLE_NORMAL = 0
VEHICLE_ESTOP = 1

# 0x261+n byte 5 as in the vendor's SDK, where 0x40 (enabled) and 0x80 (reset) are not faults.
_SDK_DRIVER_FAULTS: Mapping[int, str] = MappingProxyType(
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

# 0x211 byte 1 as in the vendor's SDK.
_SDK_MODES: Mapping[int, str] = MappingProxyType({0: "standby", 1: "CAN", 2: "serial", 3: "remote control"})

# 0x211 bytes 4-5 of the models whose manual has the table.
_SYSTEM_FAULTS: Mapping[int, str] = MappingProxyType(
    {0x0100: "battery below 22 V", 0x0200: "battery low", 0x0400: "remote control lost"}
)

# The switch of the vendor's remote control: up is command mode, the middle is remote control (SCOUT MINI).
# Remote control outranks 0x421 (BUNKER MINI manual p. 7, table 3.5).
_REMOTE_RELEASE = "switch it to command mode (SWB up), or off"


@dataclass(frozen=True, slots=True)
class AgilexModel:
    """Geometry, mode bytes and fault bits of one model. Its top speeds: config/agilex.py.

    actuators: how many motors report (0x251+n, 0x261+n).
    mode_names: names of the values of 0x211 byte 1.
    mode_can, mode_serial: the value that means "obeys this wire" (None: no serial port of this protocol).
    modes_remote: the values that mean that a person drives.
    remote_release: how that person hands the base over to the computer.
    system_faults: bits of 0x211 bytes 4-5, byte 4 the higher one.
    driver_faults: bits of 0x261+n byte 5. A set bit without an entry is reported, too.
    base_timeout_ms: the base stops by itself after this time without 0x111.
    mode_period_ms: how often 0x421 must be repeated while driving. None: once is enough, and repeating it
        would take a base that restarted out of standby without anybody's consent.
    track_width_m: between the centres of the tracks or wheels; None where no manual gives it.
    battery_low_v: below this the battery is low; None where no manual gives it.
    """

    name: str
    actuators: int = 2
    mode_names: Mapping[int, str] = field(default_factory=lambda: _SDK_MODES)
    mode_standby: int = 0
    mode_can: int = 1
    mode_serial: int | None = 2
    modes_remote: frozenset[int] = frozenset({3})
    remote_release: str = _REMOTE_RELEASE
    system_faults: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    driver_faults: Mapping[int, str] = field(default_factory=lambda: _SDK_DRIVER_FAULTS)
    base_timeout_ms: int = 500
    mode_period_ms: int | None = None
    track_width_m: float | None = None
    battery_low_v: float | None = None

    def command_mode(self, over_serial: bool) -> int:
        """The value of 0x211 byte 1 while the base takes commands from this wire. Raises ValueError if the
        base has no such wire."""
        mode = self.mode_serial if over_serial else self.mode_can
        if mode is None:
            raise ValueError(f"{self.name} has no serial port of this protocol")
        return mode

    def describe_system_faults(self, bits: int) -> tuple[str, ...]:
        """One message for each set bit of 0x211 bytes 4-5."""
        return _describe(bits, self.system_faults, "system fault")

    def describe_driver_state(self, index: int, bits: int) -> tuple[str, ...]:
        """One message for each fault bit of byte 5 of 0x261 + index."""
        return _describe(bits & ~_DRIVER_NO_FAULTS, self.driver_faults, f"driver {index}")

    def describe_mode(self, mode: int) -> str:
        """The name of a value of 0x211 byte 1."""
        return self.mode_names.get(mode, f"unknown mode {mode}")


def _describe(bits: int, names: Mapping[int, str], what: str) -> tuple[str, ...]:
    found = []
    while bits:
        bit = bits & -bits
        found.append(f"{what}: {names.get(bit, f'unknown bit 0x{bit:04X}')}")
        bits ^= bit
    return tuple(found)


# The fault table was published only as pictures, so every bit is reported by its number until it has been
# checked on a robot.
BUNKER = AgilexModel(name="bunker")

# BUNKER MINI manual pp. 7-9: CAN only; 0x421 every 20 ms, or the base leaves command mode after 500 ms.
BUNKER_MINI = AgilexModel(name="bunker_mini", mode_serial=None, mode_period_ms=20)

# BUNKER PRO 2.0: CAN only, 0x211 every 200 ms.
BUNKER_PRO = AgilexModel(name="bunker_pro", mode_serial=None)

# SCOUT user manual v1.3.0: tables 3.2 and 3.9, section 1.2 (wheels 576 mm apart).
SCOUT = AgilexModel(
    name="scout",
    actuators=4,
    system_faults=_SYSTEM_FAULTS,
    driver_faults=MappingProxyType(
        {
            0x01: "supply voltage low",
            0x02: "motor too hot",
            0x04: "over-current",
            0x08: "driver too hot",
            0x10: "CAN lost",
        }
    ),
    track_width_m=0.576,
    battery_low_v=22.5,
)

# Its fault table was not found.
SCOUT_MINI = AgilexModel(name="scout_mini", actuators=4)

# TRACER user manual v1.2, tables 3.1 and 3.2: mode 0 is the remote control, and no value says standby. Its
# serial line carries percentages.
TRACER = AgilexModel(
    name="tracer",
    mode_names=MappingProxyType({0: "remote control or standby", 1: "CAN", 2: "serial"}),
    mode_serial=None,
    modes_remote=frozenset(),
    system_faults=_SYSTEM_FAULTS,
    battery_low_v=22.5,
)

MODELS: Mapping[str, AgilexModel] = MappingProxyType(
    {model.name: model for model in (BUNKER, BUNKER_MINI, BUNKER_PRO, SCOUT, SCOUT_MINI, TRACER)}
)


def model_of(config: AgilexChassisConfig) -> AgilexModel:
    """The data of the configured model."""
    return MODELS[config.model]


def over_serial(config: AgilexChassisConfig) -> bool:
    """Whether the base is reached over RS-232."""
    return isinstance(config.link, SerialLinkConfig)


def track_width_of(config: AgilexChassisConfig) -> float | None:
    """The configured width, or the model's if the key is absent; None if unknown, or configured as null."""
    return (
        config.track_width_m if "track_width_m" in config.model_fields_set else model_of(config).track_width_m
    )


def battery_low_v_of(config: AgilexChassisConfig) -> float | None:
    """The configured voltage, or the model's if the key is absent; None: no voltage is known to be low."""
    return (
        config.battery_low_v if "battery_low_v" in config.model_fields_set else model_of(config).battery_low_v
    )
