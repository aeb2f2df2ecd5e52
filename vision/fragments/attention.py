"""A closer look at bodies with too few fragments to measure their motion.

The fragments are spread over the whole image, long ones first, so a small, plain or partly hidden body gets
none. The tracker lists such bodies (vision/bodies/few_fragments.py). In the next frame Attention searches the
image box of one of them, for shorter segments as well. The fragments that it finds are body-only: they
measure the motion of that body only. The camera's motion is not estimated from them, since the body may move.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.records import record
from hal.types import FloatArray, RgbdFrame
from vision.depth.depth_mask import surface_depth
from vision.fragments.candidates import (
    NewFragments,
    depth_along,
    joined,
    new_fragments,
    on_one_surface,
    trackable_segments,
)
from vision.fragments.corners import corners_within, in_pairs
from vision.fragments.edges import GreyImage, find_edges
from vision.fragments.segments import SNAP_PX, find_segments, longest_first

# Minimum time between two looks at an urgent body. It is just below a whole number of frame intervals at 30,
# 15 or 10 Hz, so that the rounding of a stamp does not decide.
_URGENT_NS = 95_000_000
_IDLE_NS = 495_000_000  # the same at any other body: it is looked at twice a second
_REMEMBERED_NS = 2_000_000_000  # a look that was longer ago counts as none
_MARGIN_PX = 6  # around the box: edges are at the rim of a body, and corners are looked for beside them
_MIN_SIDE_PX = 16  # of the box: the minimum length of a segment here
_MIN_LENGTH = 0.5  # minimum length of a segment here, relative to that of other fragments
_MIN_END_DISTANCE_PX = 8.0  # after the ends were moved to corners: half of the minimum length of a segment
# Minimum of the smaller eigenvalue of the structure tensor at both ends: on a short edge without corners both
# ends slide alike. Noise alone makes 220.
_MIN_EIGENVALUE = 600.0
# Contrast of an edge. The threshold that vision/fragments/renewal.py has adapted to there is mostly higher;
# with it the velocities were not known any better.
_CONTRAST = 60.0
_CANDIDATES = 48  # only the longest segments: bounds the time of one look
_MAX_CORNER_AREA_PX = 40_000  # of the image around a body: larger ones are near, their surface is well known
_AT_ONCE = 4  # maximum per look: takes a body from none to enough, and leaves room for other bodies
_ONE_SURFACE = 0.5  # maximum distance of near and far surface at an end, as a share of the gate
_HOLES = 0.2  # of the 25 samples around an end: from 0.25 on there may be another surface (depth_mask.py)


@record(frozen=True, slots=True, eq=False)
class NeedsFragments:
    """K bodies with too few fragments.

    ids: of their tracks, (K,).
    box_px: u0, v0, u1, v1, (K, 4).
    depth_m: of their centres, (K,).
    gate_m: maximum difference in depth of a fragment on them, (K,).
    urgent: new, or under suspicion of moving, (K,).
    """

    ids: NDArray[np.int64]
    box_px: FloatArray
    depth_m: FloatArray
    gate_m: FloatArray
    urgent: NDArray[np.bool_]


@record(frozen=True, slots=True, eq=False)
class _Body:
    """A body that is looked at in a frame.

    frame, grey: the frame, and its colour image in grey. around: the part of grey around the body's box.
    corner_px: column and row of the upper left corner of that part. depth_m, gate_m: as in NeedsFragments.
    """

    frame: RgbdFrame
    grey: GreyImage
    around: GreyImage
    corner_px: tuple[int, int]
    depth_m: float
    gate_m: float


def _body(frame: RgbdFrame, grey: GreyImage, bodies: NeedsFragments, one: int) -> _Body | None:
    """The body with this index; None if it is too small in the image."""
    height, width = grey.shape
    u0, v0, u1, v1 = bodies.box_px[one].astype(int).tolist()
    left, right = max(0, u0 - _MARGIN_PX), min(width, u1 + _MARGIN_PX)
    top, bottom = max(0, v0 - _MARGIN_PX), min(height, v1 + _MARGIN_PX)
    if min(right - left, bottom - top) < _MIN_SIDE_PX:
        return None
    around = grey[top:bottom, left:right]
    return _Body(frame, grey, around, (left, top), bodies.depth_m[one], bodies.gate_m[one])


def _alone_on_it(near_m: FloatArray, far_m: FloatArray, holes: FloatArray, body: _Body) -> NDArray[np.bool_]:
    """Where depth, of any shape, is that of the body, and of nothing else.

    An end between two surfaces, or beside pixels without depth, may belong to either.
    """
    here = np.abs(near_m - body.depth_m) <= body.gate_m
    result: NDArray[np.bool_] = here & (far_m - near_m <= _ONE_SURFACE * body.gate_m) & (holes <= _HOLES)
    return result


class Attention:
    """Searches one body per frame for fragments. Keeps when each body was looked at last."""

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config
        self._looked_ns: dict[int, int] = {}
        self._began_ns: int | None = None

    def find(
        self, frame: RgbdFrame, grey: GreyImage, ends_px: NDArray[np.float32], bodies: NeedsFragments
    ) -> NewFragments | None:
        """New fragments on the body whose turn it is, away from the present ones, ends_px (K, 2, 2).

        None: there is no room, or it is the turn of none that is large enough in the image.
        """
        settings = self._config.fragments
        room = settings.max_fragments + settings.closer_fragments - len(ends_px)
        one = self._next(bodies, frame.captured_ns) if room > 0 else None
        body = None if one is None else _body(frame, grey, bodies, one)
        if body is None:
            return None
        wanted = min(room, _AT_ONCE)
        new = self._by_edges(body, ends_px, wanted)
        wanted -= len(new.ends_px)
        if wanted == 0 or body.around.size > _MAX_CORNER_AREA_PX:
            return new
        present_px = np.concatenate((ends_px, new.ends_px))
        return joined(new, self._by_corners(body, present_px, wanted))

    def _by_edges(self, body: _Body, ends_px: NDArray[np.float32], wanted: int) -> NewFragments:
        """At most wanted fragments, of the segments on a body."""
        settings = self._config.fragments
        edges = find_edges(body.around, _CONTRAST)
        segments_px = find_segments(edges, _MIN_LENGTH * settings.min_length_px, body.corner_px)
        return self._on_it(body, longest_first(segments_px)[:_CANDIDATES], SNAP_PX, ends_px, wanted)

    def _by_corners(self, body: _Body, ends_px: NDArray[np.float32], wanted: int) -> NewFragments:
        """At most wanted fragments, of pairs of corners on a body."""
        depth, scale_m = body.frame.depth, body.frame.depth_scale_m
        (left, top), (rows, columns) = body.corner_px, body.around.shape
        points = corners_within(
            body.around,
            depth[top : top + rows, left : left + columns],
            (body.depth_m - body.gate_m) / scale_m,
            (body.depth_m + body.gate_m) / scale_m,
        )
        points = points + np.array((left, top), np.float32)
        surface = surface_depth(depth, scale_m, points, self._config)
        usable = _alone_on_it(surface.near_m, surface.far_m, surface.holes, body)
        # Moved, they would end up on the outline: its corners are the stronger ones, and were left out.
        return self._on_it(body, in_pairs(points[usable]), 0, ends_px, wanted)

    def _on_it(
        self,
        body: _Body,
        segments_px: NDArray[np.float32],
        reach_px: int,
        ends_px: NDArray[np.float32],
        wanted: int,
    ) -> NewFragments:
        """At most wanted fragments, of segments (N, 2, 2) that lie on a body and can be tracked.

        reach_px: maximum distance by which an end is moved to a corner. ends_px (K, 2, 2): of the present
        fragments.
        """
        ends, tensor = trackable_segments(
            body.grey, segments_px, ends_px, _MIN_END_DISTANCE_PX, _MIN_EIGENVALUE, reach_px
        )
        surface = depth_along(ends, body.frame, self._config)
        at_ends = surface.near_m[:, ::4], surface.far_m[:, ::4], surface.holes[:, ::4]
        here = on_one_surface(surface.near_m, self._config) & _alone_on_it(*at_ends, body).all(axis=1)
        return new_fragments(here.nonzero()[0][:wanted], ends, tensor, surface, self._config.fragments)

    def _next(self, bodies: NeedsFragments, now_ns: int) -> int | None:
        """Index of the body whose turn it is.

        Urgent ones come first. Of these it is the one with the largest product of the time that it has waited
        and the size of its box: there are many slivers of furniture, and little is found on them.
        """
        # A body that was never looked at has waited since the first call.
        self._began_ns = now_ns if self._began_ns is None else min(self._began_ns, now_ns)
        ids = bodies.ids.tolist()
        if not ids:
            return None
        self._looked_ns = {
            one: at for one, at in self._looked_ns.items() if 0 <= now_ns - at < _REMEMBERED_NS
        }
        size_px = [math.sqrt((u1 - u0) * (v1 - v0)) for u0, v0, u1, v1 in bodies.box_px.tolist()]
        first, longest = None, (False, -1.0)
        for index, (number, urgent) in enumerate(zip(ids, bodies.urgent.tolist(), strict=True)):
            waited_ns = min(now_ns - self._looked_ns.get(number, self._began_ns), _REMEMBERED_NS)
            turn = urgent, waited_ns * size_px[index]
            if waited_ns >= (_URGENT_NS if urgent else _IDLE_NS) and turn > longest:
                first, longest = index, turn
        if first is not None:
            self._looked_ns[ids[first]] = now_ns
        return first
