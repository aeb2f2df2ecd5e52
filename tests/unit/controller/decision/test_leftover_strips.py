"""The last strips of somebody who leaves the view go with him; the first ones of who comes in are his."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.decision.bodies import Bodies, no_bodies
from controller.decision.out_of_view import OutOfView
from tests.support.floor_bodies import box
from tests.support.recall import FRAME_NS, NOTHING_SEEN, VIEW

WALKER = box(2.0, 1.5, 0.0, 1.0, sigma_mps=0.1)


def strip(
    y_m: float = 1.3,
    vy_mps: float = 0.01,
    half_across_m: float = 0.02,
    sigma_mps: float = 1.5,
    age_s: float = 0.07,
) -> Bodies:
    """Of which two frames told that it moves, though not where to."""
    return box(2.0, y_m, 0.0, vy_mps, number=2, half_across_m=half_across_m, sigma_mps=sigma_mps, age_s=age_s)


def left_behind(*bodies: Bodies) -> list[int]:
    """The ids of who is reckoned with once all of them are out of memory."""
    memory, before = OutOfView(1.5), bodies[0]
    for one in bodies[1:]:
        before = before.joined(one)
    kept = memory.update(before, no_bodies(FRAME_NS), VIEW, False, NOTHING_SEEN)
    return [int(one) for one in kept.ids]


def limb(
    left_mps: float = 0.8, age_s: float = 0.6, half_across_m: float = 0.02, ahead_m: float = 2.5
) -> Bodies:
    """Judged standing, though measured with a walker's velocity: a part of him that is a track of its own."""
    part = box(ahead_m, 1.1, number=2, half_across_m=half_across_m, sigma_mps=0.2, age_s=age_s)
    return replace(part, measured_mps=np.array([[0.05, left_mps]]))


def test_the_last_strip_of_a_walker_to_be_in_view_goes_with_him() -> None:
    assert left_behind(WALKER, strip()) == [1]


def test_a_limb_of_a_walker_that_was_judged_standing_goes_with_him() -> None:
    """It would be waited for, where it was last seen, without end."""
    assert left_behind(WALKER, limb()) == [1]


@pytest.mark.parametrize(
    "bodies",
    [
        pytest.param((WALKER, strip(half_across_m=0.15)), id="as wide as somebody"),
        pytest.param((WALKER, strip(age_s=0.6)), id="seen for long enough"),
        pytest.param((WALKER, strip(vy_mps=-1.0, sigma_mps=0.2)), id="goes elsewhere"),
        pytest.param((WALKER, strip(y_m=0.7)), id="not beside him"),
        pytest.param((box(2.0, 1.5), strip()), id="beside what stands"),
        pytest.param((WALKER, limb(left_mps=0.6)), id="stands, as far as noise lets tell"),
        pytest.param((WALKER, limb(left_mps=-0.8)), id="judged standing, and went elsewhere"),
        pytest.param((WALKER, limb(age_s=1.1)), id="judged standing for long"),
        pytest.param((WALKER, limb(half_across_m=0.15)), id="judged standing, as wide as somebody"),
        pytest.param((WALKER, limb(ahead_m=1.0)), id="judged standing, not beside him"),
        pytest.param((box(2.0, 1.5), limb()), id="judged standing, beside what stands"),
        pytest.param((box(2.0, 0.2, 0.0, 1.0), strip(y_m=0.8)), id="beside who is in view, and has gone"),
    ],
)
def test_no_other_strip_does(bodies: tuple[Bodies, ...]) -> None:
    assert 2 in left_behind(*bodies)


def hand(half_across_m: float = 0.07, age_s: float = 0.3, vy_mps: float = -0.1) -> Bodies:
    """Has swung over the edge of the view, and out of it again."""
    return strip(1.5, vy_mps, half_across_m, 0.3, age_s)


def comer(y_m: float = 0.85, age_s: float = 0.6, vy_mps: float = -0.6, x_m: float = 2.0) -> Bodies:
    """Somebody in view, seen for age_s."""
    return box(x_m, y_m, 0.0, vy_mps, number=3, sigma_mps=0.2, age_s=age_s)


def expected_after(strip: Bodies, seen: Bodies, gone_s: float = 0.8) -> bool:
    """Whether the strip is still reckoned with once seen is in view, gone_s after it has left the memory."""
    memory = OutOfView(1.5)
    before, scenes = strip, round(gone_s * 1e9) // FRAME_NS
    for scene in range(1, scenes + 1):
        now_ns = scene * FRAME_NS
        now = replace(seen, captured_ns=now_ns) if scene == scenes else no_bodies(now_ns)
        kept = memory.update(before, now, VIEW, False, NOTHING_SEEN)
        before = now
    return 2 in kept.ids


def test_a_hand_that_came_in_first_belongs_to_who_comes_in_there() -> None:
    """It would be waited for beside the view for six seconds."""
    assert not expected_after(hand(), comer())


@pytest.mark.parametrize(
    ("strip", "seen"),
    [
        pytest.param(hand(half_across_m=0.15), comer(), id="as wide as somebody"),
        pytest.param(hand(age_s=0.6), comer(), id="seen for long enough"),
        pytest.param(hand(), comer(age_s=0.4), id="not known for long enough"),
        pytest.param(hand(), comer(age_s=2.0), id="was in view before"),
        pytest.param(hand(), comer(vy_mps=0.0), id="stands"),
        pytest.param(hand(), comer(y_m=0.3), id="comes in elsewhere, across"),
        pytest.param(hand(), comer(x_m=3.5), id="comes in elsewhere, along"),
    ],
)
def test_no_other_hand_does(strip: Bodies, seen: Bodies) -> None:
    assert expected_after(strip, seen)
