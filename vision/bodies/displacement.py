"""Whether a body has left the place where it was first seen whole, across the line of sight.

Far bodies have few fragments or none, and depth noise makes the area of their surface change from frame to
frame, so neither fragments nor an unbroken measurement of the centre prove that they move. But something
static stays where it is: whatever part of it is visible, it cannot lie beside its own former place. That
needs both of its sides to be visible, at the beginning and now; what happens in between does not matter.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import FloatArray
from vision.bodies.tracks import Tracks
from vision.depth.regions import Regions
from vision.detection import Detection
from vision.motion.motion_evidence import MotionEvidence

_BESIDE_M = 0.3  # beyond its own width: the centre of a part is no better known far away
_RENEWED_S = 1.5  # after this time the place is taken anew: errors of ego-motion add up
# Displacement over that by the velocity of the surface: at another ratio the track jumped to something else.
_MIN_PACE, _MAX_PACE = 0.5, 2.0
_DENYING_ENDS = 4  # two fragments
_LARGEST_M = 2.2  # a tall person; of larger things only a part is visible, and its centre wanders


def update(
    tracks: Tracks, centre_m: FloatArray, visible: NDArray[np.bool_], measured: Regions, detection: Detection
) -> None:
    """Update origin_m to displaced of tracks with centres (T, 3) in the fixed frame.

    visible (T,): tracks of which a surface was measured in this frame.
    """
    sides_free = visible & measured.sides_visible & ~measured.overlapped & detection.motion_known
    tracks.origin_m, tracks.origin_width_m, tracks.origin_ns, tracks.displaced = _displaced(
        sides_free,
        centre_m,
        measured.extent_m,
        tracks.surface_state,
        tracks.origin_m,
        tracks.origin_width_m,
        tracks.origin_ns,
        tracks.displaced,
        detection.captured_ns,
        detection.pose.rotation,
        detection.pose.translation_m,
    )


def proves(
    seen: MotionEvidence,
    across: FloatArray,
    frame_across: FloatArray,
    least_mps: FloatArray,
    settings: MotionSettings,
) -> NDArray[np.bool_]:
    """(T,) whether the displacement, with a velocity of the surface that is clear by itself, proves motion.

    across, frame_across (T,): squared sigmas of the velocity across the line of sight, of the surface and of
    this frame's fragments. least_mps (T,): slower than this counts as static. Fragments that agree on no
    motion overrule it: a part of clutter came into view while another one went.
    """
    threshold = settings.sigmas**2
    denied = (seen.ends * seen.agreement >= _DENYING_ENDS) & (frame_across < 0.5 * threshold)
    speed_mps = np.linalg.norm(seen.surface_velocity, axis=1)
    clear = (across > threshold) & (speed_mps > least_mps) & ~denied
    result: NDArray[np.bool_] = seen.displaced & clear & (seen.size_m <= _LARGEST_M) & seen.trusted
    return result


@compiled(
    "boolean[:], float64[:, :], float64[:, :], float64[:, ::1], float64[:, ::1], float64[:], int64[:],"
    "boolean[:], int64, float64[:, :], float64[:]"
)
def _displaced(
    sides_free: NDArray[np.bool_],
    centre_m: FloatArray,
    extent_m: FloatArray,
    state: FloatArray,
    origin_m: FloatArray,
    origin_width_m: FloatArray,
    origin_ns: NDArray[np.int64],
    displaced: NDArray[np.bool_],
    now_ns: int,
    rotation: FloatArray,
    camera_m: FloatArray,
) -> tuple[FloatArray, FloatArray, NDArray[np.int64], NDArray[np.bool_]]:
    """origin_m, origin_width_m, origin_ns and displaced of Tracks after a frame.

    state (T, 6): position and velocity by the surface. rotation, camera_m: pose of the camera; up and down in
    its image does not count, where parts come into view and go. A track whose sides are not free keeps its
    entries.
    """
    places_m, widths_m, since_ns = origin_m.copy(), origin_width_m.copy(), origin_ns.copy()
    left = displaced.copy()
    for t in range(len(sides_free)):
        if not sides_free[t]:
            continue
        left[t] = False
        if since_ns[t] > 0:
            elapsed_s = (now_ns - since_ns[t]) / NS_PER_S
            x_m, z_m, moved_x, moved_z, speed_x, speed_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(3):
                ahead_m, moved_m = centre_m[t, i] - camera_m[i], centre_m[t, i] - places_m[t, i]
                x_m, z_m = x_m + rotation[i, 0] * ahead_m, z_m + rotation[i, 2] * ahead_m
                moved_x, moved_z = moved_x + rotation[i, 0] * moved_m, moved_z + rotation[i, 2] * moved_m
                speed_x += rotation[i, 0] * state[t, 3 + i]
                speed_z += rotation[i, 2] * state[t, 3 + i]
            range_m = max(math.hypot(x_m, z_m), 0.1)
            across_m = (moved_x * z_m - moved_z * x_m) / range_m
            going_m = elapsed_s * (speed_x * z_m - speed_z * x_m) / range_m
            beside = abs(across_m) > 0.5 * (widths_m[t] + extent_m[t, 0]) + _BESIDE_M
            pace = across_m / going_m if going_m != 0.0 else 0.0
            left[t] = beside and _MIN_PACE < pace < _MAX_PACE
            if elapsed_s < _RENEWED_S:
                continue
        places_m[t], widths_m[t], since_ns[t] = centre_m[t], extent_m[t, 0], now_ns
    return places_m, widths_m, since_ns, left
