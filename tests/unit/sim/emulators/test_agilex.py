"""The emulated BUNKER by its frames: what a driver may rely on, and what it must expect."""

from __future__ import annotations

from collections import Counter

import pytest

from config.plant import PlantConfig
from hal.chassis.agilex_messages import (
    AgilexMessage,
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    Odometer,
    SystemState,
    decode,
    encode,
)
from hal.chassis.agilex_models import BUNKER, BUNKER_MINI, SCOUT, AgilexModel
from hal.links.scripted import can_pair
from sim.emulators.agilex import AgilexEmulator
from sim.plant import TrackedPlant

MS = 1_000_000
S = 1000 * MS
CAN = 1


class Bench:
    """A host's hand on the bus of one emulated base."""

    def __init__(self, state_period_ms: int = 100, boot_ms: int = 1000, model: AgilexModel = BUNKER) -> None:
        self.host, self.far = can_pair()
        self.plant = TrackedPlant(PlantConfig(slip_factor=1.25))
        self.base = AgilexEmulator(
            self.far, self.plant, model=model, state_period_ms=state_period_ms, boot_ms=boot_ms
        )
        self.now_ns = 0

    def say(self, *messages: AgilexMessage) -> None:
        for message in messages:
            self.host.send(encode(message))

    def run(self, ms: int, every_20_ms: AgilexMessage | None = None) -> list[AgilexMessage]:
        end_ns = self.now_ns + ms * MS
        while self.now_ns < end_ns:
            if every_20_ms is not None:
                self.say(every_20_ms)
            self.now_ns += min(20 * MS, end_ns - self.now_ns)
            self.base.advance_to(self.now_ns)
        return self.heard()

    def heard(self) -> list[AgilexMessage]:
        messages = []
        while (frame := self.host.receive()) is not None:
            message = decode(frame)
            assert message is not None
            messages.append(message)
        return messages

    def drive(self, v_mps: float = 0.5, w_radps: float = 0.0, ms: int = 1000) -> list[AgilexMessage]:
        self.say(ControlModeCommand(CAN))
        return self.run(ms, MotionCommand(v_mps, w_radps))


def newest(messages: list[AgilexMessage], kind: type[AgilexMessage]) -> AgilexMessage:
    return [message for message in messages if isinstance(message, kind)][-1]


def test_frames_come_at_their_periods() -> None:
    bench = Bench(state_period_ms=200)
    bench.base.advance_to(999 * MS)
    counts: Counter[int] = Counter()
    while (frame := bench.host.receive()) is not None:
        counts[frame.arbitration_id] += 1
    assert counts == {
        0x221: 50,
        0x311: 50,
        0x251: 50,
        0x252: 50,
        0x211: 5,
        0x261: 10,
        0x262: 10,
        0x361: 2,
    }


def test_how_often_it_is_stepped_changes_nothing() -> None:
    coarse, fine = Bench(), Bench()
    for bench in (coarse, fine):
        bench.say(ControlModeCommand(CAN), MotionCommand(0.4, 0.2))
    coarse.base.advance_to(400 * MS)
    for now_ms in range(401):
        fine.base.advance_to(now_ms * MS)
    assert coarse.far.sent == fine.far.sent
    assert coarse.plant.pose == fine.plant.pose


def test_powers_up_in_standby_and_ignores_motion_there() -> None:
    bench = Bench()
    told = bench.run(500, MotionCommand(0.5, 0.0))
    assert bench.plant.track_travel_m == (0.0, 0.0)
    state = newest(told, SystemState)
    assert isinstance(state, SystemState)
    assert (state.control_mode, state.vehicle_state) == (0, 0)


def test_obeys_in_command_mode_and_reports_its_tracks_not_its_slip() -> None:
    bench = Bench()
    told = bench.drive(0.5, 0.4, ms=2000)
    assert bench.plant.twist == pytest.approx((0.5, 0.32), abs=1e-6)
    assert newest(told, MotionFeedback) == MotionFeedback(0.5, 0.4)
    odometer = newest(told, Odometer)
    assert isinstance(odometer, Odometer)
    left_m, right_m = bench.plant.track_travel_m
    assert (odometer.left_mm, odometer.right_mm) == (round(left_m * 1000), round(right_m * 1000))


