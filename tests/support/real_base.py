"""A real base, on blocks, in place of an emulator: the contract suite drives it in real time.

What the emulator knows for certain is here what the driver measured. What an emulator does at a word, a
person does: with --attended the suite asks for it on the terminal, without it such a test is skipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from config.app import load_app
from config.chassis import AnyChassisConfig, CanLinkConfig
from config.loader import CONFIG_DIR
from controller.build_chassis import build_can_driver, build_serial_driver
from controller.cli.emulate import EmulateOptions, can_link, with_wire
from hal.clocks import MonotonicClock
from hal.errors import HalError
from hal.links.can_bus import CanBusLink
from hal.links.serial_port import SerialPortLink
from hal.types import ChassisMode, ChassisState, PlanarPose
from tests.support.chassis_rig import PERIOD_NS, Rig
from tests.support.wires import PluggedCan, PluggedSerial

if TYPE_CHECKING:
    from sim.plant import TrackedPlant

_ANSWER_TIMEOUT_S = 30.0
_MAX_MEASUREMENTS = 25
# Half of a usual track width: what a turn means to a track.
_HALF_WIDTH_M = 0.25


def base_config(file: Path, channel: str) -> AnyChassisConfig:
    """The chassis of a YAML file, on this channel: can0, a multicast group, or a serial port."""
    chassis = load_app(file).chassis
    options = EmulateOptions(chassis.kind, channel=channel)
    chassis = with_wire(chassis, options)
    if isinstance(chassis.link, CanLinkConfig):
        return chassis.model_copy(update={"link": can_link(chassis.link, options)})
    return chassis.model_copy(update={"link": chassis.link.model_copy(update={"url": channel})})


class MeasuredPlant:
    """What stands for the emulator's plant: all that is known of a real base."""

    def __init__(self) -> None:
        self.state: ChassisState | None = None
        self._last_pose: PlanarPose | None = None
        self._travel_m = 0.0
        self._turned_rad = 0.0
        self.refresh: Callable[[], None] = lambda: None

    def update(self, state: ChassisState) -> None:
        """The newest state of the driver."""
        if self._last_pose is not None and state.feedback_ns is not None:
            travel_m = (state.pose.x_m - self._last_pose.x_m) * math.cos(state.pose.heading_rad)
            travel_m += (state.pose.y_m - self._last_pose.y_m) * math.sin(state.pose.heading_rad)
            self._travel_m += travel_m
            self._turned_rad += math.remainder(state.pose.heading_rad - self._last_pose.heading_rad, math.tau)
        self.state, self._last_pose = state, state.pose

    @property
    def twist(self) -> tuple[float, float]:
        """(v, w) as measured now; NaN where the base says nothing."""
        self.refresh()
        assert self.state is not None, "not stepped yet"
        return self.state.v_mps, self.state.w_radps

    @property
    def track_travel_m(self) -> tuple[float, float]:
        """(left, right) since the rig was opened."""
        turned_m = self._turned_rad * _HALF_WIDTH_M
        return self._travel_m - turned_m, self._travel_m + turned_m

    @property
    def pose(self) -> PlanarPose:
        """Dead reckoning."""
        assert self.state is not None, "not stepped yet"
        return self.state.pose


