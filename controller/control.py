"""One control step: chassis state and scene in, decision, shaped setpoint out. Both runners step it."""

from __future__ import annotations

from dataclasses import dataclass

from controller.decide import Decision
from hal.types import ChassisState, PlanarPose, Setpoint


@dataclass(frozen=True, slots=True)
class ControlStep:
    """What one step knew, decided and sent."""

    now_ns: int
    pose: PlanarPose
    progress_m: float
    lateral_m: float
    decision: Decision
    setpoint: Setpoint
    chassis: ChassisState
