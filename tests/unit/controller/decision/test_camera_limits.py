"""The limits by the camera's range, and by a camera that is degraded, frozen or lost."""

from __future__ import annotations

import pytest

from config.decision import DecisionConfig
from config.path import LineSpec, PathSpec
from config.robot import Limits, Robot
from controller.path.path import Path
from tests.support.decision_bench import AGE_NS, STEP_NS, Bench, obstacle
from tests.support.scenes import free_space
from vision.scene import CameraCondition, CameraHealth


def test_the_range_of_the_camera_limits_the_speed() -> None:
    fast = Robot(limits=Limits(max_speed_mps=3.0))
    wide = Path(PathSpec(segments=(LineSpec(kind="line", length_m=60.0),)), fast)
    bench = Bench(fast, DecisionConfig.model_validate({"sight": {"range_m": 8.0}}))
    decision = bench.step(bench.scene(), 1.0, path=wide)
    assert decision.reason.rule == "range"
    # v^2/1.4 + (0.175 + tau + 1.5/0.7) v + 1.5 (tau + 0.35) + 0.2 = 7.94, tau = 0.22 + 0.08
    v = decision.target_speed_mps
    assert v**2 / 1.4 + (0.175 + 0.3 + 1.5 / 0.7) * v + 1.5 * 0.65 + 0.2 == pytest.approx(7.94)


def test_a_degraded_camera_caps_the_speed() -> None:
    bench = Bench()
    poor = CameraHealth(CameraCondition.DEGRADED, "few features", 0.4)
    decision = bench.step(bench.scene(health=poor), 0.4)
    assert decision.target_speed_mps == 0.5
    assert "few features" in decision.reason.sentence


@pytest.mark.parametrize("somebody_walks", [False, True])
def test_robot_that_goes_blind_beside_a_walker_brakes_hard(somebody_walks: bool) -> None:
    bench = Bench()
    people = [obstacle(6.0, 2.0, vx_mps=1.0)] if somebody_walks else []
    bench.settle(*people)
    decision = bench.settle(*people, free=free_space(known_m=0.0))
    assert decision.target_speed_mps == 0.0
    assert decision.emergency == somebody_walks


def test_robot_without_a_good_scene_for_long_brakes_hard() -> None:
    """A frozen camera, with a new stamp every 20 ms, and one that falls silent."""
    covered = CameraHealth(CameraCondition.UNTRUSTWORTHY, "frozen", 0.9)
    for silent in (False, True):
        bench = Bench()
        bench.settle()
        last = bench.scene()
        bench.step(last)
        blind = [bench.step(last if silent else bench.scene(health=covered)) for _ in range(40)]
        hard_s = [(AGE_NS + (2 + k) * STEP_NS) / 1e9 for k, found in enumerate(blind) if found.emergency]
        assert min(hard_s) == pytest.approx(0.62)
        assert not bench.step(bench.scene(), 0.1).emergency