class Operator:
    """Does to the base what an emulator does at a word."""

    def __init__(self, attended: bool) -> None:
        self._attended = attended
        self._clock = MonotonicClock()
        self.measured = MeasuredPlant()
        self.read_state: Callable[[], ChassisState] = lambda: pytest.fail("not connected")

    @property
    def plant(self) -> TrackedPlant:
        return self.measured  # type: ignore[return-value]  # it answers what the suite asks of a plant

    def advance_to(self, now_ns: int) -> None:
        self._clock.sleep_until_ns(now_ns)

    def press_estop(self) -> None:
        self._request("PRESS the emergency stop", lambda state: state.mode is not ChassisMode.ARMED)

    def release_estop(self) -> None:
        self._request("RELEASE the emergency stop", lambda state: "gone now" in state.reason)

    def restart(self) -> None:
        self._request("switch the base OFF and ON again", lambda state: state.mode is not ChassisMode.ARMED)
        self._request("wait until it is back", lambda state: "gone now" in state.reason)

    def freeze(self) -> None:
        pytest.skip("nobody can freeze the processor of a real base")

    def thaw(self) -> None:
        raise AssertionError("what cannot be frozen cannot be thawed")

    def _request(self, request: str, is_done: Callable[[ChassisState], bool]) -> None:
        if not self._attended:
            pytest.skip(f"needs a person to {request}: run with --attended")
        with Path("/dev/tty").open("w") as terminal:
            terminal.write(f"\n>>> {request}, within {_ANSWER_TIMEOUT_S:g} s\a\n")
        for _ in range(round(_ANSWER_TIMEOUT_S * 50)):
            if is_done(self.read_state()):
                return
        pytest.fail(f"nobody did: {request}")


@dataclass
class RealRig(Rig):
    """Steps in real time. Fields as of Rig; now_ns is the monotonic clock."""

    operator: Operator = field(default_factory=lambda: Operator(attended=False))

    def __post_init__(self) -> None:
        self.now_ns = MonotonicClock().now_ns()
        self._command: tuple[float | None, float] = (None, 0.0)
        self._measured_ns = -1
        self.operator.read_state = lambda: self.step(*self._command)
        self.operator.measured.refresh = self._measure

    def step(self, v_mps: float | None = None, w_radps: float = 0.0) -> ChassisState:
        self._command = (v_mps, w_radps)
        super().step(v_mps, w_radps)
        return self._record_state()

    def run_emulator_only(self, seconds: float) -> None:
        super().run_emulator_only(seconds)
        self._measured_ns = -1

    def _record_state(self) -> ChassisState:
        self._measured_ns = self.now_ns
        self.operator.measured.update(self.state)
        return self.state

    def _measure(self) -> None:
        """After a time in which nobody listened: ask until three new readings have come, commanding nothing.

        The first may have waited since before; the second is then the mean since the first, where speed is
        counted.
        """
        if self._measured_ns == self.now_ns:
            return
        before = None if self.operator.measured.state is None else self.operator.measured.state.feedback_ns
        reading_times = {before}
        for _ in range(_MAX_MEASUREMENTS):
            self.now_ns += PERIOD_NS
            self.emulator.advance_to(self.now_ns)
            self.state = self.chassis.exchange(None, self.now_ns)
            self._record_state()
            reading_times.add(self.state.feedback_ns)
            if len(reading_times) > 3:
                return

    def require_emulator(self, reason: str) -> None:
        pytest.skip(f"a real base: {reason}")


@contextmanager
def real_rig(file: Path, channel: str, attended: bool) -> Iterator[Rig]:
    """The driver of this file's chassis on this channel; there must be a base, and its tracks in the air."""
    config = base_config(file, channel)
    plug: PluggedCan | PluggedSerial
    if isinstance(config.link, CanLinkConfig):
        plug = PluggedCan(CanBusLink(config.link))
        chassis = build_can_driver(config, plug)
    else:
        plug = PluggedSerial(SerialPortLink(config.link))
        chassis = build_serial_driver(config, plug)
    operator = Operator(attended)
    with ExitStack() as stack:
        error_text = None
        try:
            stack.enter_context(chassis)
        except HalError as error:
            error_text = str(error)
        if error_text is not None:
            pytest.fail(error_text, pytrace=False)
        rig = RealRig(
            chassis,
            operator,
            plug,
            own_timeout_s=1.0,
            battery_v=math.nan,
            tolerance_mps=0.05,
            tolerance_radps=0.1,
            braking_s=0.2,
            operator=operator,
        )
        yield rig
        rig.chassis.stop(rig.now_ns)


DEFAULT_BASE = CONFIG_DIR / "robot-bunker.yaml"
