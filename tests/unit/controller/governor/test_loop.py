"""The governor's control loop with a fake clock and a base that obeys at once."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from config.decision import DecisionConfig
from config.governor import GovernorConfig
from controller.base.drive_lifecycle import ARM_TIMEOUT_S, Outcome
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.governor.governor import SpeedGovernor
from controller.governor.inbox import RequestState
from controller.governor.loop import GovernorLoop
from controller.governor.request import Twist
from hal.types import ChassisMode, ChassisState, PlanarPose, Setpoint
from tests.support.governor_rig import GO, MOUNT, PERIOD_NS, ROBOT, Planner, Rig
from tests.support.imperfect_base import ImperfectBase
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.scenes import ORIGIN, free_space, scene


def test_nothing_moves_before_the_base_is_armed_and_then_it_does_as_asked() -> None:
    rig = Rig(arms_after=40)
    steps = rig.run(5.0)
    assert rig.chassis.armed_at_ns == [0]
    assert all(one.setpoint.v_mps == 0.0 for one in steps[:41])
    assert "the chassis is not armed (arming)" in steps[20].decision.reason.sentence
    assert steps[-1].setpoint.v_mps == pytest.approx(0.6)
    assert steps[-1].setpoint.w_radps == pytest.approx(0.1)
    assert steps[-1].progress_m == pytest.approx(
        sum(0.02 * one.setpoint.v_mps for one in steps[:-1]), abs=0.02
    )


def test_odometry_has_the_time_for_which_the_chassis_tells_it() -> None:
    rig = Rig(chassis=ObedientChassis(stamp_offset_ns=4_000_000))
    last, localiser = rig.run(2.0)[-1], rig.loop.localiser
    assert last.setpoint.v_mps > 0.2
    assert localiser.body_pose(last.now_ns + 4_000_000) == localiser.pose
    assert localiser.body_pose(last.now_ns) != localiser.pose


class LosingChassis(ObedientChassis):
    """For three exchanges on its way nobody knows where it is."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        state = super().exchange(setpoint, now_ns)
        lost = 60 <= len(self.sent) < 63
        return replace(state, pose=PlanarPose(math.nan, 0.0, 0.0)) if lost else state


class RunningAway(ObedientChassis):
    """Tells of going faster than it was told."""

    def __init__(self, gain: float) -> None:
        super().__init__()
        self._gain = gain

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        state = super().exchange(setpoint, now_ns)
        return replace(state, v_mps=self._gain * state.v_mps)


def test_a_base_that_does_not_say_for_a_moment_where_it_is_is_governed_on() -> None:
    rig = Rig(chassis=LosingChassis())
    steps = rig.run(6.0)
    faults = [index for index, one in enumerate(steps) if one.decision.reason.rule == "fault"]
    assert faults == [60, 61, 62]
    way_m = sum(PERIOD_S * one.setpoint.v_mps for one in steps[3:])
    assert steps[-1].progress_m == pytest.approx(way_m, abs=1e-3)
    assert steps[-1].setpoint.v_mps == pytest.approx(0.6)


def test_the_planner_is_told_what_really_went_out() -> None:
    rig = Rig()
    steps = rig.run(3.0)
    sent = [(one.setpoint.v_mps, one.setpoint.w_radps) for one in steps]
    assert [(v, w) for v, w, _, _ in rig.planner.told] == sent
    assert rig.planner.told[-1][2:] == ("requested", "armed")


def test_silence_is_a_jerk_limited_stop_and_no_end() -> None:
    rig = Rig(lambda t: RequestState(None, "no command for 251 ms") if 3.0 <= t < 6.0 else GO)
    steps = rig.run(9.0)
    assert not rig.loop.finished
    assert steps[150].decision.reason.sentence == "no command for 251 ms: stop"
    assert steps[299].setpoint.v_mps == 0.0
    assert steps[-1].setpoint.v_mps == pytest.approx(0.6)
    assert rig.chassis.armed_at_ns == [0]
    jerks = [abs(b.setpoint.a_mps2 - a.setpoint.a_mps2) / 0.02 for a, b in itertools.pairwise(steps)]
    assert max(jerks) <= ROBOT.limits.max_jerk_mps3 + 1e-6


