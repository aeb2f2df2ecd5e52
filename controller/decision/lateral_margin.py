"""Which bodies beside the swept width count as in the way: the lateral margin, with hysteresis.

What comes nearer to the swept width than lateral_m is in the way until it is graze_m farther off, so that
noise does not make the robot flap. Hysteresis is against measurements that change, so it ends: what has been
clear of lateral_m for some time stays clear. Standing and moving bodies share one LateralMargin
(controller/decision/standing_limits.py, moving_limits.py), because bodies start and stop.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from config.decision import Margins
from hal.types import FloatArray, Integers

_CLEAR_FOR_S = 2.0


class LateralMargin:
    """Keeps which bodies are in the way, and since when others have been clear, by id.

    lateral_m: what is nearer to the swept width comes into the way. farthest_m: what is farther off is not in
    the way.
    """

    def __init__(self, margins: Margins) -> None:
        self.lateral_m = margins.lateral_m
        self.farthest_m = margins.lateral_m + margins.graze_m
        self._inside: set[int] = set()
        self._clear_since_s: dict[int, float] = {}

    @property
    def is_empty(self) -> bool:
        """No body is in the way."""
        return not self._inside

    def needed_m(self, track_id: int) -> float:
        """The clearance that a body has to leave, so as not to be in the way."""
        return self.farthest_m if track_id in self._inside else self.lateral_m

    def all_needed_m(self, ids: Integers) -> FloatArray:
        """(N,) needed_m() of each of the bodies ids (N,)."""
        return np.array([self.needed_m(track_id) for track_id in ids.tolist()])

    def comes_in(self, track_ids: Iterable[int]) -> None:
        """These bodies are in the way."""
        self._inside.update(track_ids)

    def goes_out(self, track_ids: Iterable[int]) -> None:
        """These bodies are not in the way."""
        self._inside.difference_update(track_ids)

    def keep_only(self, ids: Integers) -> None:
        """Forget who is in the way, but for the bodies ids (N,)."""
        if self._inside:
            self._inside.intersection_update(ids.tolist())

    def note_clearance(self, track_id: int, clearance_m: float, measured: bool, now_s: float) -> None:
        """Take in the clearance that a standing body leaves at now_s.

        measured: else it does not count as clear.
        """
        if not (measured and clearance_m > self.lateral_m):
            self._clear_since_s.pop(track_id, None)
        elif now_s - self._clear_since_s.setdefault(track_id, now_s) >= _CLEAR_FOR_S:
            self._inside.discard(track_id)

    def keep_times_of(self, track_ids: Iterable[int]) -> None:
        """Forget since when bodies have been clear, but for these."""
        for gone in self._clear_since_s.keys() - set(track_ids):
            del self._clear_since_s[gone]
