"""Held tracks, dead encoders and motors that run away, on every emulated base: no fault bit tells of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from hal.types import ChassisMode
from sim.plant import TrackedPlant
from tests.support.chassis_rig import Rig
from tests.support.contract_rigs import EMULATED


@pytest.fixture(params=list(EMULATED))
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    with EMULATED[request.param]() as one:
        yield one


@contextmanager
def obeying_nobody(plant: TrackedPlant, v_mps: float, w_radps: float) -> Iterator[None]:
    """The plant goes on with this motion, whatever it is told."""
    plant.command(v_mps, w_radps)
    with pytest.MonkeyPatch.context() as deaf:
        deaf.setattr(plant, "command", lambda v_mps, w_radps: None)
        deaf.setattr(plant, "command_tracks", lambda left_mps, right_mps: None)
        yield


def test_a_base_that_tells_of_no_motion_when_told_to_move_latches(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.3)
    with obeying_nobody(rig.plant, 0.0, 0.0):
        rig.run(2.5, 0.5)
        assert rig.state.mode is ChassisMode.ESTOP
        assert "does not follow" in rig.state.reason
        state = rig.run(1.0, 0.5)
        assert state.mode is ChassisMode.ESTOP
        assert state.sent is None or (state.sent.v_mps, state.sent.w_radps) == (0.0, 0.0)
    rig.run(1.0, 0.5)
    assert rig.is_standing(), "free again, and yet it needs consent"
    rig.step()
    rig.arm()
    rig.run(2.0, 0.3)
    assert rig.plant.twist[0] == pytest.approx(0.3, abs=rig.tolerance_mps)


def test_a_base_that_rolls_back_latches(rig: Rig) -> None:
    """On a slope that its motors do not hold."""
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.3)
    rig.run(1.0, 0.0)
    with obeying_nobody(rig.plant, -0.2, 0.0):
        rig.run(2.5, 0.0)
        assert rig.state.mode is ChassisMode.ESTOP
        assert "rolls back" in rig.state.reason
    rig.plant.command(0.0, 0.0)
    rig.run(1.0, 0.5)
    assert rig.is_standing(), "held again, and yet it needs consent"


@pytest.mark.parametrize(("v_mps", "w_radps"), [(0.4, 0.0), (0.0, 1.0)])
def test_a_base_that_moves_on_its_own_latches_and_one_that_is_not_armed_may(
    rig: Rig, v_mps: float, w_radps: float
) -> None:
    rig.run(0.2)
    with obeying_nobody(rig.plant, v_mps, w_radps):
        assert rig.run(3.0, 0.0).mode is ChassisMode.STANDBY, "pushed, or driven by somebody else"
    rig.plant.command(0.0, 0.0)
    rig.run(1.0, 0.0)
    rig.arm()
    rig.run(1.0, 0.0)
    with obeying_nobody(rig.plant, v_mps, w_radps):
        rig.run(2.0, 0.0)
        assert rig.state.mode is ChassisMode.ESTOP
        assert "does not follow" in rig.state.reason
    rig.plant.command(0.0, 0.0)
    rig.run(1.0, 0.5)
    assert rig.is_standing(), "it stands again, and yet it needs consent"
