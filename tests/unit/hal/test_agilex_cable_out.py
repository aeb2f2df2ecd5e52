"""The CAN cable is out while the adapter works: what waits in its queue must not move the base afterwards."""

from __future__ import annotations

from collections import deque

import can
import pytest

from config.chassis import CanLinkConfig
from config.plant import PlantConfig
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import ActuatorSlow, MotionCommand, MotionFeedback
from hal.chassis.agilex_models import model_of
from hal.links.can_bus import CanBusLink
from hal.links.scripted import ScriptedCanLink
from hal.types import CanFrame, ChassisMode, ChassisState, Setpoint
from sim.emulators.agilex import AgilexEmulator
from sim.plant import TrackedPlant
from tests.support.agilex_bench import Bench
from tests.support.chassis_rig import MS, agilex_config

ZERO = bytes(8)


class Kernel:
    """The network device can0: its queue remains when a socket is closed.

    queue_length: frames that wait while nobody acknowledges. base: the link of the base on the bus.
    """

    def __init__(self, queue_length: int) -> None:
        self.base = ScriptedCanLink()
        self.queue: deque[can.Message] = deque()
        self._arrived: deque[CanFrame] = deque()
        self.opened = 0
        self._queue_length = queue_length
        self._cable_out = False

    def transmit(self, message: can.Message) -> None:
        if not self._cable_out:
            self.base.deliver(CanFrame(message.arbitration_id, bytes(message.data)))
        elif len(self.queue) < self._queue_length:
            self.queue.append(message)
        else:
            raise can.CanOperationError("Transmit buffer full")

    def received(self) -> can.Message | None:
        self._take_from_base()
        if not self._arrived:
            return None
        frame = self._arrived.popleft()
        return can.Message(arbitration_id=frame.arbitration_id, data=frame.data, is_extended_id=False)

    def _take_from_base(self) -> None:
        if not self._cable_out:
            self._arrived.extend(self.base.sent)
        self.base.sent.clear()

    def pull_cable(self) -> None:
        """What the base has sent until now is still received."""
        self._take_from_base()
        self._cable_out = True

    def connect_cable(self) -> None:
        self._cable_out = False
        while self.queue:
            self.transmit(self.queue.popleft())
        self.base.sent.clear()


class Socket(can.BusABC):
    """A socket of python-can on that device."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        kernel.opened += 1
        super().__init__(channel="can0")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._kernel.transmit(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return self._kernel.received(), False


class Drive:
    """Driver, SocketCAN and an emulated base, each 20 ms."""

    def __init__(self, kernel: Kernel, **changes: object) -> None:
        config = agilex_config(None, **changes)
        link = CanBusLink(CanLinkConfig(interface="socketcan", channel="can0"))
        plant = TrackedPlant(PlantConfig(slip_factor=1.0))
        self.emulator = AgilexEmulator(kernel.base, plant, model=model_of(config))
        self.chassis = AgilexChassis(link, config)
        self.now_ns = 0

    def step(self, v_mps: float) -> ChassisState:
        self.now_ns += 20 * MS
        self.emulator.advance_to(self.now_ns)
        return self.chassis.exchange(Setpoint(self.now_ns, v_mps, 0.0, 0.0), self.now_ns)

    def steps(self, count: int, v_mps: float) -> ChassisState:
        for _ in range(count):
            state = self.step(v_mps)
        return state


@pytest.mark.parametrize("model", ["bunker", "bunker_mini"])
@pytest.mark.parametrize("queue_length", [3, 10, 1000])
@pytest.mark.parametrize("feedback_timeout_ms", [200, 600])
@pytest.mark.parametrize("first_mps", [0.0, 0.5])
def test_nothing_moves_when_the_cable_is_plugged_in_again(
    monkeypatch: pytest.MonkeyPatch,
    model: str,
    queue_length: int,
    feedback_timeout_ms: int,
    first_mps: float,
) -> None:
    """A BUNKER MINI is sent its mode again and again, too.

    first_mps: commanded until 180 ms after the cable came out; then the command is 0.5 m/s.
    """
    kernel = Kernel(queue_length)
    monkeypatch.setattr(can, "Bus", lambda **options: Socket(kernel))
    drive = Drive(kernel, model=model, feedback_timeout_ms=feedback_timeout_ms)
    with drive.emulator, drive.chassis:
        drive.steps(20, 0.0)
        drive.chassis.arm(drive.now_ns)
        drive.steps(20, 0.0)
        assert drive.steps(100, first_mps).mode is ChassisMode.ARMED
        drive.emulator.advance_to(drive.now_ns + 20 * MS)
        kernel.pull_cable()
        drive.steps(9, first_mps)
        assert drive.steps(250, 0.5).mode is ChassisMode.LOST
        commands = [bytes(one.data) for one in kernel.queue if one.arbitration_id == 0x111]
        moving = sum(data != ZERO for data in commands)
        assert moving <= 2
        assert (moving > 0) == (first_mps > 0.0), "motion is sent once more, and waits"
        assert commands[-1] == ZERO
        stood_m = drive.emulator.plant.track_travel_m
        kernel.connect_cable()
        for _ in range(150):
            assert drive.step(0.5).mode is ChassisMode.LOST
            assert drive.emulator.plant.twist == pytest.approx((0.0, 0.0), abs=1e-9)
        assert drive.emulator.plant.track_travel_m == pytest.approx(stood_m)
        assert kernel.opened > 1 or queue_length == 1000, "a full queue loses the link, which is opened anew"
        drive.steps(2, 0.0)
        drive.chassis.arm(drive.now_ns)
        assert drive.steps(20, 0.0).reason == "armed"


@pytest.mark.parametrize("heard", [MotionFeedback(0.5, 0.0), ActuatorSlow(0, 48.0, 30, 30, 0x40)])
def test_motion_is_held_back_after_two_frames_without_an_answer(heard: MotionFeedback | ActuatorSlow) -> None:
    bench = Bench()
    bench.arm()
    sent = []
    for _ in range(4):
        state = bench.exchange(0.5)
        assert state.mode is ChassisMode.ARMED
        sent.append(state.sent is not None)
    assert sent == [True, False, False, False], "the first zero counts, too"
    bench.deliver(heard)
    assert bench.exchange(0.6).mode is ChassisMode.ARMED
    assert bench.sent() == [MotionCommand(0.6, 0.0)]


def test_a_zero_is_never_held_back() -> None:
    bench = Bench()
    bench.arm()
    for _ in range(4):
        bench.exchange(0.5)
    for _ in range(3):
        bench.exchange(0.0)
        assert bench.sent() == [MotionCommand(0.0, 0.0)]
