"""Blind corners: where a long face (wall, rack) close beside the corridor ends, and somebody may step out.

No camera sees round a corner, and no braking is in time for somebody who is first seen half a metre beside
the corridor. A driver passes such a place slower, and so does the robot. The ends of faces are found in the
surfaces that depth sees. Crates, posts and pallets are no faces: nobody can walk up unseen behind them.
controller/decision/sight.py calls BlindCorners once a scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from config.decision import SightConfig
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import Flags, Integers, Vector

IntArray = NDArray[np.intp]

_FACE_M = 1.0  # least length of a face
LOW_M = 0.5  # over what is lower, such as a pallet, whoever is behind it is seen
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
# Nearer than this ahead of the front, too little of the face is in view to tell that there is no corner by
# not seeing one. That the face goes on can be seen.
_SURE_M = 3.2
# How far a corner may be from where it was noted.
_PLACE_M = 0.3
# A corner counts from this score on, and its score is not raised above the second: a scene that shows the
# corner adds 2, each scene takes 1 off, and one that shows that the face goes on takes 2 more off.
_MIN_SCORE, _MAX_SCORE = 3, 8


@record(frozen=True, slots=True, eq=False)
class SurfacesOnPath:
    """P surfaces in path coordinates, left to right.

    bands, forward_m: (P,) band of the scan, and distance ahead of the camera.
    s_m, d_m: (P,) along the path and to its left.
    half_width_m: (P,) half of the swept width there.
    """

    bands: Integers
    forward_m: Vector
    s_m: Vector
    d_m: Vector
    half_width_m: Vector


@dataclass(slots=True)
class BlindCorner:
    """A corner that was noted; an opening begins there.

    s_m, beside_m: along the path, and beside the swept width.
    left: on which side.
    score: how well it is confirmed (_MIN_SCORE).
    """

    s_m: float
    left: bool
    beside_m: float
    score: int


class BlindCorners:
    """Remembers the corners along one path; call look() once a scene."""

    def __init__(self, config: SightConfig) -> None:
        self._beside_m = config.blind_corner_m
        self._corners: list[BlindCorner] = []

    def look(
        self,
        surfaces: SurfacesOnPath,
        hides: Flags,
        band_tan: float,
        front_s_m: float,
    ) -> None:
        """Take in the P surfaces of one scene, in the order of their bands.

        hides: (P,) whether a surface belongs neither to a mover nor to what is lower than LOW_M. Movers are
        no faces, least of all people who walk one behind the other.
        band_tan: width of a band. front_s_m: path coordinate of the robot's front.
        """
        for corner in self._corners:
            # Nearer than _SURE_M, a corner is not given up for not being seen.
            corner.score -= 1 if corner.s_m - front_s_m > _SURE_M else 0
            corner.score -= 2 if _closed(surfaces, hides, corner) else 0
        s_m, d_m, half_width_m = surfaces.s_m, surfaces.d_m, surfaces.half_width_m
        ends = _blind_ends(surfaces, hides, band_tan, front_s_m, self._beside_m)
        for end in ends.tolist():
            beside_m = float(abs(d_m[end]) - half_width_m[end])
            self._note(float(s_m[end]), bool(d_m[end] > 0.0), beside_m)
        self._corners = [one for one in self._corners if one.score > 0 and one.s_m > front_s_m - _OPENING_M]

    def nearest(self, front_s_m: float) -> BlindCorner | None:
        """The next one whose opening the robot's front is not past; None: there is none."""
        past_m = front_s_m - _OPENING_M
        ahead = [one for one in self._corners if one.s_m > past_m and one.score >= _MIN_SCORE]
        return min(ahead, key=attrgetter("s_m"), default=None)

    def _note(self, s_m: float, left: bool, beside_m: float) -> None:
        for corner in self._corners:
            if corner.left == left and abs(corner.s_m - s_m) < _SAME_M:
                corner.score = min(corner.score + 2, _MAX_SCORE)
                corner.s_m += 0.3 * (s_m - corner.s_m)
                corner.beside_m += 0.3 * (beside_m - corner.beside_m)
                return
        self._corners.append(BlindCorner(s_m, left, beside_m, 1))


