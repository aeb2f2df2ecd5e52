"""Narrow strips that are the last visible parts of a mover that leaves the view, or the first of one that
comes.

As a mover is cut off at the edge of the view, what is still seen of it may become a track of its own, which
is hardly measured and soon gone. The hand of somebody who comes in swings over the edge before he does.
controller/decision/out_of_view.py asks which of the bodies that it would keep are such strips: the mover is
kept himself, or seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controller.decision.bodies import MIN_TRACKED_S, Bodies
from controller.decision.unseen_motion import (
    MIN_MOVER_HALF_WIDTH_M,
    hardly_stood,
    velocities_agree,
)
from hal.types import Flags, FloatArray

# A strip this near to a kept mover, across the view, may be a part of it. If it was judged standing, also
# along the view: its place follows the edge of the view while the mover goes on.
_REACH_M = 0.5
# For so long the first strip and the mover may have been seen at the same time.
_OVERLAP_S = 0.3


def leftover_strips(bodies: Bodies, kept: Flags) -> Flags:
    """(N,) which of the bodies kept (N,) are leftover strips.

    They lie beside a mover that is kept and was seen for longer, and have its velocity. Either they were seen
    to move for MIN_TRACKED_S at most, or they were judged standing too early (unseen_motion.hardly_stood).
    """
    older = kept & bodies.moving & (bodies.tracked_s > MIN_TRACKED_S)
    brief = np.where(bodies.moving, bodies.tracked_s <= MIN_TRACKED_S, hardly_stood(bodies))
    strips = brief & (bodies.half_across_m < MIN_MOVER_HALF_WIDTH_M)
    if not (np.count_nonzero(older) and np.count_nonzero(strips)):
        return np.zeros(len(bodies), np.bool_)
    others = bodies.select(older)
    velocity = np.where(bodies.moving[:, None], bodies.velocity_mps, bodies.measured_mps)
    alike = velocities_agree(replace(bodies, velocity_mps=velocity), others)
    reach_m = bodies.half_view_m + np.where(bodies.moving, 0.0, _REACH_M)
    beside = others.covers(bodies.xy_m, reach_m, _REACH_M)
    return np.asarray(strips & (beside & alike).any(axis=1))


def first_strips(bodies: Bodies, missing_s: FloatArray, seen: Bodies) -> Flags:
    """(N,) which of the bodies, missing for missing_s (N,), were the first visible parts of seen movers.

    They moved, were seen for MIN_TRACKED_S at most, and a mover has come into view near their place since. It
    has been seen for longer, so that its velocity is known.
    """
    strips = bodies.moving & (bodies.tracked_s <= MIN_TRACKED_S)
    strips &= bodies.half_across_m < MIN_MOVER_HALF_WIDTH_M
    known = seen.moving & (seen.tracked_s > MIN_TRACKED_S)
    if not (np.count_nonzero(strips) and np.count_nonzero(known)):
        return np.zeros(len(bodies), np.bool_)
    movers = seen.select(known)
    came_since = movers.tracked_s <= missing_s[:, None] + _OVERLAP_S
    near = movers.covers(bodies.xy_m, bodies.half_view_m + _REACH_M, _REACH_M)
    return np.asarray(strips & (came_since & near).any(axis=1))
