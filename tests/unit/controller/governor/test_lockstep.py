"""The whole governor in lock-step: rendered camera, perception, CAN, emulated base, a scripted planner."""

from __future__ import annotations

import math
from contextlib import ExitStack
from pathlib import Path

import pytest
import yaml

from config.app import AppConfig, LockstepRunner, load_app
from config.loader import CONFIG_DIR
from controller.build import build_path, build_perceiver, build_simulation, open_simulated_camera
from controller.build_chassis import build_base
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.governor.build import build_governor_loop
from controller.governor.inbox import RequestState
from controller.governor.request import Twist
from controller.lockstep import run_lockstep
from controller.record.tally import SetpointTally
from hal.clocks import SimulatedClock


class LeftBend:
    """Asks for one arc, always."""

    def poll(self, now_ns: int) -> RequestState:
        return RequestState(Twist(0.7, 0.07))

    def tell(self, v_mps: float, w_radps: float, decision: Decision, chassis: str) -> None:
        return None


def governed(folder: Path, crate_x_m: float, crate_y_m: float) -> AppConfig:
    scenario = yaml.safe_load((CONFIG_DIR / "scenarios" / "crate_on_path.yaml").read_text())
    crate = next(one for one in scenario["bodies"] if "on the path" in one["name"])
    crate |= {"x_m": crate_x_m, "y_m": crate_y_m}
    del crate["motion"]
    (folder / "crate.yaml").write_text(yaml.safe_dump(scenario))
    config = yaml.safe_load((CONFIG_DIR / "governor.yaml").read_text())
    config["camera"]["fps"] = 10.0
    config["simulation"]["scenario"] = str(folder / "crate.yaml")
    config["chassis"]["link"]["channel"] = f"treadwatch-{folder.name}"
    (folder / "governor.yaml").write_text(yaml.safe_dump(config))
    return load_app(folder / "governor.yaml")


def test_a_crate_on_the_arc_stops_it_in_time(tmp_path: Path) -> None:
    # On the arc of 10 m radius, 0.4 rad along: beside a straight way.
    config = governed(tmp_path, 3.9, 0.79)
    clock = SimulatedClock()
    chassis, emulator = build_base(config, build_path(config).start, 0)
    assert emulator is not None
    simulation = build_simulation(config, emulator, 0)
    camera = open_simulated_camera(config, clock, lambda _: simulation.body_pose, 0)
    tally = SetpointTally(config.robot.limits, 0.02)
    steps: list[ControlStep] = []
    with ExitStack() as devices:
        for device in (simulation, chassis, camera):
            devices.enter_context(device)
        loop = build_governor_loop(config, chassis, LeftBend())
        perceiver = build_perceiver(config, loop.localiser, loop.localiser.body_pose, lambda: 0)
        runner = LockstepRunner(kind="lockstep", max_duration_s=9.0)
        for moment in run_lockstep(runner, clock, simulation, camera, perceiver, loop):
            steps.append(moment.control)
            tally.add(moment.control.chassis.sent)
    assert max(one.setpoint.v_mps for one in steps) > 0.5
    assert steps[-1].setpoint.v_mps == 0.0
    assert steps[-1].decision.reason.rule in ("static", "depth")
    assert not simulation.referee.contacts
    assert simulation.referee.closest is not None
    assert 0.3 < simulation.referee.closest.distance_m < 0.7
    assert (tally.violations, tally.reversals) == (0, 0)
    for one in steps:
        assert one.setpoint.w_radps == pytest.approx(0.1 * one.setpoint.v_mps)
    # Its own odometry is on the arc; the floor makes it slip a tenth of every turn.
    last = steps[-1].pose
    assert math.hypot(last.x_m, last.y_m - 10.0) == pytest.approx(10.0, abs=0.05)
