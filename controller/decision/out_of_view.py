"""Bodies that have left the camera's view but are still there: below, beside or above it.

controller/decision/known_bodies.py calls OutOfView once a scene. A body of the last scene that is missing in
this one is kept while its place is not seen:

* Standing (seen for at least 0.5 s; the robot drives): kept where it was, until its place is seen again (free
  or with a surface in it), a seen body covers it, or it lies 2 m behind the camera. If it goes missing while
  the robot stands, it has moved away itself: dropped. If it is kept just inside the side edge of the view:
  dropped once a standing robot sees through its place (controller/decision/seen_through.py).
* Moving, but at rest within the noise when it sank below the view: it has stopped there, and is kept as
  standing (controller/decision/unseen_motion.py).
* Moving otherwise: extrapolated with its last velocity for 2 s, or for 6 s if that leads towards the robot's
  axis or along with the robot. Dropped earlier if its place is well within the view or 2 m behind the camera.
* Judged standing (a verdict takes some frames), but clearly measured as approaching, or as moving anywhere if
  it was seen for 0.5 to 1 s: counts as moving, with the velocity measured last, even if the robot stands
  (controller/decision/leaving_movers.py, unseen_motion.py).
* Moving, and expected in view where the scene shows free floor: moved sideways to the edge of the free space,
  and no longer approaching (its velocity towards the axis becomes 0, its variance grows). The same 2 s or
  6 s apply. A body that clearly approached may first be some decimetres late.
* Moving, and another body is seen where it was expected: dropped only if the other one has been seen for more
  than 0.5 s and its velocity agrees within 2 sigma. Else both count: they may be two people.
* Seen for 0.5 s at most, and gone where a mover is seen: dropped at once, it was a part of that mover. What
  comes in over the edge of the view is often seen in pieces first.
* A narrow strip within 0.5 m of a mover that is kept and was seen for longer, with the same velocity within 2
  sigma: dropped, it was the last visible part of that mover (controller/decision/leftover_strips.py). It was
  seen to move for less than 0.5 s, or is judged standing, but was measured as moving, for 0.5 to 1 s.
* A narrow strip that was seen for 0.5 s at most, near which a mover has come into view since: dropped once
  that one has been seen for longer, it was the first visible part of him.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from config.perception import IMPLAUSIBLE_SPEED_FACTOR
from controller.decision.bodies import MIN_TRACKED_S, Bodies, covering, no_bodies
from controller.decision.leftover_strips import first_strips, leftover_strips
from controller.decision.seen_through import SeenThrough, unproven
from controller.decision.unseen_motion import (
    agrees,
    may_enter_way,
    stopped_below_view,
    with_measured_velocity,
)
from controller.decision.unseen_position import extrapolated, pushed_out_of_view
from controller.decision.view_edges import CurrentView, out_of_view
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import Flags, FloatArray
from vision.scene import FreeSpace

IntArray = NDArray[np.int64]

# A seen body covers the place of a kept one within this distance across the view.
_SAME_PLACE_M = 0.25
# How long a mover is kept: in general, and if it may come into the robot's way.
_MOVING_KEPT_S, _MAY_ENTER_KEPT_S = 2.0, 6.0


class OutOfView:
    """The bodies out of view; call update once a scene.

    max_obstacle_speed_mps: measured speeds far above it (IMPLAUSIBLE_SPEED_FACTOR times) are mistakes.
    """

    def __init__(self, max_obstacle_speed_mps: float) -> None:
        self._mistaken_mps = IMPLAUSIBLE_SPEED_FACTOR * max_obstacle_speed_mps
        self._seen_through = SeenThrough()
        self._bodies = no_bodies(0)
        self._missing_s: FloatArray = np.zeros(0)  # for how long each has been missing
        self._stands_since_ns: int | None = None

    def update(
        self, before: Bodies, seen: Bodies, view: CurrentView, standing: bool, free: FreeSpace
    ) -> Bodies:
        """The bodies out of view that count in addition to seen.

        before: the bodies seen in the scene before this one. standing: the robot stands. free: free space of
        this scene. A standing body that was last seen while the robot stood has moved away and is dropped; so
        is one that was part of a body that is still seen.
        """
        dt_s = (seen.captured_ns - before.captured_ns) / NS_PER_S
        if not standing or self._stands_since_ns is None:
            self._stands_since_ns = seen.captured_ns if standing else None
        bodies, missing_s = self._with_missing(before, seen, dt_s, view)
        if not len(bodies):
            self._seen_through.forget()
            return no_bodies(seen.captured_ns)
        some_move = np.count_nonzero(bodies.moving) > 0
        xy_m = extrapolated(bodies, dt_s, view) if some_move else bodies.xy_m
        bodies = bodies.moved_to(seen.captured_ns, xy_m, bodies.unseen_s + dt_s)
        out = out_of_view(bodies, view)
        out |= unproven(bodies, view, free)
        kept = _kept(bodies, missing_s, seen, out, view)
        if some_move:
            kept &= ~first_strips(bodies, missing_s, seen)
            kept &= ~leftover_strips(bodies, kept)
        if standing:
            kept &= ~self._seen_through.seen_empty(bodies, view, free)
        else:
            self._seen_through.forget()
        if np.count_nonzero(kept) < len(kept):
            missing_s, bodies = missing_s[kept], bodies.select(kept)
        self._missing_s = missing_s
        if some_move:
            bodies = pushed_out_of_view(bodies, missing_s, view, free)
        self._bodies = bodies
        return bodies

    def _with_missing(
        self, before: Bodies, seen: Bodies, dt_s: float, view: CurrentView
    ) -> tuple[Bodies, FloatArray]:
        """The bodies kept so far, then those of before that are missing in seen; and for how long (N,).

        The latter move, or have stood long enough to be believed and were last seen while the robot drove, or
        stopped before they sank below the view.
        """
        bodies, missing_s = self._bodies, self._missing_s + dt_s
        missing = _missing(before.ids, seen.ids)
        if not np.count_nonzero(missing):
            return bodies, missing_s
        gone = with_measured_velocity(before.select(missing), self._mistaken_mps)
        stopped = stopped_below_view(gone, view)
        stood = stopped | (~gone.moving & self._last_seen_driving(gone))
        if np.count_nonzero(stopped):
            velocity = np.where(stopped[:, None], 0.0, gone.velocity_mps)
            gone = replace(gone, velocity_mps=velocity, moving=gone.moving & ~stopped)
        gone = gone.select(gone.moving | (stood & (gone.age_s >= MIN_TRACKED_S)))
        gone = gone.select(~_parts_of_movers(gone, seen))
        return bodies.joined(gone), np.concatenate((missing_s, np.full(len(gone), dt_s)))

    def _last_seen_driving(self, bodies: Bodies) -> Flags:
        """(N,) which bodies were last seen before the robot came to rest, if it stands now.

        Perception predicts what it no longer sees for a while, and meanwhile the robot may have stopped. In
        the first scene of a standstill it may still have rolled.
        """
        if self._stands_since_ns is None:
            return np.ones(len(bodies), np.bool_)
        return np.asarray(bodies.captured_ns - bodies.unseen_s * NS_PER_S <= self._stands_since_ns)


@compiled("int64[:], int64[:]")
def _missing(ids: IntArray, seen_ids: IntArray) -> Flags:
    """(N,) which of ids (N,) are not among seen_ids (M,)."""
    missing = np.empty(len(ids), np.bool_)
    for k in range(len(ids)):
        missing[k] = not (seen_ids == ids[k]).any()
    return missing


@compiled(Bodies, Bodies)
def _parts_of_movers(gone: Bodies, seen: Bodies) -> Flags:
    """(N,) which of the bodies that have just gone were parts of movers that are seen.

    They were seen for MIN_TRACKED_S at most, so that their velocity is hardly known, and a mover is seen
    where they were.
    """
    parts = np.zeros(len(gone.ids), np.bool_)
    covered = covering(seen, gone.xy_m, gone.half_view_m, _SAME_PLACE_M)
    for k in range(len(parts)):
        for m in range(len(seen.ids)):
            if gone.tracked_s[k] <= MIN_TRACKED_S and seen.moving[m] and covered[k, m]:
                parts[k] = True
    return parts


@compiled(Bodies, "float64[:]", Bodies, "boolean[:]", CurrentView)
def _kept(bodies: Bodies, missing_s: FloatArray, seen: Bodies, out: Flags, view: CurrentView) -> Flags:
    """(N,) which bodies, missing for missing_s (N,), are out of view (N,) and not part of a seen one.

    Movers are kept for a limited time only.
    """
    covered = covering(seen, bodies.xy_m, bodies.half_view_m, _SAME_PLACE_M)
    kept = out.copy()
    for k in range(len(kept)):
        moving = bodies.moving[k]
        kept_s = _MAY_ENTER_KEPT_S if may_enter_way(bodies, k, view) else _MOVING_KEPT_S
        if moving and missing_s[k] > kept_s:
            kept[k] = False
        for m in range(len(seen.ids)):
            part_of = covered[k, m] and (not moving or agrees(bodies, k, seen, m))
            if part_of or seen.ids[m] == bodies.ids[k]:
                kept[k] = False
    return kept
