"""Where the robot is on the floor: the chassis' odometry, its yaw corrected by what the camera sees.

Tracks slip when they turn: the odometry of a skid-steered base is wrong in yaw by 10 % and more, while its
distance is good. The camera's own rotation, measured against the static scene, is not affected by slip. So
distance comes from the odometry and yaw from both: the yaw ratio, the share of each turn that really happens,
is estimated from the pairs (odometry yaw, visual yaw) of all frames by least squares, weighted by how sure
the camera was.

The slip belongs to the base and its floor, so a better estimate holds for the path already driven, too. That
path is stored as legs (distance, raw turn by odometry) and re-integrated with each new yaw ratio. The pose
therefore moves a little with each estimate.

While the odometry is not finite, the pose is not known (NaN), and the decision stops the robot. The first
finite odometry after that includes what was driven meanwhile.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque

import numpy as np

from controller.base.contradiction import Contradiction, FrameMotion
from hal.clocks import NS_PER_S
from hal.geometry import body_in_floor, camera_in_body, camera_in_floor, wrap_angle_rad
from hal.types import CameraMount, PlanarPose, Pose
from vision.scene import EgoMotion

HISTORY_S = 2.0
_HISTORY_NS = round(HISTORY_S * NS_PER_S)
# The path driven is stored as legs, each so short that it counts as straight.
LEG_M = 0.05
LEG_RAD = 0.02
MOST_LEGS = 2000  # older legs are no longer re-integrated
# Prior of the yaw ratio (true / odometry): 1 +/- 0.15, a skid-steered base on a hard floor.
PRIOR_RATIO_SIGMA = 0.15

UNKNOWN = PlanarPose(math.nan, math.nan, math.nan)


class PoseHistory:
    """The last poses with their times, interpolated.

    For up to reach_s after the last pose, it is extrapolated by at most the time between the last two. If the
    pose stood still there, every other frame would see a jolt.
    """

    def __init__(self, reach_s: float = 0.1) -> None:
        self._stamps_ns: deque[int] = deque()
        self._poses: deque[PlanarPose] = deque()
        self._reach_ns = int(reach_s * NS_PER_S)

    def append(self, stamp_ns: int, pose: PlanarPose) -> None:
        """Add a pose; a stamp that does not advance replaces the last one.

        A pose that is not known is not stored, so that the last one grows old.
        """
        if not pose.finite:
            return
        stamps_ns, poses, oldest_ns = self._stamps_ns, self._poses, stamp_ns - _HISTORY_NS
        while stamps_ns and stamps_ns[-1] >= stamp_ns:
            stamps_ns.pop()
            poses.pop()
        stamps_ns.append(stamp_ns)
        poses.append(pose)
        while stamps_ns[0] < oldest_ns:
            stamps_ns.popleft()
            poses.popleft()

    def at(self, stamp_ns: int) -> PlanarPose | None:
        """The pose at stamp_ns between two known ones; None where it is not known."""
        if not self._stamps_ns or stamp_ns < self._stamps_ns[0]:
            return None
        after = bisect_left(self._stamps_ns, stamp_ns)
        if after == len(self._stamps_ns):
            return self._beyond(stamp_ns)
        if self._stamps_ns[after] == stamp_ns:
            return self._poses[after]
        return _interpolate(
            self._stamps_ns[after - 1],
            self._poses[after - 1],
            self._stamps_ns[after],
            self._poses[after],
            stamp_ns,
        )

    def _beyond(self, stamp_ns: int) -> PlanarPose | None:
        newest_ns, newest = self._stamps_ns[-1], self._poses[-1]
        if stamp_ns - newest_ns > self._reach_ns:
            return None
        if len(self._poses) < 2:
            return newest
        before_ns = self._stamps_ns[-2]
        goes_on_ns = min(stamp_ns, 2 * newest_ns - before_ns)
        return _interpolate(before_ns, self._poses[-2], newest_ns, newest, goes_on_ns)


def _interpolate(t0_ns: int, p0: PlanarPose, t1_ns: int, p1: PlanarPose, t_ns: int) -> PlanarPose:
    share = (t_ns - t0_ns) / (t1_ns - t0_ns)
    return PlanarPose(
        p0.x_m + share * (p1.x_m - p0.x_m),
        p0.y_m + share * (p1.y_m - p0.y_m),
        wrap_angle_rad(p0.heading_rad + share * wrap_angle_rad(p1.heading_rad - p0.heading_rad)),
    )


class Localiser:
    """Fuses odometry increments with the visual yaw. Poses are in the frame of the path.

    `add_odometry` at every control step, `add_ego_motion` at every scene; `pose` is the newest one.
    """

    def __init__(self, start: PlanarPose, mount: CameraMount) -> None:
        self._pose = start
        self._lost = False
        self._mount = mount
        self._camera_in_body = camera_in_body(mount).rotation
        self._odometry = PoseHistory()
        self._fused = PoseHistory()
        self._contradiction = Contradiction()
        self._last_odometry: PlanarPose | None = None
        self._settled = start
        self._legs: list[tuple[float, float]] = [(0.0, 0.0)]
        self._sum_odometry_visual = 1.0 / PRIOR_RATIO_SIGMA**2
        self._sum_odometry_odometry = 1.0 / PRIOR_RATIO_SIGMA**2

    @property
    def pose(self) -> PlanarPose:
        """The newest; NaN while the odometry does not say where the base is."""
        return UNKNOWN if self._lost else self._pose

    @property
    def yaw_ratio(self) -> float:
        """Estimated share of the odometry's yaw that really happens: 1 - slip."""
        return self._sum_odometry_visual / self._sum_odometry_odometry

    @property
    def contradiction(self) -> str:
        """Why the odometry cannot be right, by the images; "" as long as they do not contradict it."""
        return self._contradiction.sentence

    def add_odometry(self, stamp_ns: int, odometry: PlanarPose) -> PlanarPose:
        """Take in the dead reckoning of the chassis at stamp_ns, in its own frame; returns the fused pose.

        Odometry that is not finite counts as missing; the next finite one includes what was driven meanwhile.
        """
        self._lost = not odometry.finite
        if self._lost:
            return UNKNOWN
        if self._last_odometry is not None:
            distance_m, turn_rad = _increment(self._last_odometry, odometry)
            self._pose = _move(self._pose, distance_m, turn_rad * self.yaw_ratio)
            self._remember(distance_m, turn_rad)
        self._last_odometry = odometry
        self._odometry.append(stamp_ns, odometry)
        self._fused.append(stamp_ns, self._pose)
        return self._pose

    def add_ego_motion(self, captured_ns: int, ego: EgoMotion) -> None:
        """Learn from the motion that the camera saw between the frame before and captured_ns.

        Motion that is not finite is ignored: the sums would stay NaN for ever.
        """
        if not (math.isfinite(ego.dt_s) and ego.motion.finite):
            return
        before = self._odometry.at(captured_ns - round(ego.dt_s * NS_PER_S))
        after = self._odometry.at(captured_ns)
        seen = ego.source in ("visual", "disputed")
        if not seen or before is None or after is None or not ego.sigma_rotation_rad > 0.0:
            return
        in_body = self._camera_in_body @ ego.motion.rotation @ self._camera_in_body.T
        visual_rad = math.atan2(in_body[1, 0], in_body[0, 0])
        distance_m, odometry_rad = _increment(before, after)
        ahead_m = float(self._camera_in_body[0] @ ego.motion.translation_m)
        disputed = ego.source == "disputed"
        told, visual = FrameMotion(distance_m, odometry_rad), FrameMotion(ahead_m, visual_rad)
        self._contradiction.add(told, visual, disputed=disputed)
        if disputed:
            return
        weight = 1.0 / ego.sigma_rotation_rad**2
        self._sum_odometry_visual += weight * odometry_rad * visual_rad
        self._sum_odometry_odometry += weight * odometry_rad**2
        self._reckon_anew()

    def _remember(self, distance_m: float, turn_rad: float) -> None:
        leg_m, leg_rad = self._legs[-1]
        self._legs[-1] = (leg_m + distance_m, leg_rad + turn_rad)
        if abs(leg_m) > LEG_M or abs(leg_rad) > LEG_RAD:
            self._legs.append((0.0, 0.0))
        if len(self._legs) > MOST_LEGS:
            distance_m, turn_rad = self._legs.pop(0)
            self._settled = _move(self._settled, distance_m, turn_rad * self.yaw_ratio)

    def _reckon_anew(self) -> None:
        """The pose from the settled one over all legs, each turned by the present ratio."""
        legs = np.array(self._legs)
        turns = self.yaw_ratio * legs[:, 1]
        ends = self._settled.heading_rad + np.cumsum(turns)
        middles = ends - 0.5 * turns
        self._pose = PlanarPose(
            self._settled.x_m + float(legs[:, 0] @ np.cos(middles)),
            self._settled.y_m + float(legs[:, 0] @ np.sin(middles)),
            wrap_angle_rad(float(ends[-1])),
        )

    def body_pose(self, stamp_ns: int) -> PlanarPose | None:
        """The body in the path's frame at stamp_ns, as known now."""
        return self._fused.at(stamp_ns)

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """The camera by dead reckoning alone (hal.api.OdometrySource): the prior of ego-motion.

        Not the fused pose: perception must not hear its own measurements again as odometry.
        """
        odometry = self._odometry.at(stamp_ns)
        return None if odometry is None else camera_in_floor(odometry, self._mount)


def _increment(before: PlanarPose, after: PlanarPose) -> tuple[float, float]:
    """Distance driven (negative: backwards) and turn between two poses."""
    step = body_in_floor(before).inverse() @ body_in_floor(after)
    ahead_m, aside_m = float(step.translation_m[0]), float(step.translation_m[1])
    turn_rad = wrap_angle_rad(after.heading_rad - before.heading_rad)
    return math.copysign(math.hypot(ahead_m, aside_m), ahead_m), turn_rad


def _move(pose: PlanarPose, distance_m: float, turn_rad: float) -> PlanarPose:
    """pose after a short leg, driven in the direction of its middle."""
    middle_rad = pose.heading_rad + 0.5 * turn_rad
    return PlanarPose(
        pose.x_m + distance_m * math.cos(middle_rad),
        pose.y_m + distance_m * math.sin(middle_rad),
        wrap_angle_rad(pose.heading_rad + turn_rad),
    )
