"""Blind corners: where a long face close beside the way ends, somebody may step out from behind it.

No camera sees round a corner and no braking beats somebody who is first seen half a metre beside the way.
What a driver does is to pass such a place slower; so does the robot. The end of a face is taken from what
depth sees; crates and posts are no faces, nobody walks up unseen behind them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.decision import SightConfig
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray

IntArray = NDArray[np.intp]

_FACE_M = 1.0
_LOOK_AHEAD_M = 5.0
_STEP_ASIDE_M = 0.3
# Between two bands a face that is seen at a flat angle goes on for so much, and a half.
_SLACK = 1.5
# Out of a narrower gap nobody steps: between the goods of a rack there are many.
_PASSAGE_M = 0.8
_SAME_M = 0.6
_SURE_M = 3.2
_SIGHTINGS, _MOST_SIGHTINGS = 3, 8


@dataclass(slots=True)
class _Corner:
    s_m: float
    left: bool
    beside_m: float
    sightings: int


@record(frozen=True, slots=True)
class BlindCorner:
    """At s_m along the path, beside_m beside the swept width."""

    s_m: float
    beside_m: float


class BlindCorners:
    """Remembers the corners along one path; look() once a scene."""

    def __init__(self, config: SightConfig) -> None:
        self._beside_m = config.blind_corner_m
        self._corners: list[_Corner] = []

    def look(
        self,
        bands: IntArray,
        forward_m: FloatArray,
        s_m: FloatArray,
        d_m: FloatArray,
        half_width_m: FloatArray,
        band_tan: float,
        front_s_m: float,
        stands: NDArray[np.bool_],
    ) -> None:
        """Surfaces of one scene in the order of their bands (P,): forward distance, path coordinates, and
        half of the swept width there. band_tan: width of a band. front_s_m: where the robot's front is.
        stands (P,): no face is made of what moves, people who walk one behind the other least of all."""
        for corner in self._corners:
            # Nearer than this, too little of the face is in view to be sure.
            corner.sightings -= 1 if corner.s_m - front_s_m > _SURE_M else 0
        ends = _faces_end(
            bands, forward_m, s_m, d_m, half_width_m, stands, band_tan, front_s_m, self._beside_m
        )
        for end in ends.tolist():
            beside_m = float(abs(d_m[end]) - half_width_m[end])
            self._note(float(s_m[end]), bool(d_m[end] > 0.0), beside_m)
        self._corners = [one for one in self._corners if one.sightings > 0 and one.s_m > front_s_m - _SAME_M]

    def nearest(self, front_s_m: float) -> BlindCorner | None:
        """The next one ahead of the robot's front; None: there is none."""
        ahead = [one for one in self._corners if one.s_m > front_s_m and one.sightings >= _SIGHTINGS]
        if not ahead:
            return None
        first = min(ahead, key=lambda one: one.s_m)
        return BlindCorner(first.s_m, first.beside_m)

    def _note(self, s_m: float, left: bool, beside_m: float) -> None:
        for corner in self._corners:
            if corner.left == left and abs(corner.s_m - s_m) < _SAME_M:
                corner.sightings = min(corner.sightings + 2, _MOST_SIGHTINGS)
                corner.s_m += 0.3 * (s_m - corner.s_m)
                corner.beside_m += 0.3 * (beside_m - corner.beside_m)
                return
        self._corners.append(_Corner(s_m, left, beside_m, 1))


@inlined
def _flat_m(forward_m: float, d_m: float, band_tan: float) -> float:
    """So much of a face that runs along the way lies between two bands."""
    return forward_m**2 * band_tan / max(abs(d_m), 0.1)


@inlined
def _opens(end: int, beyond: int, bands: IntArray, forward_m: FloatArray, least_m: float) -> bool:
    """Whether the view past the end of a face goes on for more than least_m: what is behind it is hidden."""
    if not 0 <= beyond < len(bands) or abs(bands[beyond] - bands[end]) != 1:
        return True
    return bool(forward_m[beyond] - forward_m[end] > least_m)


@compiled("int64[:], float64[:], float64[:], float64[:], float64[:], boolean[:], float64, float64, float64")
def _faces_end(
    bands: IntArray,
    forward_m: FloatArray,
    s_m: FloatArray,
    d_m: FloatArray,
    half_width_m: FloatArray,
    stands: NDArray[np.bool_],
    band_tan: float,
    front_s_m: float,
    most_beside_m: float,
) -> IntArray:
    """(E,) which of the surfaces (P,) are far ends of long faces."""
    count, found = len(bands), 0
    ends = np.empty(count, np.intp)
    for inward in (-1, 1):
        # On either side from the edge of the view inwards: on the right against the order of the bands.
        began = last = -1
        for n in range(count + 1):
            k = n if inward > 0 else count - 1 - n
            if n < count:
                aside_m = abs(d_m[k]) - half_width_m[k]
                close = stands[k] and 0.0 < aside_m <= most_beside_m and s_m[k] - front_s_m < _LOOK_AHEAD_M
                if not close or (d_m[k] > 0.0) != (inward > 0):
                    continue
                if last >= 0:
                    along_m, flat_m = s_m[k] - s_m[last], _flat_m(forward_m[last], d_m[last], band_tan)
                    if (
                        abs(bands[k] - bands[last]) == 1
                        and -_STEP_ASIDE_M < along_m < _SLACK * flat_m + _STEP_ASIDE_M
                        and abs(d_m[k] - d_m[last]) < _STEP_ASIDE_M
                    ):
                        last = k
                        continue
            if last >= 0 and s_m[last] - s_m[began] >= _FACE_M:
                least_m = _PASSAGE_M + _flat_m(forward_m[last], d_m[last], band_tan)
                if _opens(last, last + inward, bands, forward_m, least_m):
                    ends[found] = last
                    found += 1
            began = last = k
    return ends[:found]