def test_a_latched_base_ends_it_and_no_command_leads_out() -> None:
    rig = Rig()
    rig.run(3.0)
    rig.chassis.fault = ChassisMode.ESTOP
    rig.run(1.0)
    assert (rig.loop.lifecycle.outcome, rig.loop.lifecycle.stop_reason) == (
        Outcome.CHASSIS_FAULT,
        "e-stop pressed",
    )
    assert (len(rig.chassis.stopped_at_ns), len(rig.chassis.armed_at_ns)) == (1, 1)


def test_a_base_that_never_arms_is_given_up() -> None:
    rig = Rig()
    rig.chassis.fault = ChassisMode.STANDBY
    steps = rig.run(ARM_TIMEOUT_S + 1.0)
    assert rig.loop.lifecycle.outcome is Outcome.NOT_ARMED
    assert steps[-1].now_ns == pytest.approx((ARM_TIMEOUT_S + 0.02) * 1e9, abs=3e7)


@pytest.mark.parametrize("asked", [GO, RequestState(Twist(0.0, 0.5))])
def test_a_requested_stop_comes_to_rest_whatever_is_asked_and_ends(asked: RequestState) -> None:
    rig = Rig(lambda _: asked)
    rig.run(3.0)
    rig.loop.request_stop("SIGTERM received")
    rig.loop.request_stop("later", Outcome.BROKEN_OFF)
    steps = rig.run(20.0)
    assert (rig.loop.lifecycle.outcome, rig.loop.lifecycle.stop_reason) == (
        Outcome.STOPPED,
        "SIGTERM received",
    )
    last = steps[-1].setpoint
    assert (last.v_mps, last.a_mps2, last.w_radps) == (0.0, 0.0, 0.0)
    assert steps[-1].decision.reason.sentence == "SIGTERM received: stop"


def test_the_way_ahead_is_the_arc_for_pictures() -> None:
    steps = Rig().run(3.0)
    ahead = steps[-1].ahead_m
    assert ahead is not None
    # Six metres round: curvature 1/6 to the left.
    assert (ahead[:, 0] ** 2 + (ahead[:, 1] - 6.0) ** 2) ** 0.5 == pytest.approx(6.0, abs=1e-6)
    assert ahead[0] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_base_that_fell_behind_is_told_zero_and_begins_again_gently() -> None:
    """controller/base/response_monitor.py, as in a drive along a path."""
    base = ImperfectBase(unresponsive_s=(3.0, 3.8))
    planner = Planner(lambda _: GO)
    governor = SpeedGovernor(GovernorConfig(), DecisionConfig(), ROBOT, MOUNT, PERIOD_S)
    response = ResponseMonitor(0.2, ROBOT.limits.max_speed_mps)
    loop = GovernorLoop(governor, planner, Localiser(ORIGIN, MOUNT), base, response)
    steps = []
    for k in range(500):
        seen = scene(k * PERIOD_NS, k, space=free_space(), pose=loop.localiser.pose)
        steps.append(loop.step(seen, k * PERIOD_NS))
    told = [index for index, one in enumerate(steps) if one.unanswered]
    assert len(told) == 1
    at = steps[told[0]]
    assert (at.setpoint.v_mps, at.setpoint.w_radps) == (0.0, 0.0)
    assert at.unanswered in at.decision.reason.sentence
    rises_mps = [base.speeds[k + 10] - base.speeds[k] for k in range(told[0] + 5, 480)]
    assert max(rises_mps) < 0.1, "in 0.2 s; comfort is 0.06"
    assert steps[-1].setpoint.v_mps == pytest.approx(0.6), "and goes on as asked"


@pytest.mark.parametrize("gain", [2.0, 6.0])
def test_a_base_that_runs_away_is_not_told_to_go_faster(gain: float) -> None:
    rig = Rig(lambda _: RequestState(Twist(1.0, 0.0)), chassis=RunningAway(gain))
    held = [one.setpoint.v_mps for one in rig.run(6.0)][-100:]
    assert max(held) - min(held) < 0.01
    assert 0.0 < held[-1] < 0.45
