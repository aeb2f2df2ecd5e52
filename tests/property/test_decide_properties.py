"""Whatever perception says in whatever order: the command keeps its limits, every decision has a reason."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from config.decision import DecisionConfig
from config.robot import Robot
from controller.decision.decide import DecisionMaker
from controller.decision.situation import Situation
from controller.path.path import OnPath
from controller.shape import SpeedShaper
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import line_path
from tests.support.scenes import STILL, free_space
from vision.scene import CameraCondition, CameraHealth, Obstacle, Scene

MOUNT = CameraMount(0.45, 0.0, 0.60, math.radians(4.0))
PATH = line_path(20.0)
PERIOD_NS = 20_000_000

odd = st.sampled_from([math.nan, math.inf, -math.inf, 1e9, -1e9])


def mostly(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[float]:
    return st.one_of(numbers, numbers, numbers, numbers, numbers, odd)


obstacles = st.builds(
    lambda number, x, y, z, wide, deep, vx, vz, sigma, moving, age: Obstacle(
        id=number,
        bbox_px=(0.0, 0.0, 1.0, 1.0),
        position_m=np.array([x, y, z]),
        extent_m=np.array([wide, 1.0, deep]),
        velocity_mps=np.array([vx, 0.0, vz]),
        velocity_cov=np.diag([sigma, sigma, sigma]),
        moving=moving,
        score=0.5,
        fragments=1,
        age_s=age,
        unseen_s=0.0,
    ),
    st.integers(1, 4),
    mostly(st.floats(-4.0, 4.0)),
    st.floats(-0.5, 0.5),
    mostly(st.floats(0.2, 10.0)),
    mostly(st.floats(0.0, 3.0)),
    st.floats(0.0, 2.0),
    mostly(st.floats(-2.0, 2.0)),
    mostly(st.floats(-2.0, 2.0)),
    mostly(st.floats(0.0, 2.0)),
    st.booleans(),
    mostly(st.floats(0.0, 3.0)),
)
looks = st.tuples(
    st.lists(obstacles, max_size=3),
    mostly(st.floats(0.0, 10.0)),
    mostly(st.floats(0.0, 10.0)),
    st.sampled_from(CameraCondition),
    st.integers(-200, 600),
    st.booleans(),
)
steps = st.tuples(
    st.one_of(st.none(), looks),
    st.integers(1, 40),
    st.sampled_from([1, 1, 1, 1, 0, -5]),
    mostly(st.just(0.0)),
)


@settings(max_examples=50, deadline=None)
@given(st.lists(steps, min_size=1, max_size=8))
def test_limits_hold_and_reasons_are_given_for_any_sequence(
    sequence: list[
        tuple[tuple[list[Obstacle], float, float, CameraCondition, int, bool] | None, int, int, float]
    ],
) -> None:
    robot = Robot()
    limits = robot.limits
    maker = DecisionMaker(DecisionConfig(), robot, MOUNT, 0.02)
    shaper = SpeedShaper(limits, 0.02)
    now_ns, x, frame = 10_000_000_000, 0.0, 0
    scene: Scene | None = None
    for look, count, tick, beside in sequence:
        if look is None:
            scene = None
        else:
            seen, nearest, known, condition, age_ms, posed = look
            frame += 1
            scene = Scene(
                now_ns - age_ms * 1_000_000,
                frame,
                tuple(seen),
                free_space(known_m=known, nearest_m=nearest),
                STILL,
                CameraHealth(condition, "odd", 0.5),
                PlanarPose(x, 0.0, 0.0) if posed else None,
            )
        for _ in range(count):
            now_ns += tick * PERIOD_NS
            pose = PlanarPose(x, beside, 0.0)
            decision = maker.step(
                Situation(scene, PATH, pose, OnPath(x, beside, 0.0), shaper.v_mps, shaper.a_mps2, now_ns)
            )
            assert 0.0 <= decision.target_speed_mps <= limits.max_speed_mps
            assert decision.reason.rule
            assert decision.reason.sentence
            v, a = shaper.v_mps, shaper.a_mps2
            shaped = shaper.step(
                decision.target_speed_mps,
                emergency=decision.emergency,
                distance_to_end_m=PATH.length_m - x,
            )
            assert shaped.fault == ""
            assert 0.0 <= shaped.v_mps <= limits.max_speed_mps + 1e-6
            assert -limits.emergency_decel_mps2 - 1e-6 <= shaped.a_mps2 <= limits.max_accel_mps2 + 1e-6
            assert abs(shaped.a_mps2 - a) <= limits.emergency_jerk_mps3 * 0.02 + 1e-6
            x += 0.5 * (v + shaped.v_mps) * 0.02
            unusable = scene is None or not math.isfinite(beside) or abs(beside) > 0.5
            if unusable and frame == 0:
                assert decision.target_speed_mps == 0.0
