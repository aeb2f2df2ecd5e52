"""Bodies: upright boxes on the floor, in the frame of the path (controller/decision/obstacle_boxes.py)."""

from __future__ import annotations

import math
from operator import attrgetter

import numpy as np

from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.records import record
from hal.types import FlagMatrix, Flags, FloatArray, Integers, Matrices, Matrix, Vector

# Minimum time for which a body must have been seen before it is remembered out of view or its velocity used.
MIN_TRACKED_S = 0.5


@record(frozen=True, slots=True, eq=False)
class Bodies:
    """N boxes at captured_ns.

    ids: (N,) of their tracks.
    xy_m: (N, 2) centre.
    velocity_mps: (N, 2) over ground; 0 for bodies judged standing.
    measured_mps: (N, 2) as perception measured it, whether standing or moving.
    innovation_mps: (N, 2) by how much the newest measurement differs from velocity_mps.
    covariance: (N, 2, 2) of the velocity.
    half_view_m, half_across_m: (N,) half sizes along and across view_rad, the direction of view.
    top_m, bottom_m: (N,) heights over the floor.
    moving: (N,) whether judged moving.
    age_s, unseen_s: (N,) time since first and last seen, at captured_ns.
    tracked_s: (N,) time since first seen under this id, for which velocities were measured.
    """

    captured_ns: int
    ids: Integers
    xy_m: Matrix
    velocity_mps: Matrix
    measured_mps: Matrix
    innovation_mps: Matrix
    covariance: Matrices
    half_view_m: Vector
    half_across_m: Vector
    view_rad: Vector
    top_m: Vector
    bottom_m: Vector
    moving: Flags
    age_s: Vector
    unseen_s: Vector
    tracked_s: Vector

    def __len__(self) -> int:
        return len(self.ids)

    def select(self, chosen: Flags) -> Bodies:
        """Only the bodies in the mask chosen (N,)."""
        rows = chosen.nonzero()[0]
        if len(rows) == len(chosen):
            return self
        if not len(rows):
            return no_bodies(self.captured_ns)
        first, end = int(rows[0]), int(rows[-1]) + 1
        if end - first == len(rows):  # adjacent rows, the usual case: no copy is needed
            return Bodies(self.captured_ns, *[array[first:end] for array in _arrays_of(self)])
        # For a few rows, take() is ten times as fast as an index.
        return Bodies(self.captured_ns, *[array.take(rows, 0) for array in _arrays_of(self)])

    def moved_to(self, captured_ns: int, xy_m: FloatArray, unseen_s: FloatArray) -> Bodies:
        """The same bodies at a later time, at xy_m (N, 2). As replace(), but ten times as fast."""
        return Bodies(
            captured_ns,
            self.ids,
            xy_m,
            self.velocity_mps,
            self.measured_mps,
            self.innovation_mps,
            self.covariance,
            self.half_view_m,
            self.half_across_m,
            self.view_rad,
            self.top_m,
            self.bottom_m,
            self.moving,
            self.age_s,
            unseen_s,
            self.tracked_s,
        )

    def joined(self, other: Bodies) -> Bodies:
        """These bodies followed by the other ones; the time is that of these."""
        if not len(other):
            return self
        if not len(self):
            return Bodies(self.captured_ns, *_arrays_of(other))
        pairs = zip(_arrays_of(self), _arrays_of(other), strict=True)
        return Bodies(self.captured_ns, *map(np.concatenate, pairs))

    def covers(self, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> FlagMatrix:
        """(P, N) which floor points (P, 2) lie on which body; reach_m (P,) along the view, side_m across."""
        return _covers(self, points_m, reach_m, side_m)


_arrays_of = attrgetter(*(name for name in Bodies.__slots__ if name != "captured_ns"))
_NOBODY = Bodies(
    captured_ns=0,
    ids=np.zeros(0, np.int64),
    xy_m=np.zeros((0, 2)),
    velocity_mps=np.zeros((0, 2)),
    measured_mps=np.zeros((0, 2)),
    innovation_mps=np.zeros((0, 2)),
    covariance=np.zeros((0, 2, 2)),
    half_view_m=np.zeros(0),
    half_across_m=np.zeros(0),
    view_rad=np.zeros(0),
    top_m=np.zeros(0),
    bottom_m=np.zeros(0),
    moving=np.zeros(0, np.bool_),
    age_s=np.zeros(0),
    unseen_s=np.zeros(0),
    tracked_s=np.zeros(0),
)
_NO_ARRAYS = _arrays_of(_NOBODY)


def no_bodies(captured_ns: int) -> Bodies:
    """The bodies of an empty scene."""
    return Bodies(captured_ns, *_NO_ARRAYS)


@inlined
def covering(bodies: Bodies, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> FlagMatrix:
    """As Bodies.covers, for compiled steps."""
    covered = np.empty((len(points_m), len(bodies.xy_m)), np.bool_)
    for k in range(len(bodies.xy_m)):
        cos, sin = math.cos(bodies.view_rad[k]), math.sin(bodies.view_rad[k])
        half_view_m, half_across_m = bodies.half_view_m[k], bodies.half_across_m[k] + side_m
        for i in range(len(points_m)):
            dx, dy = points_m[i, 0] - bodies.xy_m[k, 0], points_m[i, 1] - bodies.xy_m[k, 1]
            along_m, left_m = along_and_left(dx, dy, cos, sin)
            covered[i, k] = abs(along_m) <= half_view_m + reach_m[i] and abs(left_m) <= half_across_m
    return covered


@compiled(Bodies, "float64[:, :], float64[:], float64")
def _covers(bodies: Bodies, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> FlagMatrix:
    return covering(bodies, points_m, reach_m, side_m)
