"""The gyro of a recording, given out with the frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hal.clocks import NS_PER_MS
from hal.types import FloatArray, GyroSamples, RgbdFrame

# Readings come every 2.5 to 10 ms. A frame without one this near was not covered by the gyro.
_NEAR_NS = 25 * NS_PER_MS


class GyroTrack:
    """All gyro readings of a recording.

    name: where they come from.
    stamps_ns: (N,), in any order; of readings with the same time, the first counts.
    rates_radps: (N, 3), in optical axes of the colour camera.
    missed: number of frames so far, at whose time there is no reading.
    """

    def __init__(self, name: str, stamps_ns: NDArray[np.int64], rates_radps: FloatArray) -> None:
        self.name = name
        self._stamps_ns, first = np.unique(stamps_ns, return_index=True)
        self._rates_radps = rates_radps[first]
        self.rewind()

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def rewind(self) -> None:
        """Begin again with the first reading."""
        self._next = self.missed = 0

    def attach(self, frame: RgbdFrame) -> RgbdFrame:
        """The frame with the readings since the last call, up to the first one after its exposure.

        With that one, the rate can be interpolated until the exposure, as on a robot, where a frame arrives
        after the readings of its exposure.
        """
        begin, end = self._stamps_ns.searchsorted(frame.captured_ns + np.array([-_NEAR_NS, _NEAR_NS]))
        self.missed += bool(begin == end)
        end = int(self._stamps_ns.searchsorted(frame.captured_ns, "right")) + 1
        now = slice(self._next, max(end, self._next))
        samples = GyroSamples(self._stamps_ns[now], self._rates_radps[now])
        self._next += len(samples.stamps_ns)
        return replace(frame, gyro=samples)
