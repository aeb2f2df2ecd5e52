"""What is remembered beside the edge of the view: gone once a robot that stands sees through its place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.decision.bodies import Bodies
from controller.decision.seen_through import SeenThrough
from controller.decision.view_edges import view_from
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import box
from vision.scene import FreeSpace

MOUNT = CameraMount(0.4, 0.0, 0.60, 0.0)
EDGE = 0.7
VIEW = view_from(PlanarPose(10.0, 0.0, 0.0), MOUNT, EDGE, near_m=1.3, up_tan=0.4)
BANDS = np.linspace(-EDGE + 0.01, EDGE - 0.01, 70)
ALL_FREE = FreeSpace(BANDS, 0.01, np.full(70, np.inf), np.full(70, 8.0))
UNKNOWN = FreeSpace(BANDS, 0.01, np.full(70, np.inf), np.zeros(70))


PERIOD_S = 0.1


def strip(left_m: float = 0.55, ahead_m: float = 1.4, top_m: float = 0.5) -> Bodies:
    """Ahead of the camera, which is at 10.4 m."""
    return box(10.4 + ahead_m, left_m, top_m=top_m, half_across_m=0.03)


def gone_in(
    seen_through: SeenThrough, body: Bodies, free: list[FreeSpace], headings_rad: list[float]
) -> list[bool]:
    """Whether it is gone, scene by scene."""
    return [
        bool(
            seen_through.seen_empty(
                replace(body, captured_ns=round(k * PERIOD_S * 1e9)),
                replace(VIEW, heading_rad=heading_rad),
                one,
            ).all()
        )
        for k, (one, heading_rad) in enumerate(zip(free, headings_rad, strict=True))
    ]


def gone_after_s(body: Bodies, free: FreeSpace) -> float | None:
    gone = gone_in(SeenThrough(), body, [free] * 30, [0.0] * 30)
    return gone.index(True) * PERIOD_S if True in gone else None


def test_body_is_gone_once_its_place_was_seen_free_for_half_a_second() -> None:
    assert gone_after_s(strip(), ALL_FREE) == pytest.approx(0.5)


def test_a_scene_in_which_it_is_not_seen_through_begins_anew() -> None:
    free = [ALL_FREE] * 5 + [UNKNOWN] + [ALL_FREE] * 6
    assert gone_in(SeenThrough(), strip(), free, [0.0] * 12) == [False] * 11 + [True]


def test_a_robot_that_turns_in_place_begins_anew() -> None:
    """By more than what odometry wanders; while it goes on turning, nothing is gone at all."""
    turned, turning = [0.0] * 5 + [0.01] * 6, [0.005 * k for k in range(30)]
    assert gone_in(SeenThrough(), strip(), [ALL_FREE] * 11, turned) == [False] * 10 + [True]
    assert not any(gone_in(SeenThrough(), strip(), [ALL_FREE] * 30, turning))
    wandering = [0.002 * (k % 2) for k in range(6)]
    assert gone_in(SeenThrough(), strip(), [ALL_FREE] * 6, wandering)[-1]


def test_a_robot_that_drove_begins_anew() -> None:
    seen_through = SeenThrough()
    assert not any(gone_in(seen_through, strip(), [ALL_FREE] * 5, [0.0] * 5))
    seen_through.forget()
    assert gone_in(seen_through, strip(), [ALL_FREE] * 6, [0.0] * 6) == [False] * 5 + [True]


@pytest.mark.parametrize("distance_m", [1.3, 1.39])
@pytest.mark.parametrize("what", ["known", "nearest"])
def test_body_stays_while_part_of_its_place_is_not_free(distance_m: float, what: str) -> None:
    """A surface there, or floor that was not seen, in one of its bands."""
    place = int(np.abs(BANDS - (-0.55 / 1.4)).argmin())
    known, nearest = ALL_FREE.known_m.copy(), ALL_FREE.nearest_m.copy()
    (known if what == "known" else nearest)[place] = distance_m
    assert gone_after_s(strip(), replace(ALL_FREE, known_m=known, nearest_m=nearest)) is None


@pytest.mark.parametrize(
    "body",
    [
        strip(left_m=0.93),  # at the very edge: it may stand just outside of it
        strip(ahead_m=0.9, left_m=0.3, top_m=0.1),  # below the view
        strip(ahead_m=-0.5, left_m=0.2),  # behind the camera
        replace(strip(), moving=np.array([True])),
    ],
)
def test_mover_or_body_that_would_not_be_visible_stays(body: Bodies) -> None:
    assert gone_after_s(body, ALL_FREE) is None


def test_nothing_is_seen_through_without_bands() -> None:
    nothing = FreeSpace(np.zeros(0), 0.01, np.zeros(0), np.zeros(0))
    assert gone_after_s(strip(), nothing) is None
