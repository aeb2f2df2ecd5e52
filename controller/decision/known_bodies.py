"""The bodies around the robot, in view and out of it, whichever path it follows.

controller/decision/world_model.py takes the obstacles of each new scene in here. In this order:

1. turning_vehicles.py: which are vehicles that may turn on the spot.
2. Boxed are movers, such vehicles, and what stands and is neither large nor a mere strip.
3. known_places.py: which of them are no newcomers, but tracks that were renumbered.
4. velocity_filter.py: their velocities, averaged.
5. leaving_movers.py: which of them set off as they leave the view.
6. out_of_view.py: which others have left the view and still count.
7. cut_movers.py, nearer_boxes.py: how much nearer than they are seen some of them may be.
8. lately_moved.py: which of them only pause.
"""

from __future__ import annotations

import numpy as np

from config.decision import DecisionConfig
from config.robot import Robot
from controller.decision.bodies import Bodies, no_bodies
from controller.decision.cut_movers import hidden_m
from controller.decision.known_places import KnownPlaces
from controller.decision.lately_moved import LatelyMoved
from controller.decision.leaving_movers import LeavingMovers
from controller.decision.nearer_boxes import extended_nearer
from controller.decision.out_of_view import OutOfView
from controller.decision.surfaces import Surfaces
from controller.decision.turning_vehicles import TurningVehicles
from controller.decision.velocity_filter import VelocityFilter
from controller.decision.view_edges import CurrentView
from hal.compiled import compiled
from hal.types import Flags, FloatArray
from vision.scene import FreeSpace

# Half size above which a standing body is no box. The box of a wall or a rack would reach into the corridor
# wherever the path bends; what of its surface is in the corridor, depth sees (controller/decision/sight.py).
_MAX_BOX_HALF_M = 0.8
# Half width up to which a standing body is no box but a strip: along a rack there are dozens of strips a
# centimetre or two wide, different ones in each frame. Poles are wider.
_MIN_BOX_HALF_WIDTH_M = 0.015


class KnownBodies:
    """Call look() once a scene.

    bodies: N boxes that count, those in view before those out of view.
    in_view: those in view as they are seen; those in bodies may extend nearer to the robot.
    pausing: (N,) which of bodies stand, but moved a moment ago.
    """

    def __init__(self, config: DecisionConfig, robot: Robot) -> None:
        self.bodies = self.in_view = self._seen = no_bodies(0)
        self.pausing: Flags = np.zeros(0, np.bool_)
        self._boxed: Flags = np.zeros(0, np.bool_)  # which of the seen bodies became boxes
        self._unboxed: Bodies | None = None
        self._front_m = robot.body.front_m
        self._turning = TurningVehicles(config.margins.stop_m - config.margins.least_m)
        self._known_places = KnownPlaces()
        self._velocity_filter = VelocityFilter()
        self._leaving_movers = LeavingMovers()
        self._out_of_view = OutOfView(robot.limits.max_obstacle_speed_mps)
        self._lately_moved = LatelyMoved()

    @property
    def remembered(self) -> Flags:
        """(N,) which of the bodies are out of view."""
        return np.arange(len(self.bodies)) >= len(self.in_view)

    @property
    def unboxed(self) -> Bodies:
        """The bodies in view that count as surfaces only."""
        if self._unboxed is None:
            self._unboxed = self._seen.select(~self._boxed)
        return self._unboxed

    def look(
        self, seen: Bodies, view: CurrentView, free: FreeSpace, surfaces: Surfaces, standing: bool
    ) -> None:
        """Take in all bodies seen in one scene.

        free, surfaces: the free space of the scene, and the surfaces made of it. standing: the robot stands.
        """
        swing_m = self._turning.swing_m(seen, view)
        boxed = _boxed(seen.half_view_m, seen.half_across_m, seen.moving) | (swing_m > 0.0)
        boxes = self._known_places.without_newcomers(seen.select(boxed), seen.ids)
        boxes = self._velocity_filter.update(boxes)
        boxes = self._leaving_movers.marked(boxes, view)
        remembered = self._out_of_view.update(self.in_view, boxes, view, standing, free)
        extended = extended_nearer(boxes, hidden_m(boxes, view), view, self._front_m)
        extended = extended_nearer(extended, swing_m[boxed], view, self._front_m)
        self.bodies, self.in_view = extended.joined(remembered), boxes
        self._seen, self._boxed, self._unboxed = seen, boxed, None
        self._lately_moved.look(boxes)
        self.pausing = self._lately_moved.pausing(self.bodies)
        self._known_places.remember(seen.captured_ns, surfaces.points_m, seen)


@compiled("float64[:], float64[:], boolean[:]")
def _boxed(half_view_m: FloatArray, half_across_m: FloatArray, moving: Flags) -> Flags:
    """(N,) which bodies count as boxes: movers, and standing ones that are neither large nor mere strips."""
    boxed = np.empty(len(moving), np.bool_)
    for k in range(len(moving)):
        sprawls = max(half_view_m[k], half_across_m[k]) > _MAX_BOX_HALF_M
        boxed[k] = moving[k] or (half_across_m[k] > _MIN_BOX_HALF_WIDTH_M and not sprawls)
    return boxed
