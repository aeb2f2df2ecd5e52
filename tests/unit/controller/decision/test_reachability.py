"""What a moving body could block in the worst case, and whether the robot stands by then."""

from __future__ import annotations

import numpy as np
import pytest

from config.robot import Body
from controller.braking import BrakeLimits
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, place
from controller.decision.manoeuvres import Manoeuvres
from controller.decision.reachability import (
    Reach,
    count_safe_stops,
    passes_clear,
    reach,
    stops,
)
from controller.profile import SpeedRamps
from tests.support.floor_bodies import box, line_path

TIMES = np.arange(0.0, 4.01, 0.1)
CORRIDOR = Corridor(line_path(), Body(width_m=0.8, length_m=1.0, rear_m=0.5))
HARD = BrakeLimits(0.7, 2.0)


def manoeuvres(
    since_s: float = 0.0,
    spread_mps: tuple[float, float] = (0.0, 0.0),
    surprise_mps: tuple[float, float] = (0.0, 0.0),
    speed_mps: float = 0.0,
    change_mps2: float = 0.0,
    uncertain_m: tuple[float, float] = (0.0, 0.0),
) -> Manoeuvres:
    """Of one body; pairs: along the path and across it."""
    each = (since_s, *spread_mps, *surprise_mps, speed_mps, change_mps2, change_mps2, *uncertain_m)
    return Manoeuvres(*(np.array([value]) for value in each))


def grown(body: Bodies, may_do: Manoeuvres, since_s: float = 0.0) -> Reach:
    placed = place(body, CORRIDOR, TIMES + since_s, 0.0, 12.0)
    return reach(placed, TIMES, may_do, max_mps=1.5, margin_m=0.2, counts=np.array([True]))


def reached(body: Bodies, sigma_mps: float = 0.0, manoeuvre_mps2: float = 0.0, since_s: float = 0.0) -> Reach:
    speed_mps = float(np.linalg.norm(body.velocity_mps))
    return grown(
        body, manoeuvres(since_s, (sigma_mps, sigma_mps), (0.0, 0.0), speed_mps, manoeuvre_mps2), since_s
    )


def stop_from(v_mps: float, latency_s: float = 0.0) -> SpeedRamps:
    return SpeedRamps(v_mps, 0.0, np.zeros(1), HARD, latency_s=latency_s)


def stops_in_time(v_mps: float, body: Reach, latency_s: float = 0.0, s_m: float = 0.0) -> bool:
    stopping = stops(stop_from(v_mps, latency_s), TIMES)
    return count_safe_stops(stopping, s_m, body, np.array([True])) == 1


def test_a_crosser_may_stop_dead_in_the_way() -> None:
    """Nominally it is inside from 1.35 s to 2.65 s; from then on it may still be there."""
    worst = reached(box(5.0, 2.0, 0.0, -1.0))
    assert not worst.inside[0, 13]
    assert worst.inside[0, 14:].all()
    assert worst.block_from_s_m[0, -1] == pytest.approx(5.0 - 0.2 - 0.5 - 0.2)


def test_reachable_set_includes_a_turn_into_the_corridor() -> None:
    """1 m beside the corridor: half of 0.5 m/s2 reaches it after 2 s."""
    worst = reached(box(5.0, 0.65 + 1.0, 0.01, 0.0), manoeuvre_mps2=0.5)
    assert not worst.inside[0, 19]
    assert worst.inside[0, 21]
    # It may also have come nearer by as much.
    assert worst.block_from_s_m[0, 21] == pytest.approx(4.1 - 0.25 * 2.1**2 + 0.01 * 2.1, abs=0.01)


def test_reachable_set_is_bounded_by_the_maximum_obstacle_speed() -> None:
    slow = reached(box(5.0, 3.0, 0.0, 0.01), manoeuvre_mps2=5.0)
    # 1.51 m/s at the most: 2.35 m take it 1.56 s; without the bound they would take 0.97 s.
    assert not slow.inside[0, 15]
    assert slow.inside[0, 16]


def test_how_well_its_place_was_known_counts_from_the_first_moment() -> None:
    body = box(5.0, 1.65, 0.01, 0.0)

    def unsure(along_m: float, across_m: float) -> Reach:
        return grown(body, manoeuvres(uncertain_m=(along_m, across_m)))

    assert not unsure(0.0, 0.9).inside.any()
    assert unsure(0.0, 1.1).inside.all()
    assert unsure(0.5, 1.1).block_from_s_m[0, 0] == pytest.approx(unsure(0.0, 1.1).block_from_s_m[0, 0] - 0.5)
    assert unsure(0.5, 1.1).block_to_s_m[0, -1] == pytest.approx(unsure(0.0, 1.1).block_to_s_m[0, -1] + 0.5)


def test_the_age_of_the_scene_counts() -> None:
    fresh = reached(box(5.0, 1.65, 0.01, 0.0), sigma_mps=0.5)
    old = reached(box(5.0, 1.65, 0.01, 0.0), sigma_mps=0.5, since_s=1.0)
    assert int(fresh.inside[0].argmax()) - int(old.inside[0].argmax()) == 10


