"""Who has walked and stands now is still one body when more of it comes into sight."""

from __future__ import annotations

from hal.types import FloatArray
from tests.support.detections import FRAME_NS, track
from tests.support.grids import nearest, plate
from vision.scene import Obstacle

_STOPS, _SHOWN, _END = 30, 60, 75


def seen_at_the_end(speed_mps: float) -> list[Obstacle]:
    """Somebody who goes for a second, then stands; one of his legs, 0.2 m behind the other, gives depth from
    the second second on."""
    percepts = track([_body(speed_mps, k) for k in range(_END)])
    assert len(percepts[_SHOWN - 1].scene.obstacles) == 1
    return sorted(percepts[-1].scene.obstacles, key=lambda one: one.position_m[2])


def _body(speed_mps: float, frame: int) -> FloatArray:
    x_m = -0.5 + speed_mps * min(frame, _STOPS) * FRAME_NS * 1e-9
    upper = plate(3.0, (x_m - 0.25, x_m + 0.25), (-0.9, 0.3))
    one_leg = nearest(upper, plate(3.0, (x_m - 0.25, x_m - 0.05), (0.3, 0.95)))
    if frame < _SHOWN:
        return one_leg
    return nearest(one_leg, plate(3.2, (x_m + 0.08, x_m + 0.25), (0.45, 0.95)))


def test_a_leg_of_who_stopped_is_part_of_it() -> None:
    """Else it is an obstacle by itself, so low that the robot would stand well before it to see it leave."""
    (person,) = seen_at_the_end(0.8)
    assert not person.moving


def test_surface_beside_a_track_that_never_moved_is_another_track() -> None:
    still, other = seen_at_the_end(0.0)
    assert not still.moving
    assert other.extent_m[1] < 0.6
