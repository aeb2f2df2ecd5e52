import math

import pytest

from config.robot import Limits, Robot
from controller.governor.arcs import (
    Kind,
    MotionRequest,
    arc_path,
    corner_m,
    driveable,
    stop_reason_of,
    tightest_m,
    understand,
)
from controller.governor.request import Twist
from hal.types import PlanarPose

ROBOT = Robot()


def test_the_corner_of_the_body() -> None:
    assert corner_m(ROBOT) == pytest.approx(math.hypot(0.51, 0.39))


@pytest.mark.parametrize(
    ("twist", "asked"),
    [
        (Twist(0.0, 0.0), MotionRequest(Kind.STAND)),
        (Twist(-0.004, 0.004), MotionRequest(Kind.STAND)),
        (Twist(0.5, 0.0), MotionRequest(Kind.ARC, 0.5, 0.0)),
        (Twist(0.5, 0.25), MotionRequest(Kind.ARC, 0.5, 0.5)),
        (Twist(0.5, 5e-6), MotionRequest(Kind.ARC, 0.5, 1e-5)),
        (Twist(0.5, -0.25), MotionRequest(Kind.ARC, 0.5, -0.5)),
        # The robot's own limits: speed, and 80 % of the yaw rate of 0.8 rad/s.
        (Twist(3.0, 0.3), MotionRequest(Kind.ARC, 1.5, 0.1)),
        (Twist(1.0, 1.0), MotionRequest(Kind.ARC, 0.64, 1.0)),
        (Twist(0.0, 0.5), MotionRequest(Kind.TURN, 0.5 * corner_m(ROBOT), left=1)),
        (Twist(0.0, -9.0), MotionRequest(Kind.TURN, 0.8 * corner_m(ROBOT), left=-1)),
    ],
)
def test_twist_gives_its_kind_speed_and_curvature(twist: Twist, asked: MotionRequest) -> None:
    understood = understand(twist, ROBOT)
    assert understood.kind is asked.kind
    assert understood.speed_mps == pytest.approx(asked.speed_mps)
    assert understood.curvature_1pm == pytest.approx(asked.curvature_1pm)
    assert understood.left == asked.left


@pytest.mark.parametrize(
    ("twist", "why"),
    [
        (Twist(-0.3, 0.0), "reverse at 0.30 m/s is refused: the camera does not see behind"),
        (Twist(0.1, 0.5), "a radius of 0.20 m is tighter than this robot can drive (0.39 m)"),
        (Twist(math.nan, 0.0), "not a number"),
        (Twist(0.5, math.inf), "not a number"),
    ],
)
def test_bad_twist_is_refused_with_its_reason(twist: Twist, why: str) -> None:
    asked = understand(twist, ROBOT)
    assert (asked.kind, asked.speed_mps) == (Kind.REFUSED, 0.0)
    assert why in asked.why


def test_every_arc_that_is_not_refused_can_be_laid_out() -> None:
    for yaw in (0.3, 0.8, 5.0):
        robot = Robot(limits=Limits(max_yaw_rate_radps=yaw))
        tightest = 1.0 / tightest_m(robot)
        for curvature in (0.0, 1e-4, -0.01, 0.3, -1.0, 0.999 * tightest, -0.999 * tightest):
            asked = understand(Twist(0.5, 0.5 * curvature), robot)
            if asked.kind is Kind.REFUSED:
                assert abs(curvature) > tightest
                continue
            path = arc_path(PlanarPose(1.0, 2.0, 3.0), asked.curvature_1pm, asked.speed_mps, 10.0, robot)
            assert path.curvature(0.01) == pytest.approx(asked.curvature_1pm)
            assert path.start.heading_rad == pytest.approx(3.0)
            assert path.speed_limit(0.0) == pytest.approx(asked.speed_mps)


def test_an_arc_is_looked_along_as_far_as_the_camera_sees_but_not_round_in_a_circle() -> None:
    pose = PlanarPose(0.0, 0.0, 0.0)
    assert arc_path(pose, 0.0, 1.0, 10.0, ROBOT).length_m == pytest.approx(12.0)
    assert arc_path(pose, 1e-5, 1.0, 10.0, ROBOT).length_m == pytest.approx(12.0)
    assert arc_path(pose, 0.1, 1.0, 10.0, ROBOT).length_m == pytest.approx(12.0)
    assert arc_path(pose, 1.0, 0.5, 10.0, ROBOT).length_m == pytest.approx(3.0)
    assert arc_path(pose, -2.0, 0.2, 10.0, ROBOT).length_m == pytest.approx(1.0)


def test_at_speed_an_arc_is_only_as_tight_as_the_yaw_rate_admits() -> None:
    asked = understand(Twist(0.4, -0.8), ROBOT)
    assert asked.curvature_1pm == pytest.approx(-2.0)
    assert driveable(asked, 0.2, ROBOT) == asked
    assert driveable(asked, 1.0, ROBOT).curvature_1pm == pytest.approx(-0.8)
    assert driveable(asked, 1.0, ROBOT).speed_mps == asked.speed_mps


@pytest.mark.parametrize(
    ("asked", "requested", "rule", "sentence"),
    [
        (MotionRequest(Kind.REFUSED, why="silence"), None, "no command", "silence: stop"),
        (MotionRequest(Kind.REFUSED, why="reverse"), Twist(-1.0, 0.0), "refused", "reverse: stop"),
        (MotionRequest(Kind.STAND), Twist(0.0, 0.0), "requested", "asked to stand"),
        (
            MotionRequest(Kind.TURN, 0.3, left=-1),
            Twist(0.0, -0.5),
            "requested",
            "stands before it can turn in place",
        ),
        (MotionRequest(Kind.ARC, 0.5), Twist(0.5, 0.0), "requested", "stands before it can drive on"),
    ],
)
def test_the_reason_of_a_stop_names_the_rule_and_what_was_asked(
    asked: MotionRequest, requested: Twist | None, rule: str, sentence: str
) -> None:
    reason = stop_reason_of(asked, requested)
    assert (reason.rule, reason.sentence) == (rule, sentence)
