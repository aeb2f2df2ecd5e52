"""Faults in simulated time, for every kind of chassis: guard, driver, link and emulated base.

Everything runs in this process, without ports.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from config.app import hil_file, load_app
from controller.build_chassis import build_base_in_memory
from controller.shape import SpeedShaper
from hal.clocks import NS_PER_S
from hal.types import ChassisMode, ChassisState, PlanarPose, Setpoint
from sim.plant import PLANT_REST_MPS, PLANT_REST_RADPS

_PERIOD_NS = NS_PER_S // 50
_SPEED_MPS = 0.5
_GIVE_UP_S = 6.0  # longest time until it stands
_OBSERVATION_S = 3.0  # time in which the base must not move by itself after the fault


@dataclass(frozen=True, slots=True)
class TrialResult:
    """The result of one fault.

    mode, reason: of the chassis after the fault.
    stood_after_s: time until the true base stood still; NaN if it did not.
    travelled_m: distance travelled until then.
    moved_after_m: distance it moved by itself after the fault was over, while a speed was still commanded.
    drives_again: it drove again after a zero command and consent.
    """

    kind: str
    fault: str
    mode: ChassisMode
    reason: str
    stood_after_s: float
    travelled_m: float
    moved_after_m: float
    drives_again: bool


class TrialRig:
    """A guarded driver and its base, driven as by the control loop: shaped speeds while armed."""

    def __init__(self, kind: str) -> None:
        config = load_app(hil_file(kind))
        self.chassis, self.emulator, self.link = build_base_in_memory(config, PlanarPose(0.0, 0.0, 0.0), 0)
        self._shaper = SpeedShaper(config.robot.limits, _PERIOD_NS / NS_PER_S)
        self.now_ns = 0
        self.state: ChassisState | None = None

    @property
    def standing(self) -> bool:
        """Whether the true base stands still."""
        v_mps, w_radps = self.emulator.plant.twist
        return abs(v_mps) < PLANT_REST_MPS and abs(w_radps) < PLANT_REST_RADPS

    @property
    def travelled_m(self) -> float:
        """Distance travelled by the tracks since the start, mean of both."""
        left_m, right_m = self.emulator.plant.track_travel_m
        return 0.5 * (abs(left_m) + abs(right_m))

    def step_without_control(self) -> None:
        """One period without the control loop."""
        self.now_ns += _PERIOD_NS
        self.emulator.advance_to(self.now_ns)

    def step(self, target_mps: float) -> None:
        """One period with the control loop, which asks for this speed."""
        self.step_without_control()
        if self.state is None or self.state.mode is not ChassisMode.ARMED:
            self._shaper.reset()
            # The loop keeps asking for the speed; only the driver may keep it from the tracks.
            setpoint = Setpoint(self.now_ns, target_mps, 0.0, 0.0)
        else:
            shaped = self._shaper.step(target_mps)
            v_mps = shaped.v_mps if math.isfinite(target_mps) else target_mps
            setpoint = Setpoint(self.now_ns, v_mps, shaped.a_mps2, 0.0)
        self.state = self.chassis.exchange(setpoint, self.now_ns)

    def run(self, seconds: float, target_mps: float) -> None:
        """Periods with the control loop for this time."""
        for _ in range(round(seconds * NS_PER_S / _PERIOD_NS)):
            self.step(target_mps)

    def arm(self) -> bool:
        """Command zero, give consent, and wait a second; whether the chassis is armed then."""
        self.run(0.2, 0.0)
        self.chassis.arm(self.now_ns)
        self.run(1.0, 0.0)
        return self.state is not None and self.state.mode is ChassisMode.ARMED


def _keep_commanding(rig: TrialRig) -> None:
    rig.step(_SPEED_MPS)


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault: begin it, run live for each period, end it."""

    name: str
    begin: Callable[[TrialRig], None] = lambda _: None
    end: Callable[[TrialRig], None] = lambda _: None
    during: Callable[[TrialRig], None] = _keep_commanding


# No fault, but what all others are compared with.
_REQUESTED_STOP = Fault("stop is asked for", during=lambda rig: rig.step(0.0))

FAULTS = (
    _REQUESTED_STOP,
    Fault("e-stop", lambda rig: rig.emulator.press_estop(), lambda rig: rig.emulator.release_estop()),
    Fault("base restarts", lambda rig: rig.emulator.restart()),
    Fault("base frozen", lambda rig: rig.emulator.freeze(), lambda rig: rig.emulator.thaw()),
    Fault("unplugged", lambda rig: rig.link.unplug(), lambda rig: rig.link.plug()),
    Fault("cable out", lambda rig: rig.link.pull_cable(), lambda rig: rig.link.connect_cable()),
    Fault("nothing comes back", lambda rig: rig.link.cut_wire(), lambda rig: rig.link.restore_wire()),
    Fault("control hangs or is killed", during=lambda rig: rig.step_without_control()),
    Fault("command is no number", during=lambda rig: rig.step(math.nan)),
)


def run_trial(kind: str, fault: Fault) -> TrialResult:
    """Drive at 0.5 m/s, begin the fault, wait until the base stands, end it, keep asking, then consent.

    Raises RuntimeError if the emulated base does not drive before the fault, which is a bug in the program.
    """
    rig = TrialRig(kind)
    with rig.emulator, rig.chassis:
        if not rig.arm():
            raise RuntimeError(f"{kind} did not arm")
        rig.run(4.0, _SPEED_MPS)
        if rig.emulator.plant.twist[0] < 0.9 * _SPEED_MPS:
            raise RuntimeError(f"{kind} did not drive")
        start_ns, start_m = rig.now_ns, rig.travelled_m
        fault.begin(rig)
        while not rig.standing and rig.now_ns - start_ns < _GIVE_UP_S * NS_PER_S:
            fault.during(rig)
        stood_s = (rig.now_ns - start_ns) / NS_PER_S if rig.standing else math.nan
        travelled_m = rig.travelled_m - start_m
        fault.during(rig)
        fault.end(rig)
        stood_m = rig.travelled_m
        rig.run(_OBSERVATION_S, 0.0 if fault is _REQUESTED_STOP else _SPEED_MPS)
        state = rig.state
        assert state is not None
        moved_m = rig.travelled_m - stood_m
        drives_again = rig.arm()
        rig.run(2.0, _SPEED_MPS)
        drives_again = drives_again and rig.emulator.plant.twist[0] > 0.2
    return TrialResult(
        kind=kind,
        fault=fault.name,
        mode=state.mode,
        reason=state.reason,
        stood_after_s=stood_s,
        travelled_m=travelled_m,
        moved_after_m=moved_m,
        drives_again=drives_again,
    )
