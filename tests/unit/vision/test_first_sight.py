"""What perception says of a crate in the first frames: young velocities know how uncertain they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.painted import QVGA, box, drive, plain, record, vector
from tests.support.painted_room import CRATE_M, SIDEWAYS, TOWARDS, look, room


@pytest.mark.parametrize("velocity_mps", [TOWARDS, SIDEWAYS])
@pytest.mark.parametrize("textured", [True, False])
def test_true_velocity_is_within_three_sigmas_from_the_first_sight_on(
    velocity_mps: FloatArray, textured: bool
) -> None:
    crate = box(vector(4.5, 0.3, 0.0), CRATE_M, 10, velocity_mps)
    if not textured:
        crate = [replace(face, texture=plain(60)) for face in crate]
    take = record(room() + crate, drive(), 12, QVGA)
    listed = 0
    for percept, camera in zip(look(take, True), take.cameras, strict=True):
        for one in percept.scene.obstacles:
            if one.extent_m[0] > 1.5:
                continue  # the wall
            off = one.velocity_mps - camera.rotation.T @ velocity_mps
            assert (np.abs(off) <= 3.0 * np.sqrt(np.diag(one.velocity_cov))).all()
            listed += 1
    assert listed == 10  # from the third frame on


def test_first_sight_without_fragments_does_not_call_the_closing_speed_zero() -> None:
    crate = [replace(face, texture=plain(60)) for face in box(vector(4.5, 0.3, 0.0), CRATE_M, 10)]
    young = look(record(room() + crate, drive(), 3, QVGA), True)[-1].scene.obstacles
    (one,) = (one for one in young if one.extent_m[0] < 1.5)
    assert np.sqrt(one.velocity_cov[2, 2]) > 0.5  # 1.5 m/s towards the camera is within three sigmas
