"""Missions that once ended in a contact at fault, or not at all, each with what was wrong."""

from __future__ import annotations

import pytest

from controller.campaign.task import Task, run_task
from tests.support.campaign import CONFIG


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        # Began to walk at the edge of the view, left it before the verdict, and was remembered as standing.
        ("crossing_left", 50021),
        # Out of view, and forgotten when somebody else came into view where it was expected.
        ("crowd_junction", 50052),
        # The camera froze: reckoned for 3 s with a velocity that was off by two standard deviations.
        ("camera_frozen", 7201),
        # Came into view right ahead of a robot that was asked to stop anyway, and did so by comfort.
        ("crowd_junction", 90004),
        # Out of view, slower than measured, and thought to have passed before the robot unseen.
        ("crossing_right", 95002),
        # Came so near to the lens that depth failed, and the floor counted as free since it had been before.
        ("crowd_junction", 9300009),
        # Left the view while it gathered speed, which is measured late, and was reckoned to be that slow.
        ("curved_path", 9300051),
    ],
)
def test_missions_that_once_ended_in_a_collision_no_longer_do(family: str, seed: int) -> None:
    (row,) = run_task(Task(family, seed, ("ours",), "noise", CONFIG))
    assert row.reached
    assert row.contacts_at_fault == 0


def test_robot_does_not_wait_for_a_body_that_has_walked_on() -> None:
    """It walked through the blind place before the nose, was seen too shortly for the verdict that it
    moves, and was remembered as standing there for ever."""
    (row,) = run_task(Task("crowd_junction", 400015, ("ours",), "noise", CONFIG))
    assert row.reached
