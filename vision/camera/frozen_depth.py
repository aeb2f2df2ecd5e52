"""Depth that stands still, bit for bit, while the camera or what it sees moves on.

Noise alone would do for a real sensor: its depth never repeats. Images without noise may, for as long as
nothing moves, and do no harm then. So what is asked for is motion that depth should have shown: by odometry,
or by colour, since the first frame with this depth, so that slow motion adds up.
"""

from __future__ import annotations

import numpy as np

from hal.compiled import compiled
from hal.types import DepthImage, Pose
from vision.fragments.edges import GreyImage

_STEP = 16  # pixels between two samples, as in vision/camera/health.py
_REPETITIONS = 3  # in a row: depth at a third of colour's rate repeats twice
_CHANGED_LEVEL = 12  # grey: four sigmas of a sensor's noise in good light; in the dark noise may do, too
_CHANGED_SHARE = 0.01  # of the samples: a person 8 m away covers some 3 %
_MOVED_M = 0.01
_TURNED_RAD = 0.005


class FrozenDepth:
    """Looks at each frame once; keeps the first one of those whose depth is the same."""

    def __init__(self) -> None:
        self._depth: DepthImage = np.empty((0, 0), np.uint16)
        self._grey: GreyImage = np.empty((0, 0), np.uint8)
        self._odometry: Pose | None = None
        self._repetitions, self._moved = 0, False

    def step(self, depth: DepthImage, grey: GreyImage, odometry: Pose | None, repeated: bool) -> int:
        """For how many frames depth has stood still although it should not have; 0: it has not.

        depth, grey (H, W); odometry: of the camera, None where not known. repeated: colour is that of the
        frame before, too, which says nothing of depth alone.
        """
        # Hardly any gets past the comparison of samples.
        if not (_alike(depth, self._depth) and bool((depth == self._depth).all())):
            self._depth, self._grey, self._odometry = depth, grey, odometry
            self._repetitions, self._moved = 0, False
            return 0
        if not repeated:
            self._repetitions += 1
            self._moved = (
                self._moved
                or _changed(grey, self._grey) >= _CHANGED_SHARE
                or _has_moved(self._odometry, odometry)
            )
        return self._repetitions if self._moved and self._repetitions >= _REPETITIONS else 0


def _has_moved(before: Pose | None, now: Pose | None) -> bool:
    if before is None or now is None:
        return False
    step = before.inverse() @ now
    # Of a small turn, the root of the squared differences from no turn at all is its angle times root 2.
    turn_rad = np.linalg.norm(step.rotation - np.eye(3)) / np.sqrt(2.0)
    return bool(np.linalg.norm(step.translation_m) > _MOVED_M or turn_rad > _TURNED_RAD)


@compiled("uint16[:, :], uint16[:, :]")
def _alike(depth: DepthImage, before: DepthImage) -> bool:
    """Whether the samples of a depth image are those of the one before; of another size it is not."""
    height, width = depth.shape
    if depth.shape != before.shape:
        return False
    for i in range(_STEP // 2, height, _STEP):
        for j in range(_STEP // 2, width, _STEP):
            if depth[i, j] != before[i, j]:
                return False
    return True


@compiled("uint8[:, :], uint8[:, :]")
def _changed(grey: GreyImage, before: GreyImage) -> float:
    """Which share of the samples differs by more than noise; of an image of another size, all of it."""
    height, width = grey.shape
    if grey.shape != before.shape:
        return 1.0
    changed, size = 0, 0
    for i in range(_STEP // 2, height, _STEP):
        for j in range(_STEP // 2, width, _STEP):
            size += 1
            one, other = grey[i, j], before[i, j]  # of bytes, the compiler's differences do not go below 0
            changed += max(one, other) - min(one, other) > _CHANGED_LEVEL
    return changed / max(size, 1)
