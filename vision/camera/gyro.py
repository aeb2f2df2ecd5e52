"""Buffer of gyro samples, and the rotation of the camera between two frames by them.

A frame arrives some 30 ms after its exposure, with all samples up to its arrival. So most samples between two
exposures come with the first of the two frames and have to be kept for the second.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, GyroSamples

_NS_PER_S = 1e9
_KEPT = 2048  # maximum number of samples, 5 s at 400 Hz; frames farther apart are not compared
_GAP_NS = 25_000_000  # maximum interval of two samples between which the rate is interpolated
_EDGE_NS = 10_000_000  # time before the first and after the last sample that these two cover
_COVERED = 0.8  # share of the time between two exposures that samples have to cover


class GyroMemory:
    """Takes the samples of every frame, including frames that are not followed."""

    def __init__(self) -> None:
        self._stamps_ns = np.empty(0, np.int64)
        self._rates_radps = np.empty((0, 3))

    def add(self, samples: GyroSamples) -> None:
        """Add samples in the order of time, except those that are not finite or not newer than the last."""
        stamps_ns = samples.stamps_ns
        if len(stamps_ns) == 0:
            return
        if len(self._stamps_ns) and stamps_ns[-1] < self._stamps_ns[-1]:
            # Time has stepped back, or an earlier stamp was wrong and too late. Drop what is not older than
            # the new samples, or no sample would count as newer for a long time.
            self._keep(slice(None, int(self._stamps_ns.searchsorted(stamps_ns[0]))))
        new = np.asarray(np.isfinite(samples.rates_radps).all(axis=1))
        # The stamps come from an estimate of the device's clock, and may step back slightly.
        latest_ns = np.maximum.accumulate(stamps_ns)
        new[1:] &= stamps_ns[1:] > latest_ns[:-1]
        if len(self._stamps_ns):
            new &= stamps_ns > self._stamps_ns[-1]
        self._stamps_ns = np.concatenate((self._stamps_ns, stamps_ns[new]))[-_KEPT:]
        self._rates_radps = np.concatenate((self._rates_radps, samples.rates_radps[new]))[-_KEPT:]

    def forget(self, before_ns: int) -> None:
        """Drop samples older than before_ns, except the last of them, which is needed for interpolation."""
        self._keep(slice(max(int(self._stamps_ns.searchsorted(before_ns, "right")) - 1, 0), None))

    def turn_rad(self, from_ns: int, to_ns: int) -> FloatArray | None:
        """(3,) rotation vector from from_ns to to_ns; None if the samples do not cover most of that time.

        The rate is interpolated linearly between samples and integrated.
        """
        if len(self._stamps_ns) == 0 or to_ns <= from_ns:
            return None
        if self._covered_ns(from_ns, to_ns) < _COVERED * (to_ns - from_ns):
            return None
        first, end = self._stamps_ns.searchsorted((from_ns, to_ns), "right")
        # Times relative to from_ns fit into a float without loss.
        at = np.concatenate(([from_ns], self._stamps_ns[first:end], [to_ns])) - from_ns
        known = (self._stamps_ns - from_ns).astype(float)
        rates = np.stack([np.interp(at, known, axis) for axis in self._rates_radps.T], axis=1)
        steps_s = np.diff(at)[:, None] / _NS_PER_S
        turn: FloatArray = (0.5 * (rates[1:] + rates[:-1]) * steps_s).sum(axis=0)
        return turn

    def _keep(self, which: slice) -> None:
        self._stamps_ns, self._rates_radps = self._stamps_ns[which], self._rates_radps[which]

    def _covered_ns(self, from_ns: int, to_ns: int) -> int:
        """How much of the time from from_ns to to_ns is covered by samples close enough to each other."""
        stamps: NDArray[np.int64] = self._stamps_ns
        begin, end = stamps[:-1], stamps[1:]
        close = end - begin <= _GAP_NS
        inner = np.minimum(end, to_ns) - np.maximum(begin, from_ns)
        edges = (
            min(int(stamps[0]), to_ns) - max(int(stamps[0]) - _EDGE_NS, from_ns),
            min(int(stamps[-1]) + _EDGE_NS, to_ns) - max(int(stamps[-1]), from_ns),
        )
        return int(np.maximum(inner[close], 0).sum()) + sum(max(edge, 0) for edge in edges)
