"""Blind corners: where a long face (wall, rack) close beside the corridor ends, and somebody may step out.

No camera sees round a corner, and no braking is in time for somebody who is first seen half a metre beside
the corridor. A driver passes such a place slower, and so does the robot. The ends of faces are found in the
surfaces that depth sees. Crates and posts are no faces: nobody can walk up unseen behind them.
controller/decision/sight.py calls BlindCorners once a scene.
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

_FACE_M = 1.0  # least length of a face
_LOOK_AHEAD_M = 5.0  # faces are looked for this far ahead of the robot's front
_STEP_ASIDE_M = 0.3  # neighbouring points of one face differ by less than this
# A face seen at a flat angle goes on by _band_spacing_m from one band to the next; 1.5 times that still is
# the face.
_SLACK = 1.5
# Nobody steps out of a narrower gap; between the goods of a rack there are many.
_PASSAGE_M = 0.8
_SAME_M = 0.6  # ends that are nearer to each other are the same corner
# Width of the opening behind the corner, about a doorway. Until the front is past it, somebody may step out
# of it beside the view, which is too narrow to see into an opening that is level with the robot.
_OPENING_M = 1.0
# Nearer than this ahead of the front, too little of the face is in view to tell that there is no corner.
_SURE_M = 3.2
# A corner counts from this score on, and its score is not raised above the second: a scene that shows the
# corner adds 2, and each scene takes 1 off.
_MIN_SCORE, _MAX_SCORE = 3, 8


@dataclass(slots=True)
class _Corner:
    s_m: float
    left: bool
    beside_m: float
    score: int


@record(frozen=True, slots=True)
class BlindCorner:
    """A corner at s_m along the path, beside_m beside the swept width; an opening begins there."""

    s_m: float
    beside_m: float


class BlindCorners:
    """Remembers the corners along one path; call look() once a scene."""

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
        """Take in the P surfaces of one scene, in the order of their bands.

        bands, forward_m: (P,) band, and distance ahead of the camera.
        s_m, d_m: (P,) path coordinates.
        half_width_m: (P,) half of the swept width there.
        band_tan: width of a band.
        front_s_m: path coordinate of the robot's front.
        stands: (P,) whether the surface belongs to no mover. Movers are no faces, least of all people who
        walk one behind the other.
        """
        for corner in self._corners:
            # Nearer than _SURE_M, a corner is not given up for not being seen.
            corner.score -= 1 if corner.s_m - front_s_m > _SURE_M else 0
        ends = _faces_end(
            bands, forward_m, s_m, d_m, half_width_m, stands, band_tan, front_s_m, self._beside_m
        )
        for end in ends.tolist():
            beside_m = float(abs(d_m[end]) - half_width_m[end])
            self._note(float(s_m[end]), bool(d_m[end] > 0.0), beside_m)
        self._corners = [one for one in self._corners if one.score > 0 and one.s_m > front_s_m - _OPENING_M]

    def nearest(self, front_s_m: float) -> BlindCorner | None:
        """The next one whose opening the robot's front is not past; None: there is none."""
        past_m = front_s_m - _OPENING_M
        ahead = [one for one in self._corners if one.s_m > past_m and one.score >= _MIN_SCORE]
        if not ahead:
            return None
        first = min(ahead, key=lambda one: one.s_m)
        return BlindCorner(first.s_m, first.beside_m)

    def _note(self, s_m: float, left: bool, beside_m: float) -> None:
        for corner in self._corners:
            if corner.left == left and abs(corner.s_m - s_m) < _SAME_M:
                corner.score = min(corner.score + 2, _MAX_SCORE)
                corner.s_m += 0.3 * (s_m - corner.s_m)
                corner.beside_m += 0.3 * (beside_m - corner.beside_m)
                return
        self._corners.append(_Corner(s_m, left, beside_m, 1))


@inlined
def _band_spacing_m(forward_m: float, d_m: float, band_tan: float) -> float:
    """Distance between two bands along a face that is parallel to the path, d_m beside it."""
    return forward_m**2 * band_tan / max(abs(d_m), 0.1)


@inlined
def _passage_behind(end: int, beyond: int, bands: IntArray, forward_m: FloatArray, min_jump_m: float) -> bool:
    """Whether depth jumps by more than min_jump_m past the end of a face, or the next band has no surface.

    A passage may be hidden there.
    """
    if not 0 <= beyond < len(bands) or abs(bands[beyond] - bands[end]) != 1:
        return True
    return bool(forward_m[beyond] - forward_m[end] > min_jump_m)


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
    max_beside_m: float,
) -> IntArray:
    """(E,) which of the surfaces (P,) are far ends of long faces; the arguments are those of look()."""
    count, found = len(bands), 0
    ends = np.empty(count, np.intp)
    for inward in (-1, 1):
        # Each side is followed from the edge of the view inwards; on the right that is from the last band
        # to the first.
        began = last = -1
        for n in range(count + 1):
            k = n if inward > 0 else count - 1 - n
            if n < count:
                aside_m = abs(d_m[k]) - half_width_m[k]
                close = stands[k] and 0.0 < aside_m <= max_beside_m and s_m[k] - front_s_m < _LOOK_AHEAD_M
                if not close or (d_m[k] > 0.0) != (inward > 0):
                    continue
                if last >= 0:
                    along_m = s_m[k] - s_m[last]
                    spacing_m = _band_spacing_m(forward_m[last], d_m[last], band_tan)
                    if (
                        abs(bands[k] - bands[last]) == 1
                        and -_STEP_ASIDE_M < along_m < _SLACK * spacing_m + _STEP_ASIDE_M
                        and abs(d_m[k] - d_m[last]) < _STEP_ASIDE_M
                    ):
                        last = k
                        continue
            if last >= 0 and s_m[last] - s_m[began] >= _FACE_M:
                min_jump_m = _PASSAGE_M + _band_spacing_m(forward_m[last], d_m[last], band_tan)
                if _passage_behind(last, last + inward, bands, forward_m, min_jump_m):
                    ends[found] = last
                    found += 1
            began = last = k
    return ends[:found]
