"""The simulated world: where every face and every body is, as a pure function of time."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.scenario import BodySpec, Scenario
from hal.geometry import body_in_floor
from hal.types import FloatArray, PlanarPose, Pose
from sim.models.bodies import BodyModel, build_body
from sim.models.building import build_room
from sim.models.mesh import Faces, join, normals
from sim.models.outlines import footprint, heights
from sim.motion import MotionState, Trajectory

BUILDING_ID = 0  # its value in instance masks; the bodies count from 1


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """N faces at one time, in the frame of the floor. Their order never changes within a world.

    corners_m: (N, 4, 3).
    normals: (N, 3).
    windows: (N, 4), see sim.models.mesh.Faces.
    texture: (N,), index into World.textures.
    body: (N,), 0 for the building, k + 1 for the scenario's k-th body.
    """

    corners_m: FloatArray
    normals: FloatArray
    windows: FloatArray
    texture: NDArray[np.int32]
    body: NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class BodyState:
    """One body at one time, in the frame of the floor.

    id: its value in instance masks.
    velocity_mps: (2,).
    footprint_m: (K, 2), convex, counter-clockwise.
    reach_m: greatest distance of the footprint from pose.
    z_m: lowest and highest point.
    moves: whether it has a motion plan.
    """

    id: int
    name: str
    kind: str
    pose: PlanarPose
    velocity_mps: FloatArray
    yaw_rate_radps: float
    footprint_m: FloatArray
    reach_m: float
    z_m: tuple[float, float]
    moves: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    id: int
    spec: BodySpec
    model: BodyModel
    trajectory: Trajectory


class World:
    """A scenario over time. The seed picks textures and the jitter of the movers' start times."""

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        self.scenario = scenario
        self.seed = seed
        self._bodies = tuple(
            _Body(index + 1, spec, build_body(spec, seed), trajectory_of(spec, seed))
            for index, spec in enumerate(scenario.bodies)
        )
        still = [body for body in self._bodies if body.spec.motion is None]
        self._movers = [body for body in self._bodies if body.spec.motion is not None]
        self._still_states = {body.id: _state(body, 0.0) for body in still}
        parts = [(BUILDING_ID, build_room(scenario.room))]
        parts.extend((body.id, faces) for body in still for faces in _placed_parts(body, 0.0))
        fixed = join([faces for _, faces in parts])
        moving_parts = [(body.id, faces) for body in self._movers for faces in body.model.parts]
        moving = join([faces for _, faces in moving_parts])
        self._last_poses: dict[int, tuple[MotionState, FloatArray, FloatArray]] = {}
        self._join(fixed, moving)
        self._still_face_count = len(fixed)
        owners = [id_ for id_, faces in (*parts, *moving_parts) for _ in range(len(faces))]
        self._body_of_face = np.array(owners, dtype=np.uint16)
        part_sizes = [len(faces) for _, faces in moving_parts]
        self._part_of_face = np.repeat(np.arange(len(part_sizes)), part_sizes)

    def _join(self, fixed: Faces, moving: Faces) -> None:
        """All faces in one set of arrays, those of the movers last."""
        keys = fixed.textures + moving.textures
        self.textures: tuple[str, ...] = tuple(dict.fromkeys(keys))
        index_of = {key: index for index, key in enumerate(self.textures)}
        self._texture_of_face = np.array([index_of[key] for key in keys], dtype=np.int32)
        self._windows = np.concatenate([fixed.windows, moving.windows])
        self._corners = np.concatenate([fixed.corners_m, moving.corners_m])
        self._normals = normals(self._corners)

    def geometry(self, t_s: float) -> Geometry:
        """Every face at t_s."""
        corners, rotated_normals = self._corners.copy(), self._normals.copy()
        if self._movers:
            rotations, translations = self._mover_poses(t_s)
            part_index, first_moving = self._part_of_face, self._still_face_count
            rotation = rotations[part_index]
            corners[first_moving:] = np.matmul(self._corners[first_moving:], rotation.transpose(0, 2, 1))
            corners[first_moving:] += translations[part_index][:, None, :]
            rotated_normals[first_moving:] = np.matmul(rotation, self._normals[first_moving:, :, None])[
                :, :, 0
            ]
        return Geometry(corners, rotated_normals, self._windows, self._texture_of_face, self._body_of_face)

    def bodies(self, t_s: float) -> tuple[BodyState, ...]:
        """Every body at t_s, in the scenario's order."""
        still = self._still_states
        return tuple(still.get(body.id) or _state(body, t_s) for body in self._bodies)

    def _mover_poses(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Rotations (P, 3, 3) and translations (P, 3) of the parts of all movers."""
        poses = [self._poses_of(body, t_s) for body in self._movers]
        rotations, translations = zip(*poses, strict=True)
        return np.concatenate(rotations), np.concatenate(translations)

    def _poses_of(self, body: _Body, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Rotations (K, 3, 3) and translations (K, 3) of a mover's parts."""
        state = body.trajectory.at(t_s)
        last = self._last_poses.get(body.id)
        if last is not None and last[0] == state:  # it stands still
            return last[1:]
        poses = _part_poses(body, state)
        rotations = np.array([pose.rotation for pose in poses])
        translations = np.array([pose.translation_m for pose in poses])
        self._last_poses[body.id] = state, rotations, translations
        return rotations, translations


def trajectory_of(spec: BodySpec, seed: int) -> Trajectory:
    """The trajectory of a body in a world of this seed, which shifts its start time."""
    start = PlanarPose(spec.x_m, spec.y_m, math.radians(spec.heading_deg))
    jitter_s = 0.0
    if spec.motion is not None and spec.motion.start_jitter_s > 0.0:
        generator = np.random.default_rng((seed, zlib.crc32(spec.name.encode()), 1))
        jitter_s = spec.motion.start_jitter_s * float(generator.uniform(-1.0, 1.0))
    return Trajectory(start, spec.motion, jitter_s)


def _part_poses(body: _Body, state: MotionState) -> list[Pose]:
    """The poses of a body's parts in the frame of the floor."""
    outer = body_in_floor(PlanarPose(state.x_m, state.y_m, state.heading_rad))
    return [outer @ part for part in body.model.pose_parts(state)]


def _placed_parts(body: _Body, t_s: float) -> list[Faces]:
    poses = _part_poses(body, body.trajectory.at(t_s))
    return [
        faces.moved(pose.rotation, pose.translation_m)
        for faces, pose in zip(body.model.parts, poses, strict=True)
    ]


def _state(body: _Body, t_s: float) -> BodyState:
    state: MotionState = body.trajectory.at(t_s)
    c, s = math.cos(state.heading_rad), math.sin(state.heading_rad)
    turn = np.array([[c, -s], [s, c]])
    outline = footprint(body.spec, state.speed_mps)
    return BodyState(
        id=body.id,
        name=body.spec.name,
        kind=body.spec.kind,
        pose=PlanarPose(state.x_m, state.y_m, state.heading_rad),
        velocity_mps=np.array([state.vx_mps, state.vy_mps]),
        yaw_rate_radps=state.yaw_rate_radps,
        footprint_m=outline @ turn.T + np.array([state.x_m, state.y_m]),
        reach_m=math.sqrt(float((outline * outline).sum(axis=1).max())),
        z_m=heights(body.spec),
        moves=body.spec.motion is not None,
    )
