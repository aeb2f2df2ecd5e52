"""The simulated world from above: only footprints and heights, without faces.

A mission in the plane needs the position of everything thousands of times a second; faces and textures would
only cost time. The numbers are those of sim.world.World (a test compares them).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.scenario import Person, Scenario
from hal.types import FloatArray
from sim.models.outlines import footprint, heights
from sim.world import trajectory_of


class PlanarWorld:
    """N bodies of a scenario on the floor.

    names: N names.
    z_m: (N, 2), lowest and highest point.
    moves: (N,), whether it has a motion plan.
    end_s: when the last mover has finished its plan; 0 if none moves.

    All footprints have the same number K of corners: those with fewer repeat their last corner.
    """

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        self.scenario = scenario
        specs = scenario.bodies
        self.names = tuple(spec.name for spec in specs)
        self.moves: NDArray[np.bool_] = np.array([spec.motion is not None for spec in specs], np.bool_)
        self._specs = specs
        self._corners = max((len(footprint(spec, 0.0)) for spec in specs), default=4)
        self._shapes: list[dict[float, FloatArray]] = [{} for _ in specs]
        self.z_m = np.array([heights(spec) for spec in specs]).reshape(-1, 2)
        self._trajectories = [trajectory_of(spec, seed) for spec in specs]
        self._movers: list[int] = np.flatnonzero(self.moves).tolist()
        self._still_polygons = np.empty((len(specs), self._corners, 2))
        for k, trajectory in enumerate(self._trajectories):
            self._still_polygons[k] = self._place(trajectory.sample(np.zeros(1)), k)
        self.end_s = max((self._trajectories[k].end_s for k in self._movers), default=0.0)
        self.precompute(np.zeros(1))

    def __len__(self) -> int:
        return len(self.names)

    def precompute(self, times_s: FloatArray) -> None:
        """Compute the results of snapshot() at times_s (T,) all at once, which is much cheaper than one by
        one."""
        times_s = np.append(times_s[times_s < self.end_s], self.end_s)
        self._precomputed_rows = {t_s: k for k, t_s in enumerate(times_s.tolist())}
        self._precomputed = self._all_at(times_s)

    def snapshot(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Polygons (N, K, 2) and velocities (N, 2) of all bodies at t_s. Do not write to them."""
        t_s = min(t_s, self.end_s)
        row, (polygons, velocity) = self._precomputed_rows.get(t_s), self._precomputed
        if row is None:
            row, (polygons, velocity) = 0, self._all_at(np.array([t_s]))
        return polygons[row], velocity[row]

    def sample(self, times_s: FloatArray, body: int) -> FloatArray:
        """Polygons (T, K, 2) of one body at times_s (T,)."""
        if not self.moves[body]:
            return np.broadcast_to(self._still_polygons[body], (len(times_s), self._corners, 2))
        return self._place(self._trajectories[body].sample(times_s), body)

    def room_polygon(self) -> FloatArray:
        """The building's walls from the inside (4, 2)."""
        room = self.scenario.room
        x0, x1, y0, y1 = room.x_min_m, room.x_max_m, room.y_min_m, room.y_max_m
        return np.array([[x1, y0], [x1, y1], [x0, y1], [x0, y0]])

    def _all_at(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Polygons (T, N, K, 2) and velocities (T, N, 2) of all bodies."""
        polygons = np.repeat(self._still_polygons[None], len(times_s), axis=0)
        velocity = np.zeros((len(times_s), len(self), 2))
        for body in self._movers:
            states = self._trajectories[body].sample(times_s)
            polygons[:, body], velocity[:, body] = self._place(states, body), states[:, 3:]
        return polygons, velocity

    def _place(self, states: FloatArray, body: int) -> FloatArray:
        """The polygons (T, K, 2) of one body in states (T, 5)."""
        shapes = self._outlines(body, states)
        cos, sin = np.cos(states[:, 2:3]), np.sin(states[:, 2:3])
        x = states[:, 0:1] + cos * shapes[..., 0] - sin * shapes[..., 1]
        y = states[:, 1:2] + sin * shapes[..., 0] + cos * shapes[..., 1]
        return np.stack((x, y), axis=2)

    def _outlines(self, body: int, states: FloatArray) -> FloatArray:
        """Outlines (T, K, 2) in the body frame; only those of people change with the speed."""
        if not isinstance(self._specs[body], Person):
            return self._shape(body, 0.0)[None]
        speeds = [round(speed, 3) for speed in np.hypot(states[:, 3], states[:, 4]).tolist()]
        row = {speed: k for k, speed in enumerate(dict.fromkeys(speeds))}
        shapes = np.array([self._shape(body, speed) for speed in row])
        return shapes[[row[speed] for speed in speeds]]

    def _shape(self, body: int, speed_mps: float) -> FloatArray:
        """The outline (K, 2) at a speed. It is cached, because the speed rarely changes."""
        cache = self._shapes[body]
        if speed_mps not in cache:
            cache[speed_mps] = _padded(footprint(self._specs[body], speed_mps), self._corners)
        return cache[speed_mps]


def _padded(shape: FloatArray, corners: int) -> FloatArray:
    return np.concatenate((shape, np.repeat(shape[-1:], corners - len(shape), axis=0)))
