"""track: a Detection becomes the Scene, with bodies of stable id and filtered velocity, moving or static.

Steps, with their modules: velocities of fragments (least_squares); arrived and stayed surfaces (arrivals);
cells to tracks (masks, connected, votes, grouping, births); suspects and furniture cut out (carving,
left_behind, cutting); movers extended to the floor (grounding); bodies joined and divided (regrouping);
filters (sightings, rim_motion, approach); what hangs (hanging); fragments to tracks (adoption); velocities of
bodies (least_squares, one_edge); verdict (judgement); report. Terms: vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray, PlanarPose
from vision.bodies import (
    approach,
    births,
    carving,
    cutting,
    grounding,
    grouping,
    hanging,
    left_behind,
    masks,
    report,
    rim_motion,
    sightings,
    votes,
)
from vision.bodies.adoption import adopt, inherited
from vision.bodies.arrivals import Changes, ViewMemory, arriving
from vision.bodies.few_fragments import bodies_needing_fragments
from vision.bodies.judgement import judge
from vision.bodies.motion_evidence import FrameMeasures, evidence_of
from vision.bodies.regrouping import regrouped
from vision.bodies.tracks import Tracks
from vision.depth import connected, occlusion, regions
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.free_space import free_space
from vision.depth.near_floor import NearFloor
from vision.depth.regions import Regions
from vision.detection import Detection
from vision.motion import least_squares, limbs, one_edge, sliding
from vision.motion.least_squares import BodyVelocities, FragmentVelocities
from vision.percept import Percept
from vision.scene import CameraCondition, FreeSpace, Scene

_ACCEL_DENSITY = 0.08  # (m/s^2)^2 s, as people start, stop and turn: a sigma of 0.28 m/s after 1 s
# For so long after a frame in which few fragments fit one motion of the camera, the views before it may be
# out of place by more than the margin of arrivals. Static surfaces would seem to have arrived.
_OUT_OF_PLACE_NS, _NEVER_NS = 200_000_000, -(2**62)
_FORGET_S = 0.5  # a mover behind a post is visible again by then; the decision remembers for longer
_FORGET_YOUNG_S = 0.15  # a few frames, for a track that was hardly seen: it is taken for a speckle


class Tracker:
    """Keeps the tracks, their cells and fragments of the last frame, and the memory of free space."""

    def __init__(self, config: PerceptionConfig, body_height_m: float, clearance_m: float) -> None:
        self._config = config
        self._body_height_m = body_height_m
        self._clearance_m = clearance_m
        self._tracks = Tracks()
        self._free = ViewMemory(config.depth_noise)
        self._near_floor = NearFloor(config.min_depth_m)
        self._rims = rim_motion.RimMemory(config.motion.implausible_mps)
        self._surfaces = masks.NO_TRACK_SURFACES
        self._fragment_ids = np.empty(0, np.int64)
        self._fragment_owner = np.empty(0, np.int64)
        self._last_ns: int | None = None
        self._blurred_ns = _NEVER_NS

    def step(self, detection: Detection, robot_pose: PlanarPose | None) -> Percept:
        """Track through one detection; call in the order of time."""
        tracks = self._tracks
        if detection.restarted:
            tracks.clear()
            self._surfaces = masks.NO_TRACK_SURFACES
            self._last_ns, self._blurred_ns = None, _NEVER_NS  # time itself may have stepped back
        if detection.blurred:
            self._blurred_ns = detection.captured_ns
        if detection.restarted or not detection.motion_known:
            self._free.clear()
        if detection.restarted or detection.blurred or not detection.motion_known:
            self._rims.clear()
        elapsed_s = 0.0 if self._last_ns is None else (detection.captured_ns - self._last_ns) * 1e-9
        elapsed_s = min(max(elapsed_s, 0.0), self._config.max_gap_s)
        tracks.predict(elapsed_s, _ACCEL_DENSITY, detection.floor_normal)
        before_ns = detection.captured_ns if self._last_ns is None else self._last_ns
        self._last_ns = max(detection.captured_ns, before_ns)
        owner = inherited(self._fragment_ids, self._fragment_owner, detection.ids, tracks.ids)
        above_floor = connected.above_floor(detection.grid, self._clearance_m)
        velocities = least_squares.fragment_velocities(detection.motion, self._config.motion.max_speed_mps)
        if detection.health.condition is not CameraCondition.UNTRUSTWORTHY or detection.restarted:
            owner = self._update_tracks(detection, above_floor, owner, velocities, elapsed_s)
        unseen_s = (detection.captured_ns - tracks.seen_ns) * 1e-9
        young = tracks.sightings < report.MIN_SIGHTINGS
        tracks.keep(~tracks.merged_away & (unseen_s <= np.where(young, _FORGET_YOUNG_S, _FORGET_S)))
        self._fragment_ids, self._fragment_owner = detection.ids, owner
        return self._percept(detection, above_floor, owner, velocities, robot_pose)

    def _update_tracks(
        self,
        detection: Detection,
        above_floor: BoolGrid,
        owner: NDArray[np.int64],
        velocities: FragmentVelocities,
        elapsed_s: float,
    ) -> NDArray[np.int64]:
        """Update surfaces first, then velocities, then the verdict. Returns the track id of each fragment."""
        tracks, grid, pose, now_ns = self._tracks, detection.grid, detection.pose, detection.captured_ns
        noise = self._config.depth_noise
        changes = self._free.changes(grid, above_floor, pose, now_ns)
        if detection.motion_known or detection.restarted:
            self._free.remember(grid, pose, now_ns)
        labels, whole, measured = self._label(detection, above_floor, changes, velocities, elapsed_s)
        visible = occlusion.with_occlusion(grid, labels, measured)
        keeps_area = sightings.keeps_area(tracks, visible.cells)
        sightings.update_from_surfaces(tracks, detection, visible, noise)
        rims = self._rims.velocities(grid, labels, tracks, pose, now_ns)
        nearing = approach.measure(tracks, detection, labels, self._free, noise)
        if detection.dt_s > 0:
            rim_motion.fuse(tracks, rims, detection.dt_s)
            approach.fuse(tracks, nearing, pose.translation_m, detection.dt_s)
        sightings.forget_implausible(tracks, self._config.motion)
        hanging.update(tracks, grid, whole, measured, self._body_height_m, elapsed_s)
        owner = adopt(tracks, detection, whole, owner, noise)
        if detection.dt_s > 0 and len(tracks):
            body = self._fuse_fragments(detection, owner, velocities, ~measured.sides_visible)
            arrivals = masks.count_cells(whole, changes.arrived_cells, len(tracks))
            measures = FrameMeasures(body, rims, nearing, arrivals, measured.cells, keeps_area)
            self._judge(detection, measures)
        self._surfaces = masks.surfaces(grid, labels, tracks.ids, pose)
        return owner

    def _label(
        self,
        detection: Detection,
        above_floor: BoolGrid,
        changes: Changes,
        velocities: FragmentVelocities,
        elapsed_s: float,
    ) -> tuple[IntGrid, IntGrid, Regions]:
        """Assign cells to tracks: labels (h, w), track index + 1; the same with movers extended to the floor;
        and the regions of the tracks with that. The cells of the extension do not vote in the next frame."""
        tracks, grid = self._tracks, detection.grid
        labels = self._claim(detection, above_floor, changes, elapsed_s)
        measured = regions.measure(grid, labels, len(tracks))
        cuts = carving.cuts(tracks, detection, labels, measured, changes, velocities, self._config)
        rest = cutting.without(labels, cuts)
        cuts += left_behind.cuts(tracks, detection, above_floor, rest, measured, self._free, self._config)
        max_mps = self._config.motion.max_speed_mps
        labels, measured = cutting.cut_out(tracks, detection, labels, measured, cuts, max_mps)
        whole, upright = self._grounded(grid, labels, measured)
        regrouped_labels = regrouped(tracks, detection, labels, upright, changes)
        if regrouped_labels is not None:
            labels = regrouped_labels
            whole, upright = self._grounded(grid, labels, regions.measure(grid, labels, len(tracks)))
        return labels, whole, upright

    def _grounded(self, grid: DepthGrid, labels: IntGrid, measured: Regions) -> tuple[IntGrid, Regions]:
        """labels (h, w), and their regions measured, with movers extended to the floor."""
        tracks, noise = self._tracks, self._config.depth_noise
        return grounding.extend_to_floor(grid, labels, measured, tracks.border_is_guess, tracks.mover, noise)

    def _claim(
        self, detection: Detection, above_floor: BoolGrid, changes: Changes, elapsed_s: float
    ) -> IntGrid:
        """(h, w) track index + 1 of each cell, by the cells of all tracks in the frame before; births."""
        tracks, grid, pose = self._tracks, detection.grid, detection.pose
        mover = tracks.mover
        shift = np.where(mover[:, None], tracks.velocity_mps * elapsed_s, 0.0)
        index = tracks.index_of(self._surfaces.track_id)
        predicted = masks.predict(self._surfaces, index, shift, grid, pose)
        count, parts = connected.components(grid, above_floor)
        measured = regions.measure(grid, parts, count)
        ballot = votes.count_votes(parts, count, predicted, len(tracks), mover)
        sight, distance_m = tracks.sight(pose.translation_m)
        overdue = votes.overdue_movers(tracks, changes.stayed_s, sight, self._free.resolves_m(distance_m))
        ballot, hidden = votes.drop_overdue_movers(ballot, parts, predicted, changes.stayed, overdue, mover)
        tracks.mark_hidden(hidden)
        newly_arrived = masks.count_cells(parts, changes.arrived_cells, count)
        ballot = votes.drop_static_from_arrived(ballot, measured.cells, newly_arrived, mover)
        tracks.border_is_guess = votes.border_is_guess(ballot, mover)
        bodies = grouping.expected_bodies(tracks, pose, self._config.depth_noise)
        expected = grouping.expected_in(grid, measured, ballot.winner, ballot.votes, bodies, mover)
        winner = grouping.detach(ballot.winner, measured, ballot.votes, expected)
        alive = mover | tracks.ever_moved
        winner = grouping.attach((winner == 0).nonzero()[0], measured, winner, alive, expected)
        speed_mps = self._config.motion.max_speed_mps
        winner = births.start_tracks(
            tracks, detection, parts, measured, newly_arrived, winner, self._body_height_m, speed_mps
        )
        return votes.divide(parts, predicted, ballot, winner)

    def _fuse_fragments(
        self,
        detection: Detection,
        owner: NDArray[np.int64],
        velocities: FragmentVelocities,
        cut: NDArray[np.bool_],
    ) -> BodyVelocities:
        """One weighted least squares per body, fused into its filter.

        owner (N,): track of each fragment. cut (T,): tracks that the left or right border of the image cuts.
        """
        tracks, max_mps = self._tracks, self._config.motion.max_speed_mps
        rotation = detection.pose.rotation
        index = tracks.index_of(owner)
        tracks.fragments = np.bincount(index + 1, minlength=len(tracks) + 1)[1:]
        of_ends, start_mps = np.repeat(index, 2), tracks.velocity_mps @ rotation
        body = least_squares.body_velocities(
            detection.motion, velocities.per_end, of_ends, len(tracks), start_mps, max_mps
        )
        body = one_edge.without_way_along(body, detection.motion, of_ends, detection.camera.fx)
        use = limbs.believable(body).nonzero()[0]
        if len(use):
            # The time windows of successive frames overlap: a frame adds dt / window of a new measurement.
            lag_s = max(float(detection.motion.lag_s.max()), detection.dt_s)
            going = tracks.speed_mps * tracks.moving
            velocity, noise = limbs.in_fixed_frame(
                body.velocity_mps,
                body.covariance,
                limbs.variance(body, going),
                use,
                lag_s / detection.dt_s,
                rotation,
            )
            sight, _ = tracks.sight(detection.pose.translation_m)
            noise += sliding.variance(body, cut, use, sight)
            tracks.update_with_fragments(use, velocity, noise)
        return body

    def _judge(self, detection: Detection, measures: FrameMeasures) -> None:
        """The verdict on each track, from all evidence of this frame."""
        tracks, dt_s, settings = self._tracks, detection.dt_s, self._config.motion
        arrives = arriving(measures.arrived, measures.cells)
        tracks.restless_s = _sustained(tracks.restless_s, limbs.restless(measures.fragments), dt_s)
        tracks.arriving_s = _sustained(tracks.arriving_s, arrives, dt_s)
        tracks.approach_s = approach.approaching_s(tracks.approach_s, measures.approach, dt_s)
        tracks.rim_s = rim_motion.one_way_s(tracks.rim_s, measures.rims, settings.sigmas, dt_s)
        advances = tracks.update_trailing_average(dt_s)
        if detection.captured_ns - self._blurred_ns <= _OUT_OF_PLACE_NS:
            measures = replace(measures, arrived=np.zeros_like(measures.arrived))
        seen = evidence_of(tracks, detection, measures, advances, self._config.depth_noise)
        verdict = judge(seen, tracks.evidence, tracks.moving, dt_s, settings)
        tracks.evidence, tracks.moving = verdict.evidence, verdict.moving
        tracks.confidence, tracks.surely_static = verdict.confidence, verdict.surely_static
        tracks.ever_moved |= verdict.moving
        tracks.update_durations(verdict.proven, dt_s)

    def _percept(
        self,
        detection: Detection,
        above_floor: BoolGrid,
        owner: NDArray[np.int64],
        velocities: FragmentVelocities,
        robot_pose: PlanarPose | None,
    ) -> Percept:
        tracks = self._tracks
        scene = Scene(
            captured_ns=detection.captured_ns,
            sequence=detection.sequence,
            obstacles=report.obstacles(tracks, detection),
            free_space=self._free_space(detection, above_floor),
            ego_motion=detection.ego_motion,
            health=detection.health,
            robot_pose=robot_pose,
            floor=detection.floor,
        )
        index = tracks.index_of(owner)
        moving = np.concatenate((tracks.moving, [False]))[index]
        owner = np.where(index >= 0, owner, -1)
        return Percept(
            scene,
            report.fragments(detection, owner, moving, velocities),
            bodies_needing_fragments(tracks, detection, self._config.depth_noise),
        )

    def _free_space(self, detection: Detection, above_floor: BoolGrid) -> FreeSpace:
        grid = detection.grid
        trusted = detection.health.condition is not CameraCondition.UNTRUSTWORTHY
        measurable_from_m = self._near_floor.measurable_from_m(grid, trusted)
        in_the_way = (
            above_floor if grid.height_m is None else above_floor & (grid.height_m < self._body_height_m)
        )
        return free_space(grid, in_the_way, self._config.max_depth_m, measurable_from_m)


def _sustained(so_far_s: FloatArray, holds: NDArray[np.bool_], dt_s: float) -> FloatArray:
    """(T,) time in which a condition held, less the time in which it did not, after a further frame."""
    return np.maximum(so_far_s + np.where(holds, dt_s, -dt_s), 0.0)
