"""AgileX protocol V2 messages, and their CAN frames as laid out in config/dbc/agilex_v2.dbc.

Source: SCOUT user manual v1.3.0 3.3.1 and BUNKER MINI manual pp. 7-9; 11-bit identifiers, 500 kbit/s,
big-endian fields. The frames used here carry no checksum: CAN has its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cantools
from cantools.database import DecodeError
from cantools.database.can import Database, Message

from config.loader import CONFIG_DIR
from hal.types import CanFrame

ACTUATORS = 8


@dataclass(frozen=True, slots=True)
class MotionCommand:
    """0x111, host to base, every 20 ms."""

    v_mps: float
    w_radps: float


@dataclass(frozen=True, slots=True)
class ControlModeCommand:
    """0x421, host to base. mode: 0 standby, 1 CAN, 2 serial."""

    mode: int


@dataclass(frozen=True, slots=True)
class ClearError:
    """0x441, host to base. target: 0 all, 1..4 one motor."""

    target: int


@dataclass(frozen=True, slots=True)
class SystemState:
    """0x211, base to host. For control_mode and fault_bits see the model in agilex_models."""

    vehicle_state: int
    control_mode: int
    battery_v: float
    fault_bits: int
    count: int


@dataclass(frozen=True, slots=True)
class MotionFeedback:
    """0x221, base to host, every 20 ms: the twist from the track speeds."""

    v_mps: float
    w_radps: float


@dataclass(frozen=True, slots=True)
class ActuatorFast:
    """0x251 + index, base to host, every 20 ms."""

    index: int
    speed_rpm: int
    current_a: float
    pulses: int


@dataclass(frozen=True, slots=True)
class ActuatorSlow:
    """0x261 + index, base to host. state_bits: see AgilexModel.driver_faults."""

    index: int
    driver_v: float
    driver_temp_c: int
    motor_temp_c: int
    state_bits: int


@dataclass(frozen=True, slots=True)
class Odometer:
    """0x311, base to host, every 20 ms: distance travelled by each track; int32, wraps around."""

    left_mm: int
    right_mm: int


@dataclass(frozen=True, slots=True)
class Battery:
    """0x361, base to host."""

    charge_percent: int
    health_percent: int
    voltage_v: float
    current_a: float
    temperature_c: float


AgilexMessage = (
    MotionCommand
    | ControlModeCommand
    | ClearError
    | SystemState
    | MotionFeedback
    | ActuatorFast
    | ActuatorSlow
    | Odometer
    | Battery
)


@dataclass(frozen=True, slots=True)
class _Signal:
    """One field of a frame: its name in the DBC and in the dataclass, its step and its raw range."""

    name: str
    field: str
    factor: float
    raw_min: int
    raw_max: int


@dataclass(frozen=True, slots=True)
class _Layout:
    """Mapping between one frame identifier and one dataclass.

    prefix: leading arguments of make (the actuator's index). unused: signals without a field, sent as 0.
    """

    message: Message
    make: Callable[..., AgilexMessage]
    prefix: tuple[int, ...]
    signals: tuple[_Signal, ...]
    unused: dict[str, int]


# Dataclass -> (DBC message, its signals in the order of the dataclass's fields).
_FIELDS: dict[Callable[..., AgilexMessage], tuple[str, tuple[tuple[str, str], ...]]] = {
    MotionCommand: ("MotionCommand", (("LinearVelocity", "v_mps"), ("AngularVelocity", "w_radps"))),
    ControlModeCommand: ("ControlModeCommand", (("Mode", "mode"),)),
    ClearError: ("ClearError", (("Target", "target"),)),
    SystemState: (
        "SystemState",
        (
            ("VehicleState", "vehicle_state"),
            ("ControlMode", "control_mode"),
            ("BatteryVoltage", "battery_v"),
            ("FaultBits", "fault_bits"),
            ("Count", "count"),
        ),
    ),
    MotionFeedback: ("MotionFeedback", (("LinearVelocity", "v_mps"), ("AngularVelocity", "w_radps"))),
    Odometer: ("Odometer", (("Left", "left_mm"), ("Right", "right_mm"))),
    Battery: (
        "Battery",
        (
            ("StateOfCharge", "charge_percent"),
            ("StateOfHealth", "health_percent"),
            ("Voltage", "voltage_v"),
            ("Current", "current_a"),
            ("Temperature", "temperature_c"),
        ),
    ),
}

# The same, for frames that exist once for each actuator.
_ACTUATOR_FIELDS: dict[Callable[..., AgilexMessage], tuple[str, tuple[tuple[str, str], ...]]] = {
    ActuatorFast: ("ActuatorFast", (("Speed", "speed_rpm"), ("Current", "current_a"), ("Pulses", "pulses"))),
    ActuatorSlow: (
        "ActuatorSlow",
        (
            ("DriverVoltage", "driver_v"),
            ("DriverTemperature", "driver_temp_c"),
            ("MotorTemperature", "motor_temp_c"),
            ("DriverState", "state_bits"),
        ),
    ),
}


def _layout(
    message: Message,
    make: Callable[..., AgilexMessage],
    fields: tuple[tuple[str, str], ...],
    prefix: tuple[int, ...] = (),
) -> _Layout:
    signals = []
    for name, field in fields:
        signal = message.get_signal_by_name(name)
        bits = signal.length - (1 if signal.is_signed else 0)
        raw_min = -(1 << bits) if signal.is_signed else 0
        signals.append(_Signal(name, field, float(signal.scale), raw_min, (1 << bits) - 1))
    used = {name for name, _ in fields}
    unused = {signal.name: 0 for signal in message.signals if signal.name not in used}
    return _Layout(message, make, prefix, tuple(signals), unused)


def _load() -> tuple[dict[int, _Layout], dict[tuple[Callable[..., AgilexMessage], int], _Layout]]:
    database = cantools.database.load_file(CONFIG_DIR / "dbc" / "agilex_v2.dbc")
    if not isinstance(database, Database):  # cannot be: the file is ours and is a DBC
        raise TypeError(f"agilex_v2.dbc holds {type(database).__name__}, not CAN messages")
    layouts: dict[tuple[Callable[..., AgilexMessage], int], _Layout] = {}
    for make, (name, fields) in _FIELDS.items():
        layouts[make, 0] = _layout(database.get_message_by_name(name), make, fields)
    for make, (name, fields) in _ACTUATOR_FIELDS.items():
        for index in range(ACTUATORS):
            message = database.get_message_by_name(f"{name}{index}")
            layouts[make, index] = _layout(message, make, fields, prefix=(index,))
    return {layout.message.frame_id: layout for layout in layouts.values()}, layouts


_BY_ID, _BY_TYPE = _load()


def encode(message: AgilexMessage) -> CanFrame:
    """The CAN frame of a message.

    Values are rounded to the nearest step and clamped to the field's range, so they never wrap around.
    Raises ValueError for NaN or infinity, KeyError for an actuator index that does not exist.
    """
    layout = _BY_TYPE[type(message), getattr(message, "index", 0)]
    raw = dict(layout.unused)
    for signal in layout.signals:
        value = getattr(message, signal.field)
        if not math.isfinite(value):
            raise ValueError(f"{signal.field} is {value}, which no frame can say")
        raw[signal.name] = round(min(max(value / signal.factor, signal.raw_min), signal.raw_max))
    data = layout.message.encode(raw, scaling=False, strict=False)
    return CanFrame(layout.message.frame_id, data)


def decode(frame: CanFrame) -> AgilexMessage | None:
    """The message of a CAN frame; None for an unknown identifier or too few bytes.

    More bytes than needed are accepted: some senders pad 0x421 to eight bytes.
    """
    layout = _BY_ID.get(frame.arbitration_id)
    if layout is None:
        return None
    try:
        values = layout.message.decode(frame.data, decode_choices=False)
    except DecodeError:
        return None
    if not isinstance(values, dict):  # cannot be: no message of the DBC is a container
        return None
    return layout.make(*layout.prefix, *[values[signal.name] for signal in layout.signals])
