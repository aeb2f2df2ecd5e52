"""Is the camera where its mounting says? With a pitch wrong by 20 degrees nothing is an obstacle, since
everything passes for the floor, or the floor itself is one."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from vision.camera.floor import Floor, FloorFinder, cells_on
from vision.camera.health import worsened
from vision.depth.depth_grid import DepthGrid
from vision.scene import CameraCondition, CameraHealth

# Looked at so often, and more rarely once it was found in its place so many times.
_OFTEN_NS, _RARELY_NS = 500_000_000, 5_000_000_000
_LOOKS = 5  # one look may take a ramp or a table for the floor; so many in a row do not agree on one
_MOST_WRONG = 2  # of these: the majority decides


@dataclass(frozen=True, slots=True)
class _Bounds:
    tilt_rad: float
    height_m: float


# Slopes, vibration and a rough measure are less; tables and pallets do not hide most of the floor.
_PLAINLY_WRONG = _Bounds(math.radians(5.0), 0.2)
# A pallet is lost in the floor, or the floor becomes a surface some metres ahead. One look tells to 0.3
# degrees and 6 mm; slopes are as much, but not the same in all looks.
_WRONG = _Bounds(math.radians(1.5), 0.05)
_SAME = _Bounds(math.radians(0.5), 0.03)  # what one look is right to, with room for the robot's vibration
# Also where depth is in another unit, five times as much or as little.
_HEIGHTS_M = (0.05, 8.0)
_OTHER_UNIT = 1.8  # times: no mounting is measured so wrongly
_STILL_FLOOR = 0.5  # of the cells of the plane that was found


class MountCheck:
    """Finds the floor in the depth now and then, and compares it with where the mounting puts it."""

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque(maxlen=_LOOKS)
        self._next_ns: int | None = None

    def judge(self, grid: DepthGrid, captured_ns: int, health: CameraHealth) -> CameraHealth:
        """health, or worse if most looks have found the floor plainly elsewhere, or all of them at one other
        place. grid: with the mounting's floor."""
        # Where time has stepped back, the next look is not as far away as it was.
        if self._next_ns is None or not self._next_ns - _RARELY_NS <= captured_ns < self._next_ns:
            floor = FloorFinder(_HEIGHTS_M).find(grid)
            if floor is not None:
                self._looks.append(_look(grid, floor))
            settled = len(self._looks) == _LOOKS and not any(look.off for look in self._looks)
            self._next_ns = captured_ns + (_RARELY_NS if settled else _OFTEN_NS)
        plain = [look for look in self._looks if look.plainly_off]
        if len(plain) > _MOST_WRONG:
            return worsened(health, CameraCondition.DEGRADED, _sentence(plain[-1].floor, grid))
        if len(self._looks) == _LOOKS and all(look.off for look in self._looks) and self._agree():
            return worsened(health, CameraCondition.DEGRADED, _sentence(self._looks[-1].floor, grid))
        return health

    def _agree(self) -> bool:
        last = self._looks[-1].floor
        return not any(_apart(look.floor, last, _SAME) for look in self._looks)


@dataclass(frozen=True, slots=True)
class _Look:
    """off, plainly_off: by how much the floor is not where the mounting puts it."""

    floor: Floor
    off: bool
    plainly_off: bool


def _look(grid: DepthGrid, floor: Floor) -> _Look:
    assert grid.up is not None, "a camera whose mounting is known"
    told = Floor(grid.up, grid.camera_height_m)
    off = _apart(floor, told, _WRONG)
    if off and cells_on(grid, told) >= _STILL_FLOOR * cells_on(grid, floor):
        off = False
    return _Look(floor, off, off and _apart(floor, told, _PLAINLY_WRONG))


def _apart(one: Floor, other: Floor, bounds: _Bounds) -> bool:
    tilt_rad = math.acos(min(max(float(one.up @ other.up), -1.0), 1.0))
    return tilt_rad > bounds.tilt_rad or abs(one.camera_height_m - other.camera_height_m) > bounds.height_m


def _sentence(floor: Floor, grid: DepthGrid) -> str:
    ratio = floor.camera_height_m / grid.camera_height_m
    what = "its mounting" if 1.0 / _OTHER_UNIT < ratio < _OTHER_UNIT else "the unit of its depth"
    pitch_deg = math.degrees(math.asin(min(max(-float(floor.up[2]), -1.0), 1.0)))
    return (
        f"by the floor that it sees the camera is {floor.camera_height_m:.2f} m high and looks down by "
        f"{pitch_deg:.1f} degrees: is {what} right?"
    )
