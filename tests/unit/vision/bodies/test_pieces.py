"""What is small, close to a larger mover and has just begun to move may be a piece of it."""

from __future__ import annotations

from hal.types import FloatArray
from tests.support.detections import FRAME_NS, track
from tests.support.grids import nearest, plate

_FRAME_S = FRAME_NS * 1e-9
_SPEED_MPS, _SETS_OFF, _FRAMES = 0.8, 20, 55


def frame(number: int, behind_m: float) -> FloatArray:
    """Somebody who goes with an arm stretched out, and under it, farther back, something low that sets off
    later, the other way."""
    x_m = -1.0 + _SPEED_MPS * number * _FRAME_S
    goes_m = _SPEED_MPS * max(number - _SETS_OFF, 0) * _FRAME_S
    body = plate(4.0, (x_m - 0.25, x_m + 0.25), (-0.6, 1.0))
    arm = plate(4.0, (x_m - 0.25, x_m + 1.2), (-0.6, -0.3))
    low = plate(4.0 + behind_m, (0.5 - goes_m, 0.9 - goes_m), (0.4, 0.9))
    return nearest(nearest(body, arm), low)


def told(behind_m: float) -> int:
    """The frame in which the one behind is first told to move."""
    for number, percept in enumerate(track([frame(k, behind_m) for k in range(_FRAMES)])):
        if any(one.moving and one.position_m[2] > 4.0 + 0.5 * behind_m for one in percept.scene.obstacles):
            return number
    raise AssertionError("it was never told")


def test_at_a_larger_mover_what_is_small_is_told_once_it_has_moved_for_0_3_s() -> None:
    later_s = (told(behind_m=1.3) - told(behind_m=1.7)) * _FRAME_S
    assert 0.2 < later_s < 0.4