@inlined
def _band_spacing_m(forward_m: float, d_m: float, band_tan: float) -> float:
    """Distance between two bands along a face that is parallel to the path, d_m beside it."""
    return forward_m**2 * band_tan / max(abs(d_m), 0.1)


@inlined
def _goes_on(points: SurfacesOnPath, last: int, k: int, band_tan: float) -> bool:
    """Whether point k belongs to the same face as the point last."""
    along_m = points.s_m[k] - points.s_m[last]
    spacing_m = _band_spacing_m(points.forward_m[last], points.d_m[last], band_tan)
    return bool(
        abs(points.bands[k] - points.bands[last]) == 1
        and -_STEP_ASIDE_M < along_m < _SLACK * spacing_m + _STEP_ASIDE_M
        and abs(points.d_m[k] - points.d_m[last]) < _STEP_ASIDE_M
    )


@inlined
def _passage_behind(points: SurfacesOnPath, end: int, beyond: int, band_tan: float) -> bool:
    """Whether a passage may be hidden past the end of a face: the next band, that of point beyond, has no
    surface, or one that is farther away by more than a passage."""
    if not 0 <= beyond < len(points.bands) or abs(points.bands[beyond] - points.bands[end]) != 1:
        return True
    min_jump_m = _PASSAGE_M + _band_spacing_m(points.forward_m[end], points.d_m[end], band_tan)
    return bool(points.forward_m[beyond] - points.forward_m[end] > min_jump_m)


@inlined
def _ends_blind(points: SurfacesOnPath, first: int, last: int, inward: int, band_tan: float) -> bool:
    """Whether the face from point first to last is long enough, and a passage may be hidden behind it."""
    if last < 0 or not points.s_m[last] - points.s_m[first] >= _FACE_M:
        return False
    return _passage_behind(points, last, last + inward, band_tan)


@compiled(SurfacesOnPath, "boolean[:]", BlindCorner)
def _closed(points: SurfacesOnPath, hides: Flags, corner: BlindCorner) -> bool:
    """Whether no passage can begin at the corner: what stands there leaves no gap as wide.

    A post or a box in front of a rack's goods hides a strip of them from afar, and the strip grows narrower
    on the way there.
    """
    begin_m, end_m = corner.s_m - _PLACE_M, corner.s_m + _PLACE_M + _PASSAGE_M
    along_m = np.empty(len(points.bands) + 1)
    along_m[0], count = end_m, 1
    for k in range(len(points.bands)):
        aside_m = abs(points.d_m[k]) - points.half_width_m[k]
        at_face = hides[k] and 0.0 < aside_m < corner.beside_m + _STEP_ASIDE_M
        if at_face and (points.d_m[k] > 0.0) == corner.left and begin_m < points.s_m[k] < end_m:
            along_m[count] = points.s_m[k]
            count += 1
    last_m = begin_m
    for next_m in np.sort(along_m[:count]):
        if next_m - last_m > _PASSAGE_M:
            return False
        last_m = next_m
    return True


@compiled(SurfacesOnPath, "boolean[:], float64, float64, float64")
def _blind_ends(
    points: SurfacesOnPath,
    hides: Flags,
    band_tan: float,
    front_s_m: float,
    max_beside_m: float,
) -> IntArray:
    """(E,) which of the surfaces (P,) are far ends of long faces that may hide somebody; arguments of look().

    max_beside_m: faces farther beside the swept width do not matter.
    """
    count, found = len(points.bands), 0
    ends = np.empty(count, np.intp)
    for inward in (-1, 1):
        # Each side is followed from the edge of the view inwards; on the right that is from the last band
        # to the first.
        first = last = -1  # of the present face; -1: none yet
        for n in range(count):
            k = n if inward > 0 else count - 1 - n
            aside_m, ahead_m = abs(points.d_m[k]) - points.half_width_m[k], points.s_m[k] - front_s_m
            close = hides[k] and 0.0 < aside_m <= max_beside_m and ahead_m < _LOOK_AHEAD_M
            if not close or (points.d_m[k] > 0.0) != (inward > 0):
                continue
            if last < 0 or not _goes_on(points, last, k, band_tan):
                if _ends_blind(points, first, last, inward, band_tan):
                    ends[found] = last
                    found += 1
                first = k
            last = k
        if _ends_blind(points, first, last, inward, band_tan):
            ends[found] = last
            found += 1
    return ends[:found]
