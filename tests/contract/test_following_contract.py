"""Held tracks, dead encoders and motors that run away, on every emulated base: no fault bit tells of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hal.types import ChassisMode
from tests.support.chassis_rig import Rig
from tests.support.contract_rigs import EMULATED


@pytest.fixture(params=list(EMULATED))
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    with EMULATED[request.param]() as one:
        yield one


def test_a_base_that_tells_of_no_motion_when_told_to_move_latches(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.3)
    with monkeypatch.context() as held:
        rig.plant.command(0.0, 0.0)
        held.setattr(rig.plant, "command", lambda v_mps, w_radps: None)
        held.setattr(rig.plant, "command_tracks", lambda left_mps, right_mps: None)
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


def test_a_base_that_rolls_back_latches(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a slope that its motors do not hold."""
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.3)
    rig.run(1.0, 0.0)
    with monkeypatch.context() as slope:
        rig.plant.command(-0.2, 0.0)
        slope.setattr(rig.plant, "command", lambda v_mps, w_radps: None)
        slope.setattr(rig.plant, "command_tracks", lambda left_mps, right_mps: None)
        rig.run(2.5, 0.0)
        assert rig.state.mode is ChassisMode.ESTOP
        assert "rolls back" in rig.state.reason
    rig.plant.command(0.0, 0.0)
    rig.run(1.0, 0.5)
    assert rig.is_standing(), "held again, and yet it needs consent"


@pytest.mark.parametrize(("v_mps", "w_radps"), [(0.4, 0.0), (0.0, 1.0)])
def test_a_base_that_moves_on_its_own_latches_and_one_that_is_not_armed_may(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, v_mps: float, w_radps: float
) -> None:
    rig.run(0.2)
    with monkeypatch.context() as away:
        rig.plant.command(v_mps, w_radps)
        away.setattr(rig.plant, "command", lambda v_mps, w_radps: None)
        away.setattr(rig.plant, "command_tracks", lambda left_mps, right_mps: None)
        assert rig.run(3.0, 0.0).mode is ChassisMode.STANDBY, "pushed, or driven by somebody else"
    rig.plant.command(0.0, 0.0)
    rig.run(1.0, 0.0)
    rig.arm()
    rig.run(1.0, 0.0)
    with monkeypatch.context() as away:
        rig.plant.command(v_mps, w_radps)
        away.setattr(rig.plant, "command", lambda v_mps, w_radps: None)
        away.setattr(rig.plant, "command_tracks", lambda left_mps, right_mps: None)
        rig.run(2.0, 0.0)
        assert rig.state.mode is ChassisMode.ESTOP
        assert "does not follow" in rig.state.reason
    rig.plant.command(0.0, 0.0)
    rig.run(1.0, 0.5)
    assert rig.is_standing(), "it stands again, and yet it needs consent"
