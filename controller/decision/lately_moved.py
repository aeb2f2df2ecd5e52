"""Bodies that only pause: they moved a moment ago and may go on, so the worst case counts them as movers.

Somebody crosses, stops beside the way to look at something, and turns back. Perception judges him standing
after some tenths of a second. Then he would be passed like a crate that leaves enough room.
controller/decision/known_bodies.py asks once a scene.
"""

from __future__ import annotations

import numpy as np

from controller.decision.bodies import Bodies
from hal.clocks import NS_PER_S
from hal.types import Flags

# Who has moved for _MOVED_NS in one go may go on within _PAUSE_NS.
_MOVED_NS, _PAUSE_NS = NS_PER_S // 2, 4 * NS_PER_S


class LatelyMoved:
    """Keeps, by body id, since when it has been moving, and when it last was."""

    def __init__(self) -> None:
        self._moving_since_ns: dict[int, int] = {}
        self._moved_ns: dict[int, int] = {}

    def look(self, seen: Bodies) -> None:
        """Take in the bodies of a new scene."""
        now_ns, since_ns = seen.captured_ns, self._moving_since_ns
        moving = seen.ids[seen.moving].tolist()
        self._moving_since_ns = {track_id: since_ns.get(track_id, now_ns) for track_id in moving}
        self._moved_ns = {k: last for k, last in self._moved_ns.items() if now_ns - last <= _PAUSE_NS}
        for track_id, since in self._moving_since_ns.items():
            if now_ns - since >= _MOVED_NS:
                self._moved_ns[track_id] = now_ns

    def pausing(self, bodies: Bodies) -> Flags:
        """(N,) which of the bodies stand, but only pause."""
        moved_ns = self._moved_ns
        lately = np.array([track_id in moved_ns for track_id in bodies.ids.tolist()], np.bool_)
        return lately & ~bodies.moving
