"""Rigid transforms between the floor, the body (x forward, y left, z up) and the camera (REP 103)."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from config.robot import Robot
from hal.types import CameraMount, FloatArray, PlanarPose, Pose

# Columns: the optical axes x right, y down, z forward, written in body axes.
_OPTICAL_IN_BODY: FloatArray = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def mount_of(robot: Robot) -> CameraMount:
    """Where the camera is mounted on a robot, by its configuration."""
    mount = robot.camera_mount
    return CameraMount(mount.forward_m, mount.left_m, mount.height_m, mount.pitch_rad)


@lru_cache(maxsize=16)
def camera_in_body(mount: CameraMount) -> Pose:
    """The pose of the optical frame in the body frame; a positive pitch looks down.

    The result is cached per mount: do not write to it.
    """
    c, s = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)
    tip_down = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return Pose(
        tip_down @ _OPTICAL_IN_BODY,
        np.array([mount.forward_m, mount.left_m, mount.height_m]),
    )


def body_in_floor(pose: PlanarPose) -> Pose:
    """The pose of the body frame in the frame of the planar pose; z = 0 is the floor."""
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return Pose(
        np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
        np.array([pose.x_m, pose.y_m, 0.0]),
    )


def planar(pose: Pose) -> PlanarPose:
    """The planar pose of a body at pose; the inverse of body_in_floor."""
    x_m, y_m, _ = pose.translation_m.tolist()
    return PlanarPose(x_m, y_m, math.atan2(pose.rotation[1, 0], pose.rotation[0, 0]))


def camera_in_floor(pose: PlanarPose, mount: CameraMount) -> Pose:
    """The pose of the optical frame in the floor's frame, for a body at pose."""
    return body_in_floor(pose) @ camera_in_body(mount)


def wrap_angle_rad(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def advance_pose(pose: PlanarPose, v_mps: float, w_radps: float, dt_s: float) -> PlanarPose:
    """The pose after dt_s of constant v and w, on the exact arc (also for w = 0)."""
    turn_rad = w_radps * dt_s
    half_rad = 0.5 * turn_rad
    chord_m = v_mps * dt_s * float(np.sinc(half_rad / math.pi))
    return PlanarPose(
        pose.x_m + chord_m * math.cos(pose.heading_rad + half_rad),
        pose.y_m + chord_m * math.sin(pose.heading_rad + half_rad),
        wrap_angle_rad(pose.heading_rad + turn_rad),
    )
