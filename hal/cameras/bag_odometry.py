"""Turns the nav_msgs Odometry of a base, and the mount of its camera, into poses of the camera."""

from __future__ import annotations

import numpy as np

from hal.cameras.bag_exposures import header_ns
from hal.cameras.bag_file import BagFile
from hal.cameras.bag_transforms import StaticTransforms, frame_name
from hal.cameras.pose_track import PoseTrack, quaternion_of, rotation_matrix
from hal.errors import BadRecording
from hal.types import FloatArray

_UNIT_TOLERANCE = 0.01


def read_odometry(bag: BagFile, topic: str, camera: str, transforms: StaticTransforms) -> PoseTrack:
    """The poses of the frame camera. Raises BadRecording if a pose is invalid or no transform leads to the
    frame."""
    rows: dict[int, FloatArray] = {}
    base = None
    for _, message in bag.messages((topic,)):
        base = base or frame_name(message.child_frame_id) or "base_link"
        position, q = message.pose.pose.position, message.pose.pose.orientation
        values = np.array([position.x, position.y, position.z, q.x, q.y, q.z, q.w])
        length = float(np.linalg.norm(values[3:]))
        if not (np.isfinite(values).all() and abs(length - 1.0) <= _UNIT_TOLERANCE):
            raise BadRecording(
                f"{bag.path}: {topic}: pose {len(rows) + 1} is none; replay it with --odometry none"
            )
        values[3:] /= length
        rows.setdefault(header_ns(message), values)
    mount = None if base is None else transforms.find(base, camera)
    if mount is None:
        raise BadRecording(
            f"{bag.path}: {topic}: where {camera} sits on {base or 'the base'} was not recorded in "
            "/tf_static; record it, or replay with --odometry none"
        )
    stamps_ns = sorted(rows)
    poses = np.stack([rows[stamp] for stamp in stamps_ns])
    # The camera is fixed to the base, so its rotation is that of the base times a constant rotation on the
    # right.
    positions = np.stack([rotation_matrix(pose[3:]) @ mount.translation_m + pose[:3] for pose in poses])
    return PoseTrack(
        topic, stamps_ns, positions, _quaternion_products(poses[:, 3:], quaternion_of(mount.rotation))
    )


def _quaternion_products(left: FloatArray, right: FloatArray) -> FloatArray:
    """The Hamilton products (N, 4) of quaternions (N, 4) and (4,), each qx qy qz qw."""
    x, y, z, w = left.T
    a, b, c, d = right
    return np.stack(
        (
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ),
        axis=1,
    )
