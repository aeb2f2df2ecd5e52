"""The lidar baseline: clusters are tracked by Kalman filters and judged moving by a chi-square test.

It is background-free, as reference [20] of the paper is understood: no map and no background model, only
consecutive scans. It is given the same odometry as the camera and corrects the slip by scan matching
(controller/evaluation/methods/lidar_matching.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controller.evaluation.assignment import assign
from controller.evaluation.methods.lidar_clusters import find_clusters
from controller.evaluation.methods.lidar_matching import refine
from controller.evaluation.methods.lidar_scan import LidarModel, Scan
from controller.evaluation.types import CALLED_MOVING, NO_BOX, DetectedObject, MethodOutput
from hal.geometry import body_in_floor, camera_in_body, planar
from hal.types import CameraMount, FloatArray, Intrinsics, PlanarPose, Pose

_GATE_M = 0.6  # a cluster farther from a track does not belong to it
# Standard deviation of a cluster's middle: noise, and the change of the outline with the view.
_POSITION_SIGMA_M = 0.06
_OCCLUDED_SIGMA_M = 0.35  # the same for a cluster that is partly occluded
_ACCEL_MPS2 = 1.0  # standard deviation of a track's acceleration
# Thresholds for calling a track moving.
_MIN_SPEED_MPS = 0.25
_CHI2 = 25.0  # five standard deviations of the velocity
_MIN_SCANS = 4
_MIN_TRAVEL_M = 0.12  # distance from where the track began
_MAX_UNSEEN_S = 0.5  # a track without clusters for longer is dropped


@dataclass(slots=True, eq=False)
class _Track:
    """One tracked cluster, in the floor frame of the first scan.

    state, covariance: of x, y, vx, vy.
    start_m: (2,) where the track began.
    last_update_s: time of the last cluster.
    scans: number of clusters so far.
    streak: consecutive scans that passed the thresholds for moving.
    """

    id: int
    state: FloatArray
    covariance: FloatArray
    start_m: FloatArray
    last_update_s: float
    scans: int = 1
    streak: int = 0
    moving: bool = False

    def predict(self, dt_s: float) -> None:
        """Predict by dt_s: constant velocity, with white acceleration noise."""
        f = np.eye(4)
        f[0, 2] = f[1, 3] = dt_s
        g = np.array([[0.5 * dt_s**2, 0.0], [0.0, 0.5 * dt_s**2], [dt_s, 0.0], [0.0, dt_s]])
        self.state = f @ self.state
        self.covariance = f @ self.covariance @ f.T + g @ g.T * _ACCEL_MPS2**2

    def correct(self, measured_m: FloatArray, sigma_m: float, stamp_s: float) -> None:
        """Kalman update with a cluster's centre measured_m (2,), and a new verdict on moving."""
        innovation_cov = self.covariance[:2, :2] + np.eye(2) * sigma_m**2
        gain = self.covariance[:, :2] @ np.linalg.inv(innovation_cov)
        self.state = self.state + gain @ (measured_m - self.state[:2])
        self.covariance = self.covariance - gain @ self.covariance[:2]
        self.last_update_s = stamp_s
        self.scans += 1
        self._update_moving()

    @property
    def chi2(self) -> float:
        """Squared Mahalanobis distance of the velocity from zero."""
        velocity = self.state[2:]
        return float(velocity @ np.linalg.solve(self.covariance[2:, 2:], velocity))

    def _update_moving(self) -> None:
        speed_mps = float(np.hypot(*self.state[2:]))
        travelled_m = float(np.hypot(*(self.state[:2] - self.start_m)))
        passes = speed_mps >= _MIN_SPEED_MPS and self.chi2 >= _CHI2 and travelled_m >= _MIN_TRAVEL_M
        self.streak = self.streak + 1 if passes else 0
        if self.streak >= 2 and self.scans >= _MIN_SCANS:
            self.moving = True
        elif speed_mps < 0.5 * _MIN_SPEED_MPS:
            self.moving = False


