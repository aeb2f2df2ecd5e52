"""From a mask of moving pixels to detections with track ids. Shared by all baselines that give a mask.

Images are at half resolution. The mask is cleaned by morphology and cut at depth jumps. Every connected
component within 10 m of at least 400 pixels of the full image is a blob. A blob is called moving from its
second frame on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.evaluation.assignment import assign
from controller.evaluation.types import CALLED_MOVING, Box, DetectedObject, MethodOutput, unknown_vector
from hal.types import FloatArray, Intrinsics, RgbdFrame

Mask = NDArray[np.uint8]
HalfDepth = NDArray[np.float32]

SCALE = 2
MAX_DEPTH_M = 10.0
_MIN_PIXELS = 400 // SCALE**2
_MIN_KNOWN = 0.3  # least share of a component's pixels that have depth
# Least difference of neighbouring depths that is a jump: a constant, and a part with the square of the depth.
_JUMP_M = 0.3
_JUMP_PER_M2 = 0.03
_GATE_M = 0.6  # greatest distance between a blob and its track
_FORGET_FRAMES = 8  # a track unseen for more frames is dropped
_CONFIRM_FRAMES = 2  # frames from which a blob is called moving
_OPEN = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
_CLOSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))


def half_grey(frame: RgbdFrame) -> Mask:
    """The colour image in grey at half size; each pixel is the mean of four."""
    grey = cv2.cvtColor(frame.colour, cv2.COLOR_BGR2GRAY)
    small = cv2.resize(grey, None, fx=1.0 / SCALE, fy=1.0 / SCALE, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def half_depth_m(frame: RgbdFrame) -> HalfDepth:
    """Depth at half size, 0 where there is no data or it is beyond MAX_DEPTH_M."""
    depth_m = frame.depth[::SCALE, ::SCALE].astype(np.float32) * np.float32(frame.depth_scale_m)
    depth_m[depth_m > MAX_DEPTH_M] = 0.0
    return depth_m


def half_intrinsics(k: Intrinsics) -> Intrinsics:
    """Intrinsics of the half-size images."""
    shift = 0.5 * (SCALE - 1)
    return Intrinsics(
        k.width // SCALE,
        k.height // SCALE,
        k.fx / SCALE,
        k.fy / SCALE,
        (k.cx - shift) / SCALE,
        (k.cy - shift) / SCALE,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Blob:
    """A connected component of a mask. box: in pixels of the full image. level: mean of the mask, 0..1."""

    box: Box
    position_m: FloatArray
    extent_m: FloatArray
    level: float


def blobs(mask: Mask, depth_m: HalfDepth, k: Intrinsics) -> list[Blob]:
    """The blobs in a mask.

    mask: (H / 2, W / 2) confidence that a pixel moves, 0..255.
    k: intrinsics of the half-size image.
    """
    clean = cv2.morphologyEx(mask, cv2.MORPH_OPEN, _OPEN)
    clean = cv2.morphologyEx(clean, cv2.MORPH_CLOSE, _CLOSE)
    solid = ((clean > 0) & ~depth_jumps(depth_m)).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(solid, connectivity=8)
    found = []
    for label in range(1, count):
        left, top, width, height, area = (int(value) for value in stats[label])
        if area < _MIN_PIXELS:
            continue
        inside = labels[top : top + height, left : left + width] == label
        z_m = depth_m[top : top + height, left : left + width][inside]
        known = z_m > 0.0
        if np.count_nonzero(known) < _MIN_KNOWN * area:
            continue
        level = float(clean[top : top + height, left : left + width][inside].mean()) / 255.0
        found.append(_blob(inside, left, top, z_m, known, k, level))
    return found


def depth_jumps(depth_m: HalfDepth) -> NDArray[np.bool_]:
    """(H, W) pixels whose depth differs from that of the right or lower neighbour by a jump."""
    allowed = _JUMP_M + _JUMP_PER_M2 * np.square(depth_m)
    jumps = np.zeros(depth_m.shape, np.bool_)
    for axis in (0, 1):
        step = np.abs(np.diff(depth_m, axis=axis))
        values = depth_m[:-1] if axis == 0 else depth_m[:, :-1]
        neighbours = depth_m[1:] if axis == 0 else depth_m[:, 1:]
        limit = allowed[:-1] if axis == 0 else allowed[:, :-1]
        cut = (step > limit) & (values > 0.0) & (neighbours > 0.0)
        if axis == 0:
            jumps[:-1] |= cut
        else:
            jumps[:, :-1] |= cut
    return jumps


def _blob(
    inside: NDArray[np.bool_],
    left: int,
    top: int,
    z_m: NDArray[np.float32],
    known: NDArray[np.bool_],
    k: Intrinsics,
    level: float,
) -> Blob:
    v, u = np.nonzero(inside)
    middle_m = float(np.median(z_m[known]))
    close = known & (np.abs(z_m - middle_m) <= 0.5)
    z = z_m[close].astype(np.float64)
    x = (u[close] + left - k.cx) / k.fx * z
    y = (v[close] + top - k.cy) / k.fy * z
    points = np.stack([x, y, z], axis=1)
    box = tuple(float(SCALE * edge) for edge in (left, top, left + inside.shape[1], top + inside.shape[0]))
    return Blob((box[0], box[1], box[2], box[3]), points.mean(axis=0), np.ptp(points, axis=0), level)


@dataclass(slots=True)
class _Track:
    id: int
    position_m: FloatArray
    frames: int
    unseen: int


class IdTracker:
    """Gives each blob the id of the nearest track within a gate, or a new id."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._next_id = 0

    def answer(self, found: Sequence[Blob], mask: Mask | None) -> MethodOutput:
        """The detections of this frame, with ids."""
        distance_m = np.array(
            [
                [float(np.linalg.norm(blob.position_m - track.position_m)) for track in self._tracks]
                for blob in found
            ]
        ).reshape(len(found), len(self._tracks))
        track_of_blob = dict(assign(np.where(distance_m <= _GATE_M, distance_m, np.inf)))
        for track in self._tracks:
            track.unseen += 1
        detections = []
        for index, blob in enumerate(found):
            track = self._tracks[track_of_blob[index]] if index in track_of_blob else self._start_track()
            track.position_m, track.frames, track.unseen = blob.position_m, track.frames + 1, 0
            span = 1.0 - CALLED_MOVING
            confirmed = track.frames >= _CONFIRM_FRAMES
            confidence = CALLED_MOVING + span * blob.level if confirmed else 0.99 * CALLED_MOVING * blob.level
            detections.append(
                DetectedObject(
                    track.id, blob.box, blob.position_m, unknown_vector(), blob.extent_m, confidence
                )
            )
        self._tracks = [track for track in self._tracks if track.unseen <= _FORGET_FRAMES]
        return MethodOutput(tuple(detections), mask)

    def _start_track(self) -> _Track:
        self._tracks.append(_Track(self._next_id, np.zeros(3), 0, 0))
        self._next_id += 1
        return self._tracks[-1]
