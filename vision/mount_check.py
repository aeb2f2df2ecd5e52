"""Is the camera where its mounting says? With a pitch wrong by 20 degrees nothing is an obstacle, since
everything passes for the floor, or the floor itself is one."""

from __future__ import annotations

import math
from collections import deque

from vision.depth_grid import DepthGrid
from vision.floor import Floor, FloorFinder, cells_on
from vision.health import worsened
from vision.scene import CameraCondition, CameraHealth

# Looked at so often, and more rarely once it was found in its place so many times.
_OFTEN_NS, _RARELY_NS = 500_000_000, 5_000_000_000
_LOOKS = 5
_MOST_WRONG = 2
# Slopes, vibration and a rough measure are less; tables and pallets do not hide most of the floor.
_TILT_RAD = math.radians(5.0)
_HEIGHT_M = 0.2
_STILL_FLOOR = 0.5  # of the cells of the plane that was found


class MountCheck:
    """Finds the floor in the depth now and then, and compares it with where the mounting puts it."""

    def __init__(self) -> None:
        # Of the last looks at a floor: "" where it lay in its place.
        self._complaints: deque[str] = deque(maxlen=_LOOKS)
        self._next_ns: int | None = None

    def judge(self, grid: DepthGrid, captured_ns: int, health: CameraHealth) -> CameraHealth:
        """health, or worse if most looks have found the floor elsewhere. grid: with the mounting's floor."""
        # Where time has stepped back, the next look is not as far away as it was.
        if self._next_ns is None or not self._next_ns - _RARELY_NS <= captured_ns < self._next_ns:
            floor = FloorFinder().find(grid)
            if floor is not None:
                self._complaints.append(_complaint(grid, floor))
            settled = len(self._complaints) == _LOOKS and not any(self._complaints)
            self._next_ns = captured_ns + (_RARELY_NS if settled else _OFTEN_NS)
        wrong = [complaint for complaint in self._complaints if complaint]
        return worsened(health, CameraCondition.DEGRADED, wrong[-1]) if len(wrong) > _MOST_WRONG else health


def _complaint(grid: DepthGrid, floor: Floor) -> str:
    """What is wrong with the mounting by this floor, "" if nothing is."""
    assert grid.up is not None, "a camera whose mounting is known"
    tilt_rad = math.acos(min(max(float(floor.up @ grid.up), -1.0), 1.0))
    if tilt_rad <= _TILT_RAD and abs(floor.camera_height_m - grid.camera_height_m) <= _HEIGHT_M:
        return ""
    if cells_on(grid, Floor(grid.up, grid.camera_height_m)) >= _STILL_FLOOR * cells_on(grid, floor):
        return ""
    pitch_deg = math.degrees(math.asin(min(max(-float(floor.up[2]), -1.0), 1.0)))
    return (
        f"by the floor that it sees the camera is {floor.camera_height_m:.2f} m high and looks down by "
        f"{pitch_deg:.0f} degrees: is its mounting right?"
    )
