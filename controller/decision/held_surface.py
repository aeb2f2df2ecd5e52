"""The nearest unexplained surface on the path, also after it has left the view because the robot drives on.

A surface that sinks below the view, rises above it or passes beside it is still there, so it is held. A long
wall beside the corridor leaves the view little by little: its nearest visible point recedes as fast as the
robot drives. What vanishes while the robot stands has gone away; a sill that sank below the view before the
robot came to rest has not. A surface that is seen as before, but belongs to a body now, has not left the view
and is not held. Beside something that moves it may be a part of that, and is not held at rest.
controller/decision/sight.py notes the nearest surface once a scene.
"""

from __future__ import annotations

import math
from collections import deque

from hal.clocks import NS_PER_S

SAME_SURFACE_M = 0.3  # how much farther along the path points of one surface may be
# The median of this many scenes counts: one outlier must not brake; three frames are a tenth of a second.
_FRAMES = 5
# A surface that recedes by more than this has left the view; less is depth noise.
_RECEDES_M = 0.05
# A surface that was the nearest for so long, with nothing that moves beside it, is held at rest, too. Strips
# of walkers whom no obstacle explains any more, at the edge of the view, last for 0.15 s; what stands on the
# path is seen for seconds.
_LASTS_NS = NS_PER_S // 2
_LONGEST_NS = NS_PER_S // 10  # between two scenes, of the time that counts


class HeldSurface:
    """Call note() once a scene. All are path coordinates in metres; inf: none.

    s_m: of the nearest surface, filtered over some scenes, or held.
    """

    def __init__(self) -> None:
        self.s_m = math.inf
        self._nearest: deque[float] = deque(maxlen=_FRAMES)
        self._closest_s_m = math.inf
        self._driving_s_m = self._lasting_s_m = math.inf  # held while the robot drives; held at rest, too
        # Where the nearest one is, for how long without a mover beside it, and when the last scene was.
        self._about_s_m, self._still_ns, self._before_ns = math.inf, 0, 0
        self._seen_at_rest = False

    def note(
        self,
        nearest_s_m: float,
        s_m: float,
        blind_s_m: float,
        captured_ns: int,
        standing: bool,
        explained_s_m: float = math.inf,
        beside_mover: bool = False,
    ) -> None:
        """Take in the nearest surface of one scene.

        s_m: of the robot. blind_s_m: up to here surfaces may leave the view because the robot drives on.
        standing: the robot was at rest. explained_s_m: of the surface that is seen across the same way, but
        belongs to a body; inf: none. beside_mover: something moves beside the nearest surface.
        """
        self._nearest.append(nearest_s_m)
        steady = sorted(self._nearest)[len(self._nearest) // 2]
        receded = steady > self._closest_s_m + _RECEDES_M and self._closest_s_m < blind_s_m
        explained = abs(explained_s_m - self._closest_s_m) <= SAME_SURFACE_M
        receded &= not explained
        if standing:
            self._driving_s_m = math.inf
            self._forget_what_has_gone(steady)
        elif receded:
            self._driving_s_m = min(self._driving_s_m, self._closest_s_m)
            if self._lasts():
                self._lasting_s_m = min(self._lasting_s_m, self._closest_s_m)
        self._seen_at_rest &= standing
        self._forget_what_is_behind(s_m)
        self._note_place(steady, captured_ns, beside_mover)
        keeps = not standing and not explained and s_m < self._closest_s_m < blind_s_m
        self._closest_s_m = min(steady, self._closest_s_m) if keeps else steady
        self.s_m = min(steady, self._driving_s_m, self._lasting_s_m)

    def _note_place(self, steady_s_m: float, captured_ns: int, beside_mover: bool) -> None:
        """Note about where the nearest surface is, and for how long it has been there."""
        if abs(steady_s_m - self._about_s_m) > SAME_SURFACE_M:
            self._about_s_m, self._still_ns = steady_s_m, 0
        elif not beside_mover:
            self._still_ns += min(captured_ns - self._before_ns, _LONGEST_NS)
        self._before_ns = captured_ns

    def _lasts(self) -> bool:
        """Whether the closest surface was the nearest, and about there, for some time."""
        there = abs(self._closest_s_m - self._about_s_m) <= SAME_SURFACE_M
        return there and self._still_ns >= _LASTS_NS

    def _forget_what_has_gone(self, steady_s_m: float) -> None:
        """Drop a lasting surface that was seen about its place during this standstill and is seen no more."""
        seen = steady_s_m <= self._lasting_s_m + SAME_SURFACE_M
        if self._seen_at_rest and not seen:
            self._lasting_s_m = math.inf
        self._seen_at_rest = seen

    def _forget_what_is_behind(self, s_m: float) -> None:
        if self._driving_s_m < s_m:
            self._driving_s_m = math.inf
        if self._lasting_s_m < s_m:
            self._lasting_s_m = math.inf
