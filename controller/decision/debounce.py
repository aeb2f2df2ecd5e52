"""A debounced flag for each obstacle: it does not change with every frame's noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import Flags


class Debounced:
    """A flag for each id changes once the opposite has been seen for settle_s without a break."""

    def __init__(self, settle_s: float) -> None:
        self._settle_s = settle_s
        self._flags: dict[int, bool] = {}
        self._otherwise_since_s: dict[int, float] = {}

    def pause(self) -> None:
        """Note a break in the observations: times start anew after it. The flags stay as they are."""
        self._otherwise_since_s.clear()

    def flags(self, ids: NDArray[np.int64]) -> Flags:
        """(N,) the flags of ids as they are; a new one is False."""
        return np.fromiter(
            (self._flags.get(track_id, False) for track_id in ids.tolist()), np.bool_, len(ids)
        )

    def update(self, ids: NDArray[np.int64], seen: Flags, at_once: Flags, now_s: float) -> Flags:
        """(N,) the flags of ids at now_s; other ids are forgotten, and a new one begins with False.

        seen (N,): what is seen now. at_once (N,): where the flag follows it without delay.
        """
        flags, since = {}, {}
        for track_id, yes, now in zip(ids.tolist(), seen.tolist(), at_once.tolist(), strict=True):
            flag = self._flags.get(track_id, False)
            if yes != flag:
                began_s = self._otherwise_since_s.get(track_id, now_s)
                if now or now_s - began_s >= self._settle_s:
                    flag = yes
                else:
                    since[track_id] = began_s
            flags[track_id] = flag
        self._flags, self._otherwise_since_s = flags, since
        return np.fromiter(flags.values(), np.bool_, len(flags))
