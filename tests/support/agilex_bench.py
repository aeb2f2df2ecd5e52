"""The AgileX driver alone: a hand says what the base says, frame by frame."""

from __future__ import annotations

from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import (
    AgilexMessage,
    MotionFeedback,
    Odometer,
    SystemState,
    decode,
    encode,
)
from hal.links.scripted import ScriptedCanLink
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.chassis_rig import MS, agilex_config

STANDBY, CAN, SERIAL, REMOTE = 0, 1, 2, 3


class Bench:
    """The driver, and a hand that says what the base says."""

    def __init__(self, **changes: object) -> None:
        self.link = ScriptedCanLink()
        values: dict[str, object] = {"track_width_m": None, "slip_factor": 1.0}
        self.chassis = AgilexChassis(self.link, agilex_config(None, **(values | changes)))
        self.now_ns = 0

    def deliver(self, *messages: AgilexMessage) -> None:
        self.link.deliver(*(encode(message) for message in messages))

    def exchange(self, v_mps: float | None = None, w_radps: float = 0.0, after_ms: int = 20) -> ChassisState:
        self.now_ns += after_ms * MS
        self.link.sent.clear()
        command = None if v_mps is None else Setpoint(self.now_ns, v_mps, 0.0, w_radps)
        return self.chassis.exchange(command, self.now_ns)

    def sent(self) -> list[AgilexMessage | None]:
        return [decode(frame) for frame in self.link.sent]

    def arm(self) -> None:
        self.chassis.arm(self.now_ns)
        self.deliver(state(CAN), MotionFeedback(0.0, 0.0), Odometer(0, 0))
        assert self.exchange().mode is ChassisMode.ARMED


def state(mode: int = CAN, vehicle: int = 0, faults: int = 0, battery_v: float = 48.0) -> SystemState:
    return SystemState(vehicle, mode, battery_v, faults, 0)
