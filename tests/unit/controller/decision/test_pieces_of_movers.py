"""Pieces of a mover that comes in over the edge of the view: once he is seen as a whole, they have gone."""

from __future__ import annotations

import pytest

from controller.decision.bodies import Bodies
from controller.decision.out_of_view import OutOfView
from tests.support.floor_bodies import box
from tests.support.recall import FRAME_NS, NOTHING_SEEN, VIEW


def leg(x_m: float = 2.0, y_m: float = 1.3, age_s: float = 0.3) -> Bodies:
    """Seen at the edge of the view for a moment, and hardly measured: it seems to come across."""
    return box(x_m, y_m, -0.3, -0.6, number=2, half_across_m=0.1, sigma_mps=0.5, age_s=age_s)


def overtaker(vx_mps: float = 1.8, age_s: float = 0.2, half_across_m: float = 0.3) -> Bodies:
    """Goes past on the left, and has just been told from the rack behind him."""
    return box(2.1, 1.25, vx_mps, 0.0, half_across_m=half_across_m, sigma_mps=0.2, age_s=age_s)


def kept(gone: Bodies, seen: Bodies) -> list[int]:
    """The ids of who is reckoned with out of view, after gone has gone and seen is still there."""
    memory = OutOfView(1.5)
    still = seen.moved_to(FRAME_NS, seen.xy_m, seen.unseen_s)
    found = memory.update(seen.joined(gone), still, VIEW, False, NOTHING_SEEN)
    return [int(one) for one in found.ids]


def test_a_leg_that_was_seen_first_has_gone_once_he_is_seen() -> None:
    """The robot would stop for the leg, and wait for it for six seconds."""
    assert kept(leg(), overtaker()) == []


@pytest.mark.parametrize(
    ("gone", "seen"),
    [
        pytest.param(leg(age_s=0.6), overtaker(), id="seen for long enough to be somebody"),
        pytest.param(leg(y_m=1.9), overtaker(), id="beside him"),
        pytest.param(leg(x_m=3.2), overtaker(), id="behind him"),
        pytest.param(leg(), overtaker(vx_mps=0.0), id="before what stands"),
    ],
)
def test_who_is_no_part_of_a_mover_is_reckoned_with(gone: Bodies, seen: Bodies) -> None:
    assert kept(gone, seen) == [2]
