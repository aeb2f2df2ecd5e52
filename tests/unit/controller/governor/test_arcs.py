import math

import pytest

from config.robot import Limits, Robot
from controller.governor.arcs import (
    Kind,
    Wish,
    arc_path,
    corner_m,
    driveable,
    tightest_m,
    understand,
    why_stop,
)
from controller.governor.request import Twist
from hal.types import PlanarPose

ROBOT = Robot()


def test_the_corner_of_the_body() -> None:
    assert corner_m(ROBOT) == pytest.approx(math.hypot(0.51, 0.39))


@pytest.mark.parametrize(
    ("twist", "wish"),
    [
        (Twist(0.0, 0.0), Wish(Kind.STAND)),
        (Twist(-0.004, 0.004), Wish(Kind.STAND)),
        (Twist(0.5, 0.0), Wish(Kind.ARC, 0.5, 0.0)),
        (Twist(0.5, 0.25), Wish(Kind.ARC, 0.5, 0.5)),
        (Twist(0.5, 5e-6), Wish(Kind.ARC, 0.5, 1e-5)),
        (Twist(0.5, -0.25), Wish(Kind.ARC, 0.5, -0.5)),
        # The robot's own limits: speed, and 80 % of the yaw rate of 0.8 rad/s.
        (Twist(3.0, 0.3), Wish(Kind.ARC, 1.5, 0.1)),
        (Twist(1.0, 1.0), Wish(Kind.ARC, 0.64, 1.0)),
        (Twist(0.0, 0.5), Wish(Kind.TURN, 0.5 * corner_m(ROBOT), left=1)),
        (Twist(0.0, -9.0), Wish(Kind.TURN, 0.8 * corner_m(ROBOT), left=-1)),
    ],
)
def test_twist_gives_its_kind_speed_and_curvature(twist: Twist, wish: Wish) -> None:
    understood = understand(twist, ROBOT)
    assert understood.kind is wish.kind
    assert understood.speed_mps == pytest.approx(wish.speed_mps)
    assert understood.curvature_1pm == pytest.approx(wish.curvature_1pm)
    assert understood.left == wish.left


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
    wish = understand(twist, ROBOT)
    assert (wish.kind, wish.speed_mps) == (Kind.REFUSED, 0.0)
    assert why in wish.why


def test_every_arc_that_is_not_refused_can_be_laid_out() -> None:
    for yaw in (0.3, 0.8, 5.0):
        robot = Robot(limits=Limits(max_yaw_rate_radps=yaw))
        tightest = 1.0 / tightest_m(robot)
        for curvature in (0.0, 1e-4, -0.01, 0.3, -1.0, 0.999 * tightest, -0.999 * tightest):
            wish = understand(Twist(0.5, 0.5 * curvature), robot)
            if wish.kind is Kind.REFUSED:
                assert abs(curvature) > tightest
                continue
            path = arc_path(PlanarPose(1.0, 2.0, 3.0), wish.curvature_1pm, wish.speed_mps, 10.0, robot)
            assert path.curvature(0.01) == pytest.approx(wish.curvature_1pm)
            assert path.start.heading_rad == pytest.approx(3.0)
            assert path.speed_limit(0.0) == pytest.approx(wish.speed_mps)


def test_an_arc_is_looked_along_as_far_as_the_camera_sees_but_not_round_in_a_circle() -> None:
    pose = PlanarPose(0.0, 0.0, 0.0)
    assert arc_path(pose, 0.0, 1.0, 10.0, ROBOT).length_m == pytest.approx(12.0)
    assert arc_path(pose, 1e-5, 1.0, 10.0, ROBOT).length_m == pytest.approx(12.0)
    assert arc_path(pose, 0.1, 1.0, 10.0, ROBOT).length_m == pytest.approx(12.0)
    assert arc_path(pose, 1.0, 0.5, 10.0, ROBOT).length_m == pytest.approx(3.0)
    assert arc_path(pose, -2.0, 0.2, 10.0, ROBOT).length_m == pytest.approx(1.0)


def test_at_speed_an_arc_is_only_as_tight_as_the_yaw_rate_admits() -> None:
    wish = understand(Twist(0.4, -0.8), ROBOT)
    assert wish.curvature_1pm == pytest.approx(-2.0)
    assert driveable(wish, 0.2, ROBOT) == wish
    assert driveable(wish, 1.0, ROBOT).curvature_1pm == pytest.approx(-0.8)
    assert driveable(wish, 1.0, ROBOT).speed_mps == wish.speed_mps


@pytest.mark.parametrize(
    ("wish", "requested", "rule", "sentence"),
    [
        (Wish(Kind.REFUSED, why="silence"), None, "no command", "silence: stop"),
        (Wish(Kind.REFUSED, why="reverse"), Twist(-1.0, 0.0), "refused", "reverse: stop"),
        (Wish(Kind.STAND), Twist(0.0, 0.0), "requested", "asked to stand"),
        (Wish(Kind.TURN, 0.3, left=-1), Twist(0.0, -0.5), "requested", "stands before it can turn in place"),
        (Wish(Kind.ARC, 0.5), Twist(0.5, 0.0), "requested", "stands before it can drive on"),
    ],
)
def test_why_the_robot_stops(wish: Wish, requested: Twist | None, rule: str, sentence: str) -> None:
    reason = why_stop(wish, requested)
    assert (reason.rule, reason.sentence) == (rule, sentence)
