"""Where the ends of fragments are expected in the next image, by what is known of them before it is read.

The optical flow search starts there (vision/fragments/optical_flow.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray, Intrinsics, Pose
from vision.camera.lens import MIN_AHEAD_M
from vision.fragments.store import FragmentStore
from vision.numerics.pose_axes import inner_vector
from vision.scene import Fragments

_UNKNOWN_M = 5.0  # assumed where depth is missing


def known_motion(ids: NDArray[np.int64], previous: Fragments | None) -> tuple[NDArray[np.bool_], FloatArray]:
    """Which fragments tracking reported as moving in the frame before, (N,), and their velocity, (N, 3).

    ids (N,): in ascending order. The velocity is over ground, in the camera's axes, and 0 where not moving.
    """
    if previous is None:
        return np.zeros(len(ids), np.bool_), np.zeros((len(ids), 3))
    return _known_motion(
        ids,
        np.ascontiguousarray(previous.ids),
        np.ascontiguousarray(previous.moving),
        np.ascontiguousarray(previous.velocity_mps),
    )


def expected_px(
    store: FragmentStore, velocity_mps: FloatArray, motion: Pose, dt_s: float, camera: Intrinsics
) -> NDArray[np.float32]:
    """(2N, 2) pixels where the ends in store will be seen dt_s later, after motion of the camera.

    velocity_mps (N, 3): of the fragments over ground, in the camera's axes of the frame before.
    """
    return _expected_px(store.ends_px, store.near_m, velocity_mps * dt_s, motion, camera)


@compiled("int64[::1], int64[::1], bool[::1], float64[:, ::1]")
def _known_motion(
    ids: NDArray[np.int64],
    known: NDArray[np.int64],
    moved: NDArray[np.bool_],
    velocity_mps: FloatArray,
) -> tuple[NDArray[np.bool_], FloatArray]:
    """As known_motion. ids (N,) and known (M,): both in ascending order."""
    moving, result = np.zeros(len(ids), np.bool_), np.zeros((len(ids), 3))
    place = 0
    for k in range(len(ids)):
        while place < len(known) and known[place] < ids[k]:
            place += 1
        if place == len(known):
            break
        if known[place] != ids[k] or not moved[place]:
            continue
        moving[k] = True
        for i in range(3):
            if not np.isnan(velocity_mps[place, i]):
                result[k, i] = velocity_mps[place, i]
    return moving, result


@compiled("float32[:, :, :], float32[:, :], float64[:, :]", Pose, Intrinsics)
def _expected_px(
    ends_px: NDArray[np.float32],
    near_m: NDArray[np.float32],
    displacement_m: FloatArray,
    motion: Pose,
    camera: Intrinsics,
) -> NDArray[np.float32]:
    """As expected_px. displacement_m (N, 3): of the fragments; motion: of the camera."""
    result = np.empty((2 * len(ends_px), 2), np.float32)
    point = np.empty(3)
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    for k in range(2 * len(ends_px)):
        fragment, end = k // 2, k % 2
        measured_m = near_m[fragment, end]
        depth_m = _UNKNOWN_M if np.isnan(measured_m) else np.float64(measured_m)
        # As rays in vision/camera/lens.py, in single precision.
        point[0] = depth_m * ((ends_px[fragment, end, 0] - np.float32(cx)) / np.float32(fx))
        point[1] = depth_m * ((ends_px[fragment, end, 1] - np.float32(cy)) / np.float32(fy))
        point[2] = depth_m
        for i in range(3):
            point[i] = point[i] - motion.translation_m[i] + displacement_m[fragment, i]
        x, y, z = inner_vector(motion, point)
        inverse = 1.0 / max(z, MIN_AHEAD_M)
        result[k, 0], result[k, 1] = x * inverse * fx + cx, y * inverse * fy + cy
    return result