def test_stops_half_a_second_after_the_last_command() -> None:
    bench = Bench()
    bench.drive()
    bench.run(480)
    assert bench.plant.twist[0] == pytest.approx(0.5, abs=1e-3)
    bench.run(120)
    assert bench.plant.twist[0] < 0.4
    bench.run(1000)
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)
    bench.run(200, MotionCommand(0.5, 0.0))
    assert bench.plant.twist[0] > 0.2, "like the real one, it follows again at once: the host must not let it"


def test_only_motion_commands_keep_it_going() -> None:
    bench = Bench()
    bench.drive()
    bench.run(1500, ControlModeCommand(CAN))
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)


def test_the_system_state_counts_its_messages() -> None:
    bench = Bench()
    states = [message for message in bench.run(30_000) if isinstance(message, SystemState)]
    assert [state.count for state in states[:300]] == [k % 256 for k in range(300)]


def test_emergency_stop_outranks_commands_and_keeps_the_mode() -> None:
    bench = Bench()
    bench.drive()
    bench.base.press_estop()
    told = bench.run(1000, MotionCommand(0.5, 0.0))
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)
    state = newest(told, SystemState)
    assert isinstance(state, SystemState)
    assert (state.vehicle_state, state.control_mode) == (1, CAN)
    bench.base.release_estop()
    bench.run(500, MotionCommand(0.5, 0.0))
    assert bench.plant.twist[0] > 0.4, "the hazard that a driver has to latch against"


def test_remote_control_outranks_the_bus_and_hands_back_into_standby() -> None:
    bench = Bench()
    bench.drive()
    bench.base.take_over(-0.2)
    bench.say(ControlModeCommand(CAN))
    told = bench.run(1000, MotionCommand(0.5, 0.0))
    assert bench.plant.twist[0] == pytest.approx(-0.2, abs=1e-3)
    state = newest(told, SystemState)
    assert isinstance(state, SystemState)
    assert state.control_mode == 3
    bench.base.hand_back()
    bench.run(1000, MotionCommand(0.5, 0.0))
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)


def test_restart_is_silence_then_standby_with_a_new_odometer() -> None:
    bench = Bench(boot_ms=300)
    bench.drive()
    bench.base.restart()
    assert bench.run(280, MotionCommand(0.5, 0.0)) == []
    told = bench.run(600, MotionCommand(0.5, 0.0))
    state, odometer = newest(told, SystemState), newest(told, Odometer)
    assert isinstance(state, SystemState)
    assert isinstance(odometer, Odometer)
    assert state.control_mode == 0
    assert state.count < 10
    assert 0 <= odometer.left_mm < 200, "only the way it rolled out"


def test_exception_frozen_and_muted() -> None:
    bench = Bench()
    bench.drive()
    bench.base.raise_exception(0x0100)
    state = newest(bench.run(200), SystemState)
    assert isinstance(state, SystemState)
    assert (state.vehicle_state, state.fault_bits) == (2, 0x0100)
    bench.base.clear_exception()
    bench.base.mute(0x221)
    assert not any(isinstance(message, MotionFeedback) for message in bench.run(200))
    bench.base.mute()
    assert any(isinstance(message, MotionFeedback) for message in bench.run(200))
    bench.base.freeze()
    assert bench.run(200) == []
    bench.base.thaw()
    assert bench.run(200) != []


def test_a_frozen_base_still_stops_its_motors() -> None:
    bench = Bench()
    bench.drive()
    bench.base.freeze()
    bench.run(1500, MotionCommand(0.5, 0.0))
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)


def test_an_unplugged_base_stops_and_does_not_mind() -> None:
    bench = Bench()
    bench.drive()
    bench.far.unplug()
    bench.run(1500)
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)
    bench.far.plug()
    assert bench.run(40) != []


def test_a_scout_reports_four_motors() -> None:
    bench = Bench(model=SCOUT)
    bench.base.advance_to(100 * MS)
    heard = set()
    while (frame := bench.host.receive()) is not None:
        heard.add(frame.arbitration_id)
    assert {0x251, 0x252, 0x253, 0x254, 0x261, 0x262, 0x263, 0x264} <= heard


def test_a_bunker_mini_falls_back_into_standby_when_its_mode_is_not_repeated() -> None:
    for model, v_mps in ((BUNKER, 0.5), (BUNKER_MINI, 0.0)):
        bench = Bench(model=model)
        bench.drive(ms=1500)
        assert bench.plant.twist[0] == pytest.approx(v_mps, abs=1e-3)
