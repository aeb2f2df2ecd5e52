"""The watched bodies: those that move, pause or are young, with where they will be and which enter the way.

Watch selects them once a scene, and places and judges them in each control step. The advisers that deal with
motion (moving_limits.py and worst_case_limit.py) get them as one record, Watched.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.decision import DecisionConfig
from controller.decision.bodies import Bodies, no_bodies
from controller.decision.corridor import (
    BEYOND_RANGE_M,
    PathVelocities,
    Placed,
    path_velocities,
    place,
)
from controller.decision.crossing import likely_enters
from controller.decision.debounce import Debounced
from controller.decision.limits import UNSEEN_ERROR_SIGMAS
from controller.decision.world_model import WorldModel
from hal.records import record
from hal.types import Flags, FloatArray

# A body must head for the corridor for this long until it counts as coming in, and head elsewhere for as long
# until it does not. Meanwhile the worst case covers it.
_DEBOUNCE_S = 0.3
_NO_FLAGS = np.zeros(0, np.bool_)


@record(frozen=True, slots=True, eq=False)
class Watched:
    """N watched bodies in one control step.

    bodies: as they were in their scene; those that pause are among the moving ones, with velocity 0.
    since_s: time since that scene.
    placed: where they will be, at times from now, if they keep their velocity.
    velocities: relative to the path.
    enters: (N,) which are in the swept corridor or are likely to come into it, debounced.
    could_enter: (N,) the same without debounce, and those out of view that may be nearer to the path, or
        faster, than expected.
    """

    bodies: Bodies
    since_s: float
    placed: Placed
    velocities: PathVelocities
    enters: Flags
    could_enter: Flags


class Watch:
    """Selects the watched bodies and judges which of them enter.

    times_s (K,): times from now at which they are placed.
    """

    def __init__(self, config: DecisionConfig, times_s: FloatArray) -> None:
        self._config, self._times_s = config, times_s
        self._enters = Debounced(_DEBOUNCE_S)
        self._bodies = no_bodies(0)
        self._remembered = self._pausing = _NO_FLAGS

    def take_in(self, known: WorldModel) -> None:
        """Select the watched bodies of a new scene."""
        young = known.bodies.age_s < self._config.prediction.confirm_s
        watched = known.bodies.moving | known.pausing | young
        self._bodies = known.bodies.select(watched)
        self._pausing = known.pausing[watched] if len(self._bodies) else _NO_FLAGS
        if np.count_nonzero(self._pausing):
            self._bodies = replace(self._bodies, moving=self._bodies.moving | self._pausing)
        self._remembered = known.remembered[watched] if len(self._bodies) else _NO_FLAGS

    def step(self, known: WorldModel, s_m: float, now_s: float) -> Watched | None:
        """The watched bodies at now_s, for a robot at s_m; None: there are none."""
        bodies = self._bodies
        if not len(bodies):
            self._enters.pause()
            return None
        range_m = self._config.sight.range_m + BEYOND_RANGE_M
        placed = place(bodies, known.corridor, known.since_s + self._times_s, s_m, range_m)
        velocities = path_velocities(bodies, placed.heading_rad[:, 0])
        sigma_left_mps = velocities.sigma_left_mps * self._config.prediction.sigmas
        comes = likely_enters(placed, self._times_s, sigma_left_mps)
        # A body that is in the corridor now comes in at once. One out of view, which no noise of measurements
        # makes turn away, no longer does at once.
        at_once = np.where(comes, placed.clearance_m[:, 0] <= 0.0, self._remembered)
        # A pause is no sign of going elsewhere: whoever goes on afterwards comes in as before.
        heads_in = np.where(self._pausing, self._enters.flags(bodies.ids), comes)
        heads_in = self._enters.update(bodies.ids, heads_in, at_once, now_s)
        # While it pauses, it enters only if it stands in the corridor.
        enters = np.where(self._pausing, comes, heads_in)
        could_enter = enters | comes
        if np.count_nonzero(self._remembered):
            could_enter |= self._may_come_unseen(placed, velocities, sigma_left_mps)
        return Watched(bodies, known.since_s, placed, velocities, enters, could_enter)

    def _may_come_unseen(
        self, placed: Placed, velocities: PathVelocities, sigma_left_mps: FloatArray
    ) -> Flags:
        """(N,) which bodies out of view approach the path and may come into it.

        They may be nearer to it than where they are placed, and faster than when they were last seen: whoever
        sets off as he leaves the view was measured while still slow. sigma_left_mps (N,): spread of the
        sideways velocities.
        """
        to_path = -np.sign(placed.d_m[:, 0])
        unsure_mps = UNSEEN_ERROR_SIGMAS * velocities.sigma_left_mps
        faster_mps = np.maximum(to_path * velocities.innovation_left_mps, 0.0)
        nearer_m = (unsure_mps + faster_mps) * self._bodies.unseen_s
        inwards = to_path * velocities.left_mps > unsure_mps
        comes = likely_enters(placed, self._times_s, sigma_left_mps - faster_mps, nearer_m)
        return self._remembered & inwards & comes
