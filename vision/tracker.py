"""track: what was detected -> the Scene. Bodies with stable ids and filtered velocity, moving or static."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray, PlanarPose
from vision import kalman, obstacles, regions
from vision.depth_grid import BoolGrid, DepthGrid
from vision.depth_guard import free_space
from vision.depth_mask import depth_sigma_m
from vision.detector import Detection
from vision.regions import IntGrid, Region
from vision.scene import CameraCondition, Fragments, Obstacle, Scene
from vision.tracks import Tracks

_ACCEL_MPS2 = 1.5  # how briskly people start, stop and turn
_RISE_S = 0.1
_FALL_S = 0.3
_MAX_EVIDENCE = 1.5
_FORGET_S = 0.5
_MIN_CELLS = 12
_MAX_STATIC = 40
_MIN_ENDS = 4
_MIN_SIGHTINGS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Percept:
    """What perception says of one frame."""

    scene: Scene
    fragments: Fragments


class Tracker:
    """Keeps the tracks and which fragment belongs to which."""

    def __init__(self, config: PerceptionConfig, body_height_m: float, clearance_m: float) -> None:
        self._config = config
        self._body_height_m = body_height_m
        self._clearance_m = clearance_m
        self._tracks = Tracks()
        self._owner_of: tuple[NDArray[np.int64], NDArray[np.int64]] = (
            np.empty(0, np.int64),
            np.empty(0, np.int64),
        )
        self._last_ns: int | None = None

    def step(self, detection: Detection, robot_pose: PlanarPose | None) -> Percept:
        """One detection, in the order of time."""
        tracks = self._tracks
        if detection.restarted:
            tracks.clear()
        elapsed_s = 0.0 if self._last_ns is None else (detection.captured_ns - self._last_ns) * 1e-9
        tracks.predict(min(max(elapsed_s, 0.0), self._config.max_gap_s), _ACCEL_MPS2)
        self._last_ns = max(detection.captured_ns, self._last_ns or 0)
        owner = self._owners(detection.ids)
        velocity, covariance = obstacles.fragment_velocities(
            detection.motion, self._config.motion.max_speed_mps
        )
        if detection.dt_s > 0:
            owner = self._regroup(detection, owner, velocity, covariance)
            self._measure_velocities(detection, owner)
        standing = regions.standing(detection.grid, self._clearance_m)
        if detection.health.condition is not CameraCondition.UNTRUSTWORTHY or detection.restarted:
            owner = self._measure_surfaces(detection, standing, owner)
        self._forget(detection.captured_ns)
        ids = np.where(owner >= 0, owner, -1)
        self._owner_of = (detection.ids, ids)
        return self._percept(detection, standing, ids, velocity, covariance, robot_pose)

    def _owners(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """(N,) track id of each fragment as of the frame before, -1 for none."""
        known, owner = self._owner_of
        result = np.full(len(ids), -1, np.int64)
        if len(known):
            place = np.minimum(np.searchsorted(known, ids), len(known) - 1)
            same = known[place] == ids
            result[same] = owner[place[same]]
        result[self._tracks.index_of(result) < 0] = -1
        return result

    def _regroup(
        self,
        detection: Detection,
        owner: NDArray[np.int64],
        velocity: FloatArray,
        covariance: FloatArray,
    ) -> NDArray[np.int64]:
        """Let go of what stands still, and make bodies of fragments that move and belong to none."""
        tracks, motion = self._tracks, detection.motion
        index = tracks.index_of(owner)
        on_mover = (index >= 0) & tracks.moving[np.maximum(index, 0)] if len(tracks) else index >= 0
        candidate = obstacles.moving_candidates(motion, detection.age_frames)
        owner = owner.copy()
        # A mover's fragment that a static surface explains, and the mover's motion does not, is not its own.
        if on_mover.any():
            middle_velocity = (tracks.state[np.maximum(index, 0), 3:]) @ detection.pose.rotation
            against = obstacles.end_chi2(motion, np.repeat(middle_velocity, 2, axis=0))
            static = np.where(motion.usable, motion.static_chi2, 0.0).reshape(-1, 2).sum(axis=1)
            loose = on_mover & (static + 6.0 < against.reshape(-1, 2).sum(axis=1))
            owner[loose & ~candidate] = -1
        free = candidate & ~on_mover
        if free.sum() < 2:
            return owner
        chosen = np.flatnonzero(free)
        position = 0.5 * (motion.static_m[0::2] + motion.static_m[1::2])[chosen]
        sigma = depth_sigma_m(position[:, 2], self._config.depth_noise)
        group = obstacles.cluster(position, velocity[chosen], covariance[chosen], sigma)
        for number in range(int(group.max()) + 1):
            members = chosen[group == number]
            if len(members) < 2:
                continue
            owner[members] = self._body_for(detection, members, owner, position[group == number], velocity)
        return owner

    def _body_for(
        self,
        detection: Detection,
        members: NDArray[np.intp],
        owner: NDArray[np.int64],
        position: FloatArray,
        velocity: FloatArray,
    ) -> int:
        """The track id for a group of moving fragments: the mover they are at, the body they make up, or new."""
        tracks = self._tracks
        centre = np.median(position, axis=0)
        pose = detection.pose
        if len(tracks):
            local = (tracks.state[:, :3] - pose.translation_m) @ pose.rotation
            reach = 0.5 * np.hypot(tracks.extent_m[:, 0], tracks.extent_m[:, 1]) + 0.3
            gap = np.abs(local - centre)
            close = (np.hypot(gap[:, 0], gap[:, 1]) <= reach) & (
                gap[:, 2] <= 0.6 + 2.0 * depth_sigma_m(centre[2], self._config.depth_noise)
            )
            at_mover = close & (tracks.moving | (tracks.evidence > 0.0))
            if at_mover.any():
                distance = np.where(at_mover, np.linalg.norm(gap, axis=1), np.inf)
                return int(tracks.ids[int(distance.argmin())])
            owned = owner[members]
            values, counts = np.unique(owned[owned >= 0], return_counts=True)
            if len(values):
                best = int(values[counts.argmax()])
                if counts.max() >= 0.6 * np.count_nonzero(owner == best):
                    return best
        speed = np.median(velocity[members], axis=0)
        start = pose.apply(centre[None])[0]
        maximum = self._config.motion.max_speed_mps
        new = tracks.start(start, pose.rotation @ speed, maximum, detection.captured_ns)
        return int(tracks.ids[new])

    def _measure_velocities(self, detection: Detection, owner: NDArray[np.int64]) -> None:
        """One weighted least squares per body, fused into its filter; then moving or not, with hysteresis."""
        tracks, settings = self._tracks, self._config.motion
        if len(tracks) == 0:
            return
        rotation = detection.pose.rotation
        index = tracks.index_of(owner)
        tracks.fragments = np.bincount(index[index >= 0], minlength=len(tracks)).astype(np.intp)
        body = obstacles.body_velocities(
            detection.motion,
            np.repeat(index, 2),
            len(tracks),
            tracks.state[:, 3:] @ rotation,
            settings.max_speed_mps,
        )
        measured = (body.ends >= 2) & (body.agreement >= 0.3)
        if measured.any():
            # Windows overlap: each frame brings dt / window of a new measurement.
            lag_s = max(float(detection.motion.lag_s.max()), detection.dt_s)
            noise = body.covariance * (lag_s / detection.dt_s)
            turned = rotation @ noise[measured] @ rotation.T
            state, covariance = kalman.update(
                tracks.state[measured],
                tracks.covariance[measured],
                body.velocity_mps[measured] @ rotation.T,
                turned,
                3,
            )
            tracks.state[measured], tracks.covariance[measured] = state, covariance
        self._judge(detection, body, measured)

    def _judge(
        self, detection: Detection, body: obstacles.BodyVelocities, measured: NDArray[np.bool_]
    ) -> None:
        tracks, settings = self._tracks, self._config.motion
        speed = tracks.state[:, 3:]
        doubt = tracks.covariance[:, 3:, 3:] + np.eye(3) * 0.03**2
        significance = (speed[:, None, :] @ np.linalg.solve(doubt, speed[:, :, None]))[:, 0, 0]
        # This frame's own measurement must say so too: a filter remembers its outliers.
        now = body.velocity_mps
        own = (now[:, None, :] @ np.linalg.solve(body.covariance, now[:, :, None]))[:, 0, 0]
        length = np.linalg.norm(speed, axis=1)
        distance = np.linalg.norm(tracks.state[:, :3] - detection.pose.translation_m, axis=1)
        least = settings.min_speed_mps + 0.02 * distance
        trusted = detection.ego_motion.source != "none"
        rising = (
            measured
            & (significance > settings.sigmas**2)
            & (own > 0.5 * settings.sigmas**2)
            & (length > least)
            & (body.ends >= _MIN_ENDS)
            & (body.agreement >= 0.5)
            & trusted
        )
        holding = tracks.moving & measured & (length > 0.6 * least) & (significance > 4.0)
        change = np.where(rising, detection.dt_s / _RISE_S, np.where(holding, 0.0, -detection.dt_s / _FALL_S))
        tracks.evidence = np.clip(tracks.evidence + change, 0.0, _MAX_EVIDENCE)
        tracks.moving = np.where(tracks.moving, tracks.evidence > 0.0, tracks.evidence >= 1.0)
        tracks.confidence = np.clip(1.0 - np.exp(-significance / 60.0), 0.0, 1.0) * np.clip(
            body.agreement + 0.2, 0.0, 1.0
        )

    def _measure_surfaces(
        self, detection: Detection, standing: BoolGrid, owner: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """What each body covers: movers by their fragments, everything else by connected depth."""
        grid, tracks, noise = detection.grid, self._tracks, self._config.depth_noise
        count, labels, stats = regions.components(grid, standing)
        index = tracks.index_of(owner)
        mover = tracks.moving | (tracks.evidence > 0.0)
        carve = (
            np.where(index >= 0, np.where(mover[np.maximum(index, 0)], index, -1), -1)
            if len(tracks)
            else index
        )
        claimed = np.full(standing.shape, -1, np.int32)
        if (carve >= 0).any():
            depth = detection.near_m.ravel().astype(float)
            of_end = np.repeat(carve, 2)
            settled = np.isfinite(depth) & ((of_end >= 0) | (np.repeat(detection.age_frames, 2) >= 3))
            claimed = regions.claim(
                grid,
                standing,
                detection.ends_px.reshape(-1, 2)[settled].astype(float),
                depth[settled],
                of_end[settled],
                detection.camera.fx,
                noise,
            )
            claimed = regions.absorb(claimed, labels, count, len(tracks))
            for track in np.unique(claimed[claimed >= 0]):
                cells = claimed == track
                region = regions.measure(grid, cells)
                if region is not None and self._reachable(grid, cells):
                    self._see(detection, int(track), region)
            labels[claimed >= 0] = 0
        owned = self._static_bodies(detection, labels, stats, owner, mover)
        return self._adopt(detection, owned, claimed, owner, mover)

    def _static_bodies(
        self,
        detection: Detection,
        labels: IntGrid,
        stats: NDArray[np.int32],
        owner: NDArray[np.int64],
        mover: NDArray[np.bool_],
    ) -> IntGrid:
        """Follow connected depth as static bodies. Returns (h, w) track ids, -1 for none."""
        grid, tracks = detection.grid, self._tracks
        area = np.bincount(labels.ravel(), minlength=len(stats))
        area[0] = 0
        lowest = self._in_reach(grid, labels, len(stats))
        order = np.argsort(-area, kind="stable")[:_MAX_STATIC]
        chosen = [int(c) for c in order if area[c] >= _MIN_CELLS and lowest[c] >= _MIN_CELLS // 2]
        table = np.full(len(stats), -1, np.int64)
        free = set(np.flatnonzero(~tracks.seen_now).tolist())
        ends = detection.ends_px.reshape(-1, 2).astype(float)
        at = labels[grid.rows(ends[:, 1]), grid.columns(ends[:, 0])].reshape(-1, 2)
        index = tracks.index_of(owner)
        for component in chosen:
            region = regions.measure(grid, labels == component)
            if region is None:
                continue
            votes = index[(at == component).any(axis=1) & (index >= 0)]
            track = self._match(detection, region, votes, free)
            if track is None:
                start = detection.pose.apply(region.position_m[None])[0]
                track = tracks.start(
                    start, np.zeros(3), self._config.motion.max_speed_mps, detection.captured_ns
                )
            free.discard(track)
            self._see(detection, track, region)
            table[component] = tracks.ids[track]
        return table[labels].astype(np.int32)

    def _match(
        self, detection: Detection, region: Region, votes: NDArray[np.intp], free: set[int]
    ) -> int | None:
        """The track that most fragments of a region name, else the nearest one that is not seen yet."""
        tracks = self._tracks
        if len(votes):
            best = int(np.bincount(votes).argmax())
            if best in free:
                return best
        candidates = np.array(sorted(free), np.intp)
        if len(candidates) == 0:
            return None
        local = (tracks.state[candidates, :3] - detection.pose.translation_m) @ detection.pose.rotation
        gap = np.abs(local - region.position_m)
        sigma = float(depth_sigma_m(region.position_m[2], self._config.depth_noise))
        reach = 0.3 + 0.3 * max(float(region.extent_m[0]), float(region.extent_m[1]))
        fits = (np.hypot(gap[:, 0], gap[:, 1]) <= reach) & (gap[:, 2] <= 0.4 + 2.0 * sigma)
        if not fits.any():
            return None
        distance = np.where(fits, np.linalg.norm(gap, axis=1), np.inf)
        return int(candidates[int(distance.argmin())])

    def _see(self, detection: Detection, track: int, region: Region) -> None:
        sigma = float(depth_sigma_m(region.position_m[2], self._config.depth_noise))
        loose = 5.0 if region.touches_border else 1.0
        noise = np.diag(np.square([0.2 * loose, 0.2 * loose, 0.2 * loose + 0.5 * sigma]))
        rotation = detection.pose.rotation
        position = detection.pose.apply(region.position_m[None])[0]
        self._tracks.see(track, region, position, rotation @ noise @ rotation.T, detection.captured_ns)

    def _adopt(
        self,
        detection: Detection,
        owned: IntGrid,
        claimed: IntGrid,
        owner: NDArray[np.int64],
        mover: NDArray[np.bool_],
    ) -> NDArray[np.int64]:
        """Fragments belong to the body whose surface they lie on; movers keep theirs."""
        grid, tracks = detection.grid, self._tracks
        if len(tracks) == 0 or len(owner) == 0:
            return owner
        body = owned.astype(np.int64)
        taken = claimed >= 0
        body[taken] = tracks.ids[claimed[taken]]
        ends = detection.ends_px.astype(float)
        shares = np.array([0.5, 0.15, 0.85])
        along = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * shares[:, None]
        rows, columns = grid.rows(along[..., 1].ravel()), grid.columns(along[..., 0].ravel())
        there = body[rows, columns].reshape(-1, 3)
        near = np.nanmin(np.where(np.isfinite(detection.near_m), detection.near_m, 99.0), axis=1)
        gap = np.abs(grid.depth_m[rows, columns].reshape(-1, 3) - near[:, None])
        agrees = (there >= 0) & (gap <= 0.3 + 2.0 * depth_sigma_m(near, self._config.depth_noise)[:, None])
        first = agrees.argmax(axis=1)
        found = np.where(agrees.any(axis=1), there[np.arange(len(there)), first], -1)
        index = tracks.index_of(owner)
        padded = np.zeros(len(tracks), np.bool_)
        padded[: len(mover)] = mover
        stays = (index >= 0) & padded[np.maximum(index, 0)]
        return np.where(stays, owner, found)

    def _in_reach(self, grid: DepthGrid, labels: IntGrid, count: int) -> NDArray[np.intp]:
        """(count,) cells of each component that are lower than the robot is high."""
        if grid.height_m is None:
            return np.bincount(labels.ravel(), minlength=count)
        low = grid.height_m < self._body_height_m
        return np.bincount(labels[low], minlength=count)

    def _reachable(self, grid: DepthGrid, cells: BoolGrid) -> bool:
        """Whether a body reaches down to where the robot is: what hangs above it is no obstacle."""
        return grid.height_m is None or bool((grid.height_m[cells] < self._body_height_m).any())

    def _forget(self, now_ns: int) -> None:
        tracks = self._tracks
        unseen_s = (now_ns - tracks.seen_ns) * 1e-9
        young = tracks.sightings < _MIN_SIGHTINGS
        tracks.keep(unseen_s <= np.where(young, 0.15, _FORGET_S))

    def _percept(
        self,
        detection: Detection,
        standing: BoolGrid,
        owner: NDArray[np.int64],
        velocity: FloatArray,
        covariance: FloatArray,
        robot_pose: PlanarPose | None,
    ) -> Percept:
        grid = detection.grid
        in_way = standing if grid.height_m is None else standing & (grid.height_m < self._body_height_m)
        scene = Scene(
            detection.captured_ns,
            detection.sequence,
            self._obstacles(detection),
            free_space(grid, in_way, self._config.max_depth_m),
            detection.ego_motion,
            detection.health,
            robot_pose,
        )
        index = self._tracks.index_of(owner)
        moving = (index >= 0) & self._tracks.moving[np.maximum(index, 0)] if len(self._tracks) else index >= 0
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        measured = (detection.age_frames >= 1)[:, None] & (detection.dt_s > 0)
        depth = detection.near_m.mean(axis=1).astype(float)
        middle = detection.ends_px.mean(axis=1).astype(float)
        camera = detection.camera
        position = np.stack(
            (
                (middle[:, 0] - camera.cx) / camera.fx * depth,
                (middle[:, 1] - camera.cy) / camera.fy * depth,
                depth,
            ),
            axis=1,
        )
        fragments = Fragments(
            detection.ids,
            detection.ends_px,
            depth,
            position,
            np.where(measured, velocity, np.nan),
            np.where(measured, sigma, np.nan),
            moving,
            np.where(index >= 0, owner, -1),
        )
        return Percept(scene, fragments)

    def _obstacles(self, detection: Detection) -> tuple[Obstacle, ...]:
        tracks, pose = self._tracks, detection.pose
        local = (tracks.state[:, :3] - pose.translation_m) @ pose.rotation
        velocity = tracks.state[:, 3:] @ pose.rotation
        covariance = pose.rotation.T @ tracks.covariance[:, 3:, 3:] @ pose.rotation
        result = []
        for t in range(len(tracks)):
            if tracks.sightings[t] < _MIN_SIGHTINGS or local[t, 2] <= 0.0:
                continue
            moving = bool(tracks.moving[t])
            u0, v0, u1, v1 = tracks.bbox_px[t].tolist()
            result.append(
                Obstacle(
                    int(tracks.ids[t]),
                    (u0, v0, u1, v1),
                    local[t],
                    tracks.extent_m[t].copy(),
                    velocity[t],
                    covariance[t],
                    moving,
                    float(tracks.confidence[t]) if moving else 0.5,
                    int(tracks.fragments[t]),
                    (detection.captured_ns - int(tracks.born_ns[t])) * 1e-9,
                    (detection.captured_ns - int(tracks.seen_ns[t])) * 1e-9,
                )
            )
        return tuple(result)
