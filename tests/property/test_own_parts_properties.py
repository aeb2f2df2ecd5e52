"""Whatever box is accepted, nothing beyond the robot's outline is cut out of a frame."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from config.own_parts import OwnPart, check_own_parts
from config.perception import PerceptionConfig
from config.robot import Body, Mount, Robot
from hal.geometry import camera_in_body, mount_of
from hal.types import Intrinsics, RgbdFrame
from vision.camera.own_parts import OwnParts

CAMERA = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
BODY = Body(width_m=0.8, length_m=1.0, rear_m=0.5)
COLOUR = np.zeros((120, 160, 3), np.uint8)
along, across, up = st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(0.0, 0.8)
robots = st.builds(
    lambda x, y, z, pitch: Robot(
        body=BODY, camera_mount=Mount(forward_m=x, left_m=y, height_m=z, pitch_deg=pitch)
    ),
    along,
    across,
    st.floats(0.2, 0.9),
    st.floats(-20, 45),
)
corners = st.tuples(along, across, up)


@settings(max_examples=300, deadline=None)
@given(robots, corners, corners, st.floats(0.2, 3.0))
def test_nothing_beyond_the_outline_is_cut_out(
    robot: Robot, one: tuple[float, float, float], other: tuple[float, float, float], depth_m: float
) -> None:
    low, high = np.minimum(one, other), np.maximum(one, other)
    if (high - low <= 0.01).any():
        return
    part = OwnPart(name="part", from_m=tuple(low.tolist()), to_m=tuple(high.tolist()))
    try:
        check_own_parts([part], robot)
    except ValueError:
        return  # the camera is inside of it
    raw = np.full((120, 160), round(depth_m * 1000), np.uint16)
    frame = RgbdFrame(COLOUR, raw, 0.001, 0, 0.0, 0, CAMERA)
    mount, config = mount_of(robot), PerceptionConfig()
    rows, columns = (OwnParts([part], mount, config).without(frame).depth == 0).nonzero()
    rays = np.column_stack(
        ((columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy, np.ones(len(rows)))
    )
    points = camera_in_body(mount).apply(rays * depth_m)
    # Room for noise behind the far side, and pixels around the silhouette, which are larger here than usual.
    room_m = 0.02 + 3.0 * (0.005 + 0.0075 * 1.5**2) + 12.0 * depth_m / CAMERA.fx
    assert (np.abs(points[:, 0]) <= 0.5 + room_m).all()
    assert (np.abs(points[:, 1]) <= 0.4 + room_m).all()