@pytest.mark.parametrize("latency_s", [0.0, 0.5])
def test_a_stop_is_in_time_where_it_ends_before_what_is_blocked(latency_s: float) -> None:
    """An emergency stop from 1 m/s takes 1 / 1.4 + 0.175 m; the way is blocked at 4.1 m."""
    standing = reached(box(5.0, 0.0))
    last_m = 4.1 - (1 / 1.4 + 0.175 + latency_s)
    assert stops_in_time(1.0, standing, latency_s, s_m=last_m - 0.01)
    assert not stops_in_time(1.0, standing, latency_s, s_m=last_m + 0.01)


def test_the_stops_that_are_in_time_are_counted_from_the_slowest_on() -> None:
    """2 m before something that stands: v^2 / 1.4 + 0.175 v is 1.71 m from 1.43 m/s, 2.2 m from 1.64 m/s."""
    speeds = np.array([0.0, 1.0, 1.43, 1.64, 2.0])
    ramps = SpeedRamps(speeds, 0.0, np.zeros(5), HARD)
    stopping, standing = stops(ramps, TIMES), reached(box(5.0, 0.0))
    assert count_safe_stops(stopping, 2.1, standing, np.array([True])) == 3
    assert count_safe_stops(stopping, 2.1, standing, np.array([False])) == 5, "it does not count"


def test_an_oncoming_one_takes_room_while_the_robot_brakes_only() -> None:
    """Once the robot stands, being reached is all that can be promised."""
    oncoming = reached(box(5.0, 0.0, -1.0, 0.0))
    assert stops_in_time(1.0, oncoming)
    assert not stops_in_time(1.0, reached(box(2.5, 0.0, -1.0, 0.0)))
    assert stops_in_time(0.0, reached(box(2.5, 0.0, -1.0, 0.0)))


def test_robot_past_a_body_needs_no_room_before_it() -> None:
    """Its far end is at 5.2 m; the robot's rear, 0.5 m behind, leaves it at 5.9 m with a margin of 0.2 m."""
    standing = reached(box(5.0, 0.0))
    assert not stops_in_time(1.0, standing, s_m=5.6)
    assert stops_in_time(1.0, standing, s_m=6.0)


def test_body_that_is_never_on_the_path_takes_no_room() -> None:
    assert stops_in_time(1.5, reached(box(5.0, 2.0, -1.0, 0.0)), s_m=4.5)


def go(v_mps: float, target_mps: float) -> SpeedRamps:
    return SpeedRamps(v_mps, 0.0, np.array([target_mps]), BrakeLimits(0.3, 0.6))


def test_getting_through_before_it_comes() -> None:
    crosser = reached(box(2.0, 4.0, 0.0, -1.0))
    assert passes_clear(go(1.5, 1.5), 0.0, TIMES, crosser)
    assert not passes_clear(go(0.5, 0.5), 0.0, TIMES, crosser)


def test_spread_across_the_path_reaches_it_and_spread_along_does_not() -> None:
    """0.5 m/s more along the path brings nobody into it, 0.5 m/s across it does."""
    body = box(5.0, 0.65 + 0.9, 0.01, 0.0)
    assert not grown(body, manoeuvres(spread_mps=(0.5, 0.0))).inside.any()
    assert grown(body, manoeuvres(spread_mps=(0.0, 0.5))).inside.any()


@pytest.mark.parametrize("left_m", [0.65 + 0.9, -0.65 - 0.9])
def test_faster_body_enters_only_if_it_heads_for_the_corridor(left_m: float) -> None:
    inwards_mps, body = -np.sign(left_m) * 0.5, box(5.0, left_m, 0.01, 0.0)
    assert grown(body, manoeuvres(surprise_mps=(0.0, inwards_mps))).inside.any()
    assert not grown(body, manoeuvres(surprise_mps=(0.0, -inwards_mps))).inside.any()
    assert not grown(body, manoeuvres(surprise_mps=(0.5, 0.0))).inside.any()


def test_body_that_accelerates_along_the_path_extends_its_reach_on_one_side_only() -> None:
    body = box(5.0, 0.0, 0.01, 0.0)
    same, on, back = (grown(body, manoeuvres(surprise_mps=(mps, 0.0))) for mps in (0.0, 0.5, -0.5))
    assert on.block_from_s_m[0, -1] == same.block_from_s_m[0, -1]
    assert on.block_to_s_m[0, -1] == pytest.approx(same.block_to_s_m[0, -1] + 0.5 * TIMES[-1])
    assert back.block_from_s_m[0, -1] == pytest.approx(same.block_from_s_m[0, -1] - 0.5 * TIMES[-1], abs=0.05)
    assert back.block_to_s_m[0, -1] == same.block_to_s_m[0, -1]


def test_a_stop_that_is_over_in_time_needs_no_room() -> None:
    """It could be in the way after 2 s at the earliest, right before the robot's nose."""
    near = reached(box(0.9, 0.65 + 1.0, 0.01, 0.0), manoeuvre_mps2=0.5)
    assert count_safe_stops(stops(stop_from(1.0), TIMES), 0.0, near, np.array([True])) == 1
    assert count_safe_stops(stops(stop_from(1.5), TIMES), 0.0, near, np.array([True])) == 0
