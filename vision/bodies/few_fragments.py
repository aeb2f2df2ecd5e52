"""Bodies with too few fragments to measure their motion: the next frame looks at them more closely.

vision/tracker.py calls it last in each frame. In the next one vision/fragments/attention.py searches the
image around one of these bodies. Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from hal.types import FloatArray, Pose
from vision.bodies.births import MIN_CELLS
from vision.bodies.sizes import SAME_BODY_M, SAME_BODY_SIGMAS
from vision.bodies.tracks import Tracks
from vision.depth.depth_noise import depth_sigma_of
from vision.detection import Detection
from vision.fragments.attention import NeedsFragments

_FEW_FRAGMENTS = 4  # fewer are too few: a verdict along the line of sight takes 8 ends (proof.py)
_ENOUGH_OF_A_MOVER = 2  # enough to follow a mover, together with its surface
_REACH_M = 9.0  # maximum distance: the depth mask's 10 m less about the noise of depth there
_URGENT_SIGHTINGS = 45  # bodies seen in fewer frames, and suspects, are urgent
# The gate on depth around the centre of a body also has half of its measured extent in depth, which counts up
# to this: more is noise or a wall.
_DEEPEST_M = 1.0


def bodies_needing_fragments(tracks: Tracks, detection: Detection, noise: DepthNoise) -> NeedsFragments:
    """The tracks seen in this frame that have too few fragments."""
    chosen, depth_m, gate_m, urgent = _needing_fragments(tracks, detection.captured_ns, detection.pose, noise)
    return NeedsFragments(tracks.ids[chosen], tracks.bbox_px[chosen], depth_m, gate_m, urgent)


@compiled(Tracks, "int64", Pose, DepthNoise)
def _needing_fragments(
    tracks: Tracks, now_ns: int, camera: Pose, noise: DepthNoise
) -> tuple[NDArray[np.intp], FloatArray, FloatArray, NDArray[np.bool_]]:
    """Indices of the tracks that need fragments, and their depth_m, gate_m and urgent."""
    size = len(tracks.state)
    chosen, depth_m, gate_m = np.empty(size, np.intp), np.empty(size), np.empty(size)
    urgent, count = np.empty(size, np.bool_), 0
    for n in range(size):
        few = tracks.fragments[n] < (_ENOUGH_OF_A_MOVER if tracks.moving[n] else _FEW_FRAGMENTS)
        if not few or tracks.seen_ns[n] != now_ns or tracks.cells[n] < MIN_CELLS:
            continue
        x = tracks.state[n, 0] - camera.translation_m[0]
        y = tracks.state[n, 1] - camera.translation_m[1]
        z = tracks.state[n, 2] - camera.translation_m[2]
        if not x * x + y * y + z * z <= _REACH_M**2:
            continue
        depth = max(x * camera.rotation[0, 2] + y * camera.rotation[1, 2] + z * camera.rotation[2, 2], 0.0)
        gate = SAME_BODY_M + SAME_BODY_SIGMAS * depth_sigma_of(depth, noise)
        gate += 0.5 * np.minimum(tracks.extent_m[n, 2], _DEEPEST_M)
        chosen[count], depth_m[count], gate_m[count] = n, depth, gate
        urgent[count] = tracks.evidence[n] > 0.0 or tracks.sightings[n] < _URGENT_SIGHTINGS
        count += 1
    return chosen[:count], depth_m[:count], gate_m[:count], urgent[:count]