class LidarTracker:
    """Takes scans and odometry, gives tracks, predicted to the time of each camera frame."""

    def __init__(self, model: LidarModel, mount: CameraMount, intrinsics: Intrinsics) -> None:
        self._model = model
        self._mount = mount
        self._half_field_tan = max(intrinsics.cx, intrinsics.width - 1 - intrinsics.cx) / intrinsics.fx
        self._tracks: list[_Track] = []
        self._next_id = 0
        self._now_s: float | None = None
        self._last: tuple[Scan, PlanarPose] | None = None
        self._pose = Pose(np.eye(3), np.zeros(3))

    def update(self, scan: Scan, odometry: PlanarPose) -> None:
        """Take in one scan. odometry: the robot's pose at that time."""
        clusters = find_clusters(scan)
        self._predict_to(scan.stamp_s)
        self._update_pose(scan, odometry)
        measured_m = self._pose.apply(_on_floor(clusters.centre_m + np.array([self._model.forward_m, 0.0])))[
            :, :2
        ]
        sigma_m = np.where(clusters.unoccluded, _POSITION_SIGMA_M, _OCCLUDED_SIGMA_M)
        expected = np.array([track.state[:2] for track in self._tracks]).reshape(-1, 2)
        distance_m = np.linalg.norm(measured_m[:, None] - expected[None], axis=2)
        pairs = assign(np.where(distance_m <= _GATE_M, distance_m, np.inf))
        for row, column in pairs:
            self._tracks[column].correct(measured_m[row], float(sigma_m[row]), scan.stamp_s)
        matched_rows = {row for row, _ in pairs}
        for row in range(len(measured_m)):
            if row not in matched_rows:
                self._start_track(measured_m[row], float(sigma_m[row]), scan.stamp_s)
        self._tracks = [
            track for track in self._tracks if scan.stamp_s - track.last_update_s <= _MAX_UNSEEN_S
        ]

    def answer(self, t_s: float, odometry: PlanarPose) -> MethodOutput:
        """The tracks in the camera's field of view at t_s, in the optical frame; height is not measured."""
        self._predict_to(t_s)
        motion = self._motion_since_last_scan(odometry)
        camera = self._pose @ body_in_floor(motion) @ camera_in_body(self._mount)
        detections = []
        for track in self._tracks:
            on_floor = np.array([[track.state[0], track.state[1], self._mount.height_m]])
            position = camera.inverse().apply(on_floor)[0]
            if position[2] <= 0.0 or abs(position[0]) > self._half_field_tan * position[2]:
                continue
            velocity = np.array([track.state[2], track.state[3], 0.0]) @ camera.rotation
            position[1] = math.nan
            detections.append(
                DetectedObject(
                    track.id, NO_BOX, position, velocity, np.full(3, math.nan), _confidence(track)
                )
            )  # fmt: skip
        return MethodOutput(tuple(detections))

    def _update_pose(self, scan: Scan, odometry: PlanarPose) -> None:
        """Update the robot's pose by odometry, corrected by matching this scan to the last one."""
        if self._last is not None:
            before, _ = self._last
            sensor = Pose(np.eye(3), np.array([self._model.forward_m, 0.0, 0.0]))
            odometry_motion = (
                sensor.inverse() @ body_in_floor(self._motion_since_last_scan(odometry)) @ sensor
            )
            matched = body_in_floor(refine(before, scan, planar(odometry_motion)))
            self._pose = self._pose @ sensor @ matched @ sensor.inverse()
        self._last = (scan, odometry)

    def _motion_since_last_scan(self, odometry: PlanarPose) -> PlanarPose:
        """Pose of the robot relative to its pose at the last scan, by odometry."""
        if self._last is None:
            return PlanarPose(0.0, 0.0, 0.0)
        return planar(body_in_floor(self._last[1]).inverse() @ body_in_floor(odometry))

    def _start_track(self, position_m: FloatArray, sigma_m: float, stamp_s: float) -> None:
        covariance = np.diag([sigma_m**2, sigma_m**2, 1.0, 1.0])
        state = np.array([*position_m, 0.0, 0.0])
        self._tracks.append(_Track(self._next_id, state, covariance, position_m.copy(), stamp_s))
        self._next_id += 1

    def _predict_to(self, t_s: float) -> None:
        if self._now_s is not None and t_s > self._now_s:
            for track in self._tracks:
                track.predict(t_s - self._now_s)
        self._now_s = t_s if self._now_s is None else max(t_s, self._now_s)


def _on_floor(points_m: FloatArray) -> FloatArray:
    return np.column_stack([points_m, np.zeros(len(points_m))])


def _confidence(track: _Track) -> float:
    """Confidence by the chi-square of the velocity; CALLED_MOVING or more exactly if the track is moving."""
    evidence = 1.0 - math.exp(-0.5 * track.chi2 / _CHI2)
    return (
        CALLED_MOVING + (1.0 - CALLED_MOVING) * evidence if track.moving else CALLED_MOVING * 0.999 * evidence
    )
