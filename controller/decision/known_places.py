"""Which new tracks are no newcomers, because something stood in their place before they began.

The camera gives a thing that it loses for a moment a new number. KnownPlaces remembers where things have just
stood, so that such a track is not taken for somebody who has only now appeared.

controller/decision/known_bodies.py asks it about each new scene.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import MIN_TRACKED_S, Bodies, covering
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import FloatArray

# A new track is no newcomer if something stood within this distance of its place, this long before.
_BEFORE_NS = 200_000_000
_SAME_PLACE_M = 0.25


class KnownPlaces:
    """Where things stood in the last scenes, and the tracks that began there. Points are in metres."""

    def __init__(self) -> None:
        # Of the last scenes: capture time, and points where something stood (K, 2).
        self._places: deque[tuple[int, FloatArray]] = deque()
        self._renumbered: set[int] = set()  # ids of tracks that began where something had stood

    def without_newcomers(self, bodies: Bodies, seen_ids: NDArray[np.int64]) -> Bodies:
        """The bodies of a scene, where the age of those that began in a known place is raised.

        age_s becomes at least MIN_TRACKED_S; tracked_s stays. seen_ids (K,): all tracks of the scene, also
        those that are no boxes in it.
        """
        while len(self._places) > 1 and self._places[1][0] <= bodies.captured_ns - _BEFORE_NS:
            self._places.popleft()
        if self._renumbered:
            self._renumbered.intersection_update(seen_ids.tolist())
        new = bodies.age_s < MIN_TRACKED_S
        if not self._places or not np.count_nonzero(new):
            return bodies
        captured_ns, points = self._places[0]
        if captured_ns <= bodies.captured_ns - _BEFORE_NS:
            # Later on, it would be its own surface that was there before.
            new &= bodies.tracked_s * NS_PER_S < bodies.captured_ns - captured_ns
            there = bodies.covers(points, np.full(len(points), _SAME_PLACE_M), _SAME_PLACE_M).any(axis=0)
            self._renumbered.update(bodies.ids[new & there].tolist())
        if not self._renumbered:
            return bodies
        known = np.array([one in self._renumbered for one in bodies.ids.tolist()])
        return replace(bodies, age_s=np.where(known, np.maximum(bodies.age_s, MIN_TRACKED_S), bodies.age_s))

    def remember(self, captured_ns: int, points_m: FloatArray, seen: Bodies) -> None:
        """Take in a scene: the points of surfaces in it (P, 2), and the bodies seen."""
        self._places.append((captured_ns, _standing_places(points_m, seen)))


@compiled("float64[:, :]", Bodies)
def _standing_places(points_m: FloatArray, seen: Bodies) -> FloatArray:
    """(K, 2) the points of surfaces (P, 2) and the centres of seen, without those of movers.

    A new track where a mover has just been is a part of him. Taken for something that has long stood there,
    an arm right before the camera would be waited for without end.
    """
    places = np.concatenate((points_m, seen.xy_m))
    of_body = covering(seen, places, np.full(len(places), _SAME_PLACE_M), _SAME_PLACE_M)
    stands = np.ones(len(places), np.bool_)
    for k in range(len(seen.moving)):
        if seen.moving[k]:
            stands[len(points_m) + k] = False
            for i in range(len(places)):
                stands[i] &= not of_body[i, k]
    return places[stands]
