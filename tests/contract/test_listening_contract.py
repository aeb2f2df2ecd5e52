"""A base that is only listened to: it is asked at most, never commanded, on every driver and every link."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from hal.api import ChassisListener, SerialLink
from hal.chassis.agilex import AgilexChassis
from hal.chassis.driver import ChassisDriver
from hal.chassis.kobuki import KobukiChassis
from hal.chassis.roboclaw import _QUERIES as ROBOCLAW_QUERIES
from hal.chassis.roboclaw import RoboclawChassis
from hal.chassis.roboteq import RoboteqChassis
from hal.links.can_bus import CanBusLink
from hal.types import CanFrame, ChassisMode, ChassisState
from sim.emulators.agilex import AgilexEmulator
from sim.plant import TrackedPlant
from tests.support.chassis_rig import (
    MS,
    PERIOD_NS,
    PLANT,
    Rig,
    agilex_config,
    can_link_config,
    kobuki_config,
    roboclaw_config,
    roboteq_config,
)
from tests.support.contract_rigs import EMULATED
from tests.support.kobuki_bench import Bench as KobukiBench
from tests.support.roboclaw_bench import Bench as RoboclawBench
from tests.support.roboteq_bench import Bench as RoboteqBench
from tests.support.serial_bench import SerialBench
from tests.support.wires import PluggedCan

_ROBOCLAW = {query.packet(0x80) for query in ROBOCLAW_QUERIES}
# What may be written while listening; a base that reports by itself is asked nothing.
QUERIES: dict[str, Callable[[Any], bool]] = {
    "roboclaw": lambda data: data in _ROBOCLAW,
    "roboteq": lambda data: re.fullmatch(rb"[?~][A-Z]+\r", data) is not None,
}


@pytest.fixture(params=list(EMULATED))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def rig(kind: str) -> Iterator[Rig]:
    with EMULATED[kind]() as one:
        yield one


def watch_writes(rig: Rig) -> list[object]:
    """All that the driver writes from now on."""
    written: list[object] = []
    name = "send" if isinstance(rig.plug, PluggedCan) else "write"
    through = getattr(rig.plug, name)

    def note(data: object) -> None:
        written.append(data)
        through(data)

    setattr(rig.plug, name, note)
    return written


def listen(rig: Rig, seconds: float) -> ChassisState:
    """Emulator first, then the listener, every 20 ms."""
    assert isinstance(rig.chassis, ChassisDriver)
    for _ in range(round(seconds * 50)):
        rig.now_ns += PERIOD_NS
        rig.emulator.advance_to(rig.now_ns)
        rig.state = rig.chassis.listen(rig.now_ns)
        assert rig.state.sent is None
    return rig.state


def test_nothing_but_queries_is_written_also_when_it_is_closed(rig: Rig, kind: str) -> None:
    written = watch_writes(rig)
    state = listen(rig, 3.0)
    rig.chassis.__exit__(None, None, None)
    is_query = QUERIES.get(kind.partition("-")[0])
    if is_query is None:
        assert written == []
    else:
        assert len(written) > 20
        assert [data for data in written if not is_query(data)] == []
    assert rig.plant.track_travel_m == (0.0, 0.0)
    assert (state.mode, state.reason) == (ChassisMode.STANDBY, "it answers")
    assert state.feedback_ns is not None
    assert rig.now_ns - state.feedback_ns <= 120 * MS
    assert (state.v_mps, state.w_radps) == (0.0, 0.0)
    assert state.battery_v == pytest.approx(rig.battery_v)


def test_a_base_that_is_silent_is_lost_and_then_heard_again_without_consent(rig: Rig) -> None:
    listen(rig, 2.0)
    rig.plug.out = True
    assert (listen(rig, 0.1).mode, rig.state.reason) == (ChassisMode.LOST, "unplugged")
    rig.plug.plug()
    listen(rig, 2.0)
    assert (rig.state.mode, rig.state.reason) == (ChassisMode.STANDBY, "it answers")
    rig.emulator.freeze()
    listen(rig, 1.5)
    assert rig.state.mode is ChassisMode.LOST
    assert "feedback" in rig.state.reason or "status" in rig.state.reason


def test_an_emergency_stop_is_told_for_as_long_as_it_is_pressed(rig: Rig, kind: str) -> None:
    listen(rig, 2.0)
    rig.emulator.press_estop()
    assert listen(rig, 1.0).mode is ChassisMode.ESTOP
    assert "emergency stop" in rig.state.reason
    rig.emulator.release_estop()
    kept = kind.startswith("roboteq")  # this controller keeps it until a person arms
    assert listen(rig, 1.0).mode is (ChassisMode.ESTOP if kept else ChassisMode.STANDBY)


def test_a_base_that_never_speaks_says_what_to_check(rig: Rig) -> None:
    rig.emulator.freeze()
    state = listen(rig, 1.0)
    assert state.mode is ChassisMode.STANDBY
    assert state.reason.startswith("no status heard from the base: not one ")
    assert "; check " in state.reason


class CountingCan(PluggedCan):
    """Notes what is sent."""

    def __init__(self, link: CanBusLink) -> None:
        super().__init__(link)
        self.sent: list[CanFrame] = []

    def send(self, frame: CanFrame) -> None:
        self.sent.append(frame)
        super().send(frame)


def test_a_drive_of_another_master_on_the_bus_goes_on_and_is_followed() -> None:
    """From the very first moment: before the listener has heard that there is one, too."""
    link = can_link_config()
    plant = TrackedPlant(PLANT)
    ends = [CanBusLink(link) for _ in range(2)]
    ear = CountingCan(CanBusLink(link))
    config = agilex_config(link)
    with (
        AgilexEmulator(ends[0], plant) as emulator,
        AgilexChassis(ends[1], config) as master,
        AgilexChassis(ear, config) as listener,
    ):
        bus = Rig(master, emulator, PluggedCan(ends[1]), own_timeout_s=0.5, battery_v=50.0)
        bus.run(0.2)
        bus.arm()
        for _ in range(150):
            assert bus.step(0.4, 0.2).mode is ChassisMode.ARMED
            heard = listener.listen(bus.now_ns)
        assert plant.twist == pytest.approx((0.4, 0.2), abs=0.002)
        assert (heard.v_mps, heard.w_radps) == pytest.approx((0.4, 0.2), abs=0.005)
        assert heard.pose.x_m == pytest.approx(bus.state.pose.x_m, abs=0.02)
        assert heard.pose.heading_rad == pytest.approx(bus.state.pose.heading_rad, abs=0.01)
        assert "another sender has sent motion commands" in heard.reason
        listener.__exit__(None, None, None)
        bus.run(0.5, 0.4)
        assert plant.twist[0] == pytest.approx(0.4, abs=0.002)
    assert ear.sent == []


SERIAL: dict[str, Callable[[], tuple[SerialBench[Any], ChassisListener]]] = {
    "roboclaw": lambda: with_listener(RoboclawBench(), lambda near: RoboclawChassis(near, roboclaw_config())),
    "roboteq": lambda: with_listener(RoboteqBench(), lambda near: RoboteqChassis(near, roboteq_config())),
    "kobuki": lambda: with_listener(KobukiBench(), lambda near: KobukiChassis(near, kobuki_config())),
}


def with_listener(
    bench: SerialBench[Any], make: Callable[[SerialLink], ChassisListener]
) -> tuple[SerialBench[Any], ChassisListener]:
    """A bench, and a program that will listen at the port once the bench's driver has left it."""
    return bench, make(bench.near)


@pytest.mark.parametrize("kind", SERIAL)
@pytest.mark.parametrize("gap_ms", [20, 2000])
def test_a_base_whose_program_has_just_died_stops_by_itself_and_stays_there(kind: str, gap_ms: int) -> None:
    """Queries must neither keep it moving nor set it off again."""
    bench, listener = SERIAL[kind]()
    bench.arm()
    bench.run(100, 0.4)
    assert bench.plant.twist[0] == pytest.approx(0.4, abs=0.01)
    bench.now_ns += (gap_ms - 20) * MS
    speeds_mps = []
    for _ in range(200):
        bench.now_ns += PERIOD_NS
        bench.emulator.advance_to(bench.now_ns)
        state = listener.listen(bench.now_ns)
        speeds_mps.append(bench.plant.twist[0])
    assert speeds_mps[100:] == pytest.approx([0.0] * 100, abs=0.001)
    assert gap_ms < 2000 or max(speeds_mps) < 0.001, "it stood already"
    assert state.v_mps == pytest.approx(0.0, abs=0.001)
