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


@dataclass(frozen=True, slots=True)
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
        beside = np.abs(d_m) - half_width_m
        for corner in self._corners:
            # Nearer than this, too little of the face is in view to be sure.
            corner.sightings -= 1 if corner.s_m - front_s_m > _SURE_M else 0
        close = stands & (beside > 0.0) & (beside <= self._beside_m) & (s_m - front_s_m < _LOOK_AHEAD_M)
        near = close.nonzero()[0]
        on_left = d_m[near] > 0.0
        for left, rows in ((False, near[~on_left][::-1]), (True, near[on_left])):
            for end in self._ends(rows, bands, forward_m, s_m, d_m, band_tan):
                self._note(float(s_m[end]), left, float(beside[end]))
        self._corners = [one for one in self._corners if one.sightings > 0 and one.s_m > front_s_m - _SAME_M]

    def nearest(self, front_s_m: float) -> BlindCorner | None:
        """The next one ahead of the robot's front; None: there is none."""
        ahead = [one for one in self._corners if one.s_m > front_s_m and one.sightings >= _SIGHTINGS]
        if not ahead:
            return None
        first = min(ahead, key=lambda one: one.s_m)
        return BlindCorner(first.s_m, first.beside_m)

    def _ends(
        self,
        rows: IntArray,
        bands: IntArray,
        forward_m: FloatArray,
        s_m: FloatArray,
        d_m: FloatArray,
        band_tan: float,
    ) -> list[int]:
        """The far ends of long faces among rows, which come from the edge of the view inwards."""
        if not len(rows):
            return []
        along, aside, number = (one[rows[1:]] - one[rows[:-1]] for one in (s_m, d_m, bands))
        # So much of a face that runs along the way lies between two bands.
        step_m = forward_m**2 * band_tan / np.maximum(np.abs(d_m), 0.1)
        flat_m = _SLACK * step_m[rows[:-1]] + _STEP_ASIDE_M
        goes_on = (np.abs(number) == 1) & (along > -_STEP_ASIDE_M) & (along < flat_m)
        goes_on &= np.abs(aside) < _STEP_ASIDE_M
        last = [*(~goes_on).nonzero()[0].tolist(), len(rows) - 1]
        first = [0, *(k + 1 for k in last[:-1])]
        faces = [(int(rows[j]), int(rows[k])) for j, k in zip(first, last, strict=True)]
        return [
            end
            for began, end in faces
            if s_m[end] - s_m[began] >= _FACE_M
            and self._opens(end, bands, forward_m, rows, _PASSAGE_M + float(step_m[end]))
        ]

    def _opens(
        self, here: int, bands: IntArray, forward_m: FloatArray, rows: IntArray, least_m: float
    ) -> bool:
        """Whether the view past the end goes on for more than least_m: what is behind the face is hidden."""
        inward = 1 if rows[-1] > rows[0] or len(rows) == 1 else -1
        beyond = here + inward
        if not 0 <= beyond < len(bands) or abs(bands[beyond] - bands[here]) != 1:
            return True
        return bool(forward_m[beyond] - forward_m[here] > least_m)

    def _note(self, s_m: float, left: bool, beside_m: float) -> None:
        for corner in self._corners:
            if corner.left == left and abs(corner.s_m - s_m) < _SAME_M:
                corner.sightings = min(corner.sightings + 2, _MOST_SIGHTINGS)
                corner.s_m += 0.3 * (s_m - corner.s_m)
                corner.beside_m += 0.3 * (beside_m - corner.beside_m)
                return
        self._corners.append(_Corner(s_m, left, beside_m, 1))
