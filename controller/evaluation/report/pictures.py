"""The report's pictures with camera images: Fig. 6 (scene, depth, result), and frames with errors."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.evaluation.report.chart import BLUE, GREEN, INK, ORANGE, SOFT_INK, blank
from controller.evaluation.run_sequence import Snapshot
from controller.evaluation.scores.scoring import FrameScore
from controller.evaluation.types import CALLED_MOVING, Box, DetectedObject
from controller.video import draw, text
from controller.video.depth_view import colour_table
from controller.video.labels import Label, draw_labels
from controller.video.style import MOVING, STATIC, Colour, Image, bgr
from hal.types import ColourImage, FloatArray
from vision.scene import Fragments

_MISSED = bgr("E02424")
_FOUND = GREEN
_DETECTED = ORANGE
_NOT_JUDGED = BLUE  # a true object that need not be found: new, slow, small, occluded or far
_DEPTH_RANGE_M = 10.0
_GAP, _HEADER_PX = 12, 40
_CELL = (480, 360)
_BRIGHTNESS = 0.8


def scene_depth_result(snapshots: Sequence[Snapshot]) -> Image:
    """Fig. 6: one row a snapshot, with colour image, depth and result."""
    width, height = _CELL
    image = blank(3 * width + 4 * _GAP, _HEADER_PX + len(snapshots) * (height + _GAP))
    for column, title in enumerate(("Scene", "Depth: near is bright, black is none", "Result")):
        text.put(image, title, _GAP + column * (width + _GAP), 27, INK, 19, text.BOLD)
    for row, snapshot in enumerate(snapshots):
        cells = (snapshot.colour, depth_picture(snapshot.depth_m), result_picture(snapshot))
        for column, cell in enumerate(cells):
            x, y = _GAP + column * (width + _GAP), _HEADER_PX + row * (height + _GAP)
            image[y : y + height, x : x + width] = cv2.resize(
                cell, (width, height), interpolation=cv2.INTER_AREA
            )
    return image


def depth_picture(depth_m: NDArray[np.float32]) -> Image:
    """Depth as an image: near is bright, far is dark, no data is black."""
    levels = cv2.convertScaleAbs(depth_m, alpha=255.0 / _DEPTH_RANGE_M)
    return np.asarray(colour_table()[levels], np.uint8)


def result_picture(snapshot: Snapshot) -> Image:
    """Fragments and obstacles over the darkened image; only moving ones have a label."""
    image = np.asarray(cv2.convertScaleAbs(snapshot.colour, alpha=_BRIGHTNESS), np.uint8)
    if snapshot.fragments is not None:
        _draw_fragments(image, snapshot.fragments)
    boxed = [detection for detection in snapshot.detections if _has_box(detection.box)]
    moving = [detection for detection in boxed if detection.confidence >= CALLED_MOVING]
    for detection in boxed:
        if detection.confidence < CALLED_MOVING:
            draw.line(image, draw.box(detection.box), STATIC, 2, closed=True)
    for detection in moving:
        draw.line(image, draw.box(detection.box), MOVING, 3, closed=True)
    draw_labels(image, [_label(detection, MOVING) for detection in moving], size=17)
    return image


def failure_picture(snapshot: Snapshot) -> Image:
    """A frame with true objects and detections drawn in, and a caption that names the errors."""
    image = snapshot.colour.copy()
    labels = []
    for true in snapshot.truth.objects:
        if _has_box(true.box):
            colour = _colour_of(true.id, snapshot.score)
            draw.dashed(image, _closed_outline(true.box), colour, 2, 7.0)
            words = f"{true.kind} {true.distance_m:.1f} m, {true.speed_mps:.1f} m/s"
            labels.append(_box_label(words, true.box, colour))
    for detection in snapshot.detections:
        if detection.confidence >= CALLED_MOVING and _has_box(detection.box):
            draw.line(image, draw.box(detection.box), _DETECTED, 2, closed=True)
            labels.append(_label(detection, _DETECTED))
    draw_labels(image, labels, size=14)
    return _with_caption(image, f"{snapshot.sequence}, frame {snapshot.index}", describe_errors(snapshot))


def _colour_of(identity: int, score: FrameScore) -> Colour:
    if identity in score.missed_settled:
        return _MISSED
    return _FOUND if any(hit.object_id == identity for hit in score.hits) else _NOT_JUDGED


def describe_errors(snapshot: Snapshot) -> str:
    """The errors in the frame, in words."""
    by_id = {true.id: true for true in snapshot.truth.objects}
    parts = [
        f"missed: {by_id[object_id].kind} at {by_id[object_id].distance_m:.1f} m"
        for object_id in snapshot.score.missed_settled
    ]
    parts.extend(f"false: #{track_id}" for track_id in snapshot.score.wrong)
    parts.extend(f"second box for one object: #{track_id}" for track_id in snapshot.score.duplicates)
    return "; ".join(parts)


def _with_caption(image: ColourImage, title: str, words: str) -> Image:
    height, width = image.shape[:2]
    picture = blank(width, height + 82)
    picture[:height] = image
    text.put(picture, title, 10, height + 23, INK, 16, text.BOLD)
    text.put(picture, text.fit(words, width - 20, 15), 10, height + 46, SOFT_INK, 15)
    x = -8
    for meaning, colour in _COLOUR_KEY:
        picture[height + 58 : height + 70, x + 18 : x + 30] = colour
        x = text.put(picture, meaning, x + 36, height + 69, SOFT_INK, 14)
    return picture


_COLOUR_KEY = (
    ("true, found", _FOUND),
    ("true, missed", _MISSED),
    ("true, not judged", _NOT_JUDGED),
    ("called moving", _DETECTED),
)


def _draw_fragments(image: Image, fragments: Fragments) -> None:
    ends = fragments.ends_px
    draw.lines(image, ends[~fragments.moving], STATIC, 2)
    draw.lines(image, ends[fragments.moving], MOVING, 3)


def _label(detection: DetectedObject, colour: Colour) -> Label:
    speed_mps = float(np.linalg.norm(detection.velocity_mps))
    words = f"#{detection.id}  {speed_mps:.1f} m/s" if np.isfinite(speed_mps) else f"#{detection.id}"
    return _box_label(words, detection.box, colour)


def _box_label(words: str, box: Box, colour: Colour) -> Label:
    return Label(words, colour, np.reshape(np.array(box), (2, 2)), filled=colour not in (BLUE, GREEN))


def _has_box(box: Box) -> bool:
    return bool(np.isfinite(box).all())


def _closed_outline(box: Box) -> FloatArray:
    corners = draw.box(box)
    return np.concatenate([corners, corners[:1]])
