"""Check of the configured mounting: is the camera where the mounting says it is?

With a pitch that is wrong by 20 degrees, either nothing is an obstacle, since everything is taken for floor,
or the floor itself is one. vision/detector.py calls it in each frame of a camera with a known mounting.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from hal.records import record
from vision.camera.floor import Floor, FloorFinder, cells_on
from vision.camera.health import worsened
from vision.depth.depth_grid import DepthGrid
from vision.scene import CameraCondition, CameraHealth, SeenFloor

# Interval of the looks at the floor; the longer one once all of the last looks have found it in its place.
_OFTEN_NS, _RARELY_NS = 500_000_000, 5_000_000_000
_LOOKS = 5  # one look may take a ramp or a table for the floor; five in a row do not agree on one
_MAX_WRONG = 2  # of these may be plainly wrong: the majority decides


@dataclass(frozen=True, slots=True)
class _Bounds:
    tilt_rad: float
    height_m: float


# With errors above this the mounting is wrong by a majority of looks. Slopes, vibration and a rough
# measurement of the mounting are smaller; tables and pallets do not hide most of the floor.
_PLAINLY_WRONG = _Bounds(math.radians(5.0), 0.2)
# With errors above this it is wrong if all looks agree: a pallet is taken for floor, or the floor becomes an
# obstacle some metres ahead. One look is accurate to 0.3 degrees and 6 mm. A slope may be as large as this,
# but not the same in all looks.
_WRONG = _Bounds(math.radians(1.5), 0.05)
_SAME = _Bounds(math.radians(0.5), 0.03)  # looks that agree differ by less: their accuracy, plus vibration
# Heights searched: wide enough to find the floor if depth is in another unit, five times too large or small.
_HEIGHTS_M = (0.05, 8.0)
_OTHER_UNIT = 1.8  # ratio of heights from which the unit of depth is suspected, not the mounting
_STILL_FLOOR = 0.5  # the mounting is right if its plane holds this share of the cells of the plane found


class MountCheck:
    """Finds the floor in the depth at intervals, and compares it with the floor by the mounting.

    floor: of the newest look that has found one; None before that.
    """

    def __init__(self) -> None:
        self.floor: SeenFloor | None = None
        self._looks: deque[_Look] = deque(maxlen=_LOOKS)
        self._next_ns: int | None = None

    def judge(self, grid: DepthGrid, captured_ns: int, health: CameraHealth) -> CameraHealth:
        """health, degraded if the mounting is wrong.

        It is wrong if most looks have found the floor plainly elsewhere, or all of them elsewhere at one
        place. grid: with heights by the mounting.
        """
        # The lower bound is for time that has stepped back: the next look would be too far away.
        if self._next_ns is None or not self._next_ns - _RARELY_NS <= captured_ns < self._next_ns:
            floor = FloorFinder(_HEIGHTS_M).find(grid)
            if floor is not None:
                self._looks.append(_look(grid, floor))
                self.floor = _seen(floor, captured_ns)
            settled = len(self._looks) == _LOOKS and not any(look.off for look in self._looks)
            self._next_ns = captured_ns + (_RARELY_NS if settled else _OFTEN_NS)
        plain = [look for look in self._looks if look.plainly_off]
        if len(plain) > _MAX_WRONG:
            return worsened(health, CameraCondition.DEGRADED, _sentence(plain[-1].floor, grid))
        if len(self._looks) == _LOOKS and all(look.off for look in self._looks) and self._agree():
            return worsened(health, CameraCondition.DEGRADED, _sentence(self._looks[-1].floor, grid))
        return health

    def _agree(self) -> bool:
        last = self._looks[-1].floor
        return not any(_apart(look.floor, last, _SAME) for look in self._looks)


@record(frozen=True, slots=True)
class _Look:
    """One look at the floor. off, plainly_off: it is elsewhere by more than _WRONG, by _PLAINLY_WRONG."""

    floor: Floor
    off: bool
    plainly_off: bool


def _look(grid: DepthGrid, floor: Floor) -> _Look:
    assert grid.up is not None, "a camera whose mounting is known"
    configured = Floor(grid.up, grid.camera_height_m)
    off = _apart(floor, configured, _WRONG)
    if off and cells_on(grid, configured) >= _STILL_FLOOR * cells_on(grid, floor):
        off = False
    return _Look(floor, off, off and _apart(floor, configured, _PLAINLY_WRONG))


def _apart(one: Floor, other: Floor, bounds: _Bounds) -> bool:
    tilt_rad = math.acos(min(max(float(one.up @ other.up), -1.0), 1.0))
    return tilt_rad > bounds.tilt_rad or abs(one.camera_height_m - other.camera_height_m) > bounds.height_m


def _seen(floor: Floor, captured_ns: int) -> SeenFloor:
    roll_rad = math.atan2(-float(floor.up[0]), -float(floor.up[1]))
    return SeenFloor(captured_ns, floor.camera_height_m, _pitch_rad(floor), roll_rad)


def _pitch_rad(floor: Floor) -> float:
    return math.asin(min(max(-float(floor.up[2]), -1.0), 1.0))


def _sentence(floor: Floor, grid: DepthGrid) -> str:
    ratio = floor.camera_height_m / grid.camera_height_m
    what = "its mounting" if 1.0 / _OTHER_UNIT < ratio < _OTHER_UNIT else "the unit of its depth"
    pitch_deg = math.degrees(_pitch_rad(floor))
    return (
        f"by the floor that it sees the camera is {floor.camera_height_m:.2f} m high and looks down by "
        f"{pitch_deg:.1f} degrees: is {what} right?"
    )
