"""Runs all methods on one sequence. Each frame is rendered once, given to every method, and dropped."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from controller.evaluation.methods.ours import Treadwatch
from controller.evaluation.methods.timed_methods import (
    OURS,
    CameraMethod,
    Stopwatch,
    TimedMethod,
    build_methods,
)
from controller.evaluation.scores.endpoint_error import EndpointErrors, endpoint_errors
from controller.evaluation.scores.pixels import STEP_PX, claimed_levels, count_pixels
from controller.evaluation.scores.scoring import FrameScore, score
from controller.evaluation.scores.totals import PixelCounts
from controller.evaluation.simulated_set.eligibility import MOVING_MPS, OBJECT_REST_MPS
from controller.evaluation.simulated_set.sequences import Sequence
from controller.evaluation.simulated_set.simulate import SimulatedFrame, build_world, simulate
from controller.evaluation.simulated_set.truth import FrameTruthBuilder
from controller.evaluation.types import DetectedObject, FrameDetections, FrameTruth, MethodOutput
from hal.types import ColourImage, RgbdFrame
from sim.rendering.camera import intrinsics_of
from vision.scene import Fragments

FAILURES_PER_SEQUENCE = 2
_JPEG = (cv2.IMWRITE_JPEG_QUALITY, 92)


@dataclass(frozen=True, slots=True, eq=False)
class MethodRecord:
    """What one method answered, frame by frame."""

    answers: tuple[FrameDetections, ...]
    pixels: PixelCounts


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """A frame to be shown in the report: its images, our detections, the truth, the score."""

    sequence: str
    index: int
    colour: ColourImage
    depth_m: NDArray[np.float32]
    truth: FrameTruth
    detections: tuple[DetectedObject, ...]
    fragments: Fragments | None
    score: FrameScore


@dataclass(frozen=True, slots=True, eq=False)
class SequenceRecord:
    """The results of one sequence. failures: our detector's worst frames. shown: the frames asked for."""

    name: str
    split: str
    truths: tuple[FrameTruth, ...]
    methods: dict[str, MethodRecord]
    endpoint: EndpointErrors
    failures: tuple[Snapshot, ...]
    shown: tuple[Snapshot, ...]


def run_sequence(
    sequence: Sequence,
    methods: tuple[str, ...],
    show_frames: tuple[int, ...],
    stopwatch_ns: Stopwatch,
) -> SequenceRecord:
    """Run the named methods. show_frames: indices of frames to keep for pictures."""
    world = build_world(sequence)
    intrinsics = intrinsics_of(sequence.camera())
    truth_builder = FrameTruthBuilder(world, intrinsics)
    timed_methods = build_methods(methods, sequence, intrinsics, stopwatch_ns)
    recorder = _Recorder(sequence, methods, show_frames)
    for index, simulated in enumerate(simulate(sequence, truth_builder, world)):
        recorder.add(index, simulated, timed_methods)
    return recorder.result()


class _Recorder:
    """Collects the answers of all methods, frame by frame."""

    def __init__(self, sequence: Sequence, methods: tuple[str, ...], show_frames: tuple[int, ...]) -> None:
        self._sequence = sequence
        self._show_frames = show_frames
        self._truths: list[FrameTruth] = []
        self._answers: dict[str, list[FrameDetections]] = {name: [] for name in methods}
        self._pixels = {name: PixelCounts.none() for name in methods}
        self._endpoint = EndpointErrors.none()
        self._previous: tuple[SimulatedFrame, Fragments] | None = None
        self._jpegs: list[NDArray[np.uint8]] = []
        self._shown: dict[int, tuple[RgbdFrame, Fragments | None]] = {}

    def add(self, index: int, simulated: SimulatedFrame, timed_methods: dict[str, TimedMethod]) -> None:
        """Give one frame to all methods, and keep their answers."""
        self._truths.append(simulated.truth)
        for name, timed_method in timed_methods.items():
            answer, duration_ms = timed_method.answer(simulated)
            self._answers[name].append(
                FrameDetections(simulated.truth.stamp_s, answer.detections, duration_ms)
            )
            self._pixels[name] += self._count_pixels(simulated, answer)
        fragments = _fragments(timed_methods)
        self._measure_endpoints(simulated, fragments)
        if OURS in timed_methods:
            self._jpegs.append(np.asarray(cv2.imencode(".jpg", simulated.frame.colour, _JPEG)[1], np.uint8))
        if index in self._show_frames:
            self._shown[index] = (simulated.frame, fragments)

    def result(self) -> SequenceRecord:
        """The results, after the last frame has been added."""
        records = {
            name: MethodRecord(tuple(answers), self._pixels[name]) for name, answers in self._answers.items()
        }
        scores = score(self._truths, records[OURS].answers).frames if OURS in records else ()
        worst = sorted(range(len(scores)), key=lambda index: (-scores[index].error_count, index))
        failing = _spaced([index for index in worst if scores[index].error_count > 0])
        return SequenceRecord(
            name=self._sequence.name,
            split=self._sequence.split,
            truths=tuple(self._truths),
            methods=records,
            endpoint=self._endpoint,
            failures=tuple(self._snapshot(index, records, scores[index]) for index in failing),
            shown=tuple(self._snapshot(index, records, scores[index]) for index in self._shown if scores),
        )

    def _count_pixels(self, simulated: SimulatedFrame, answer: MethodOutput) -> PixelCounts:
        levels = claimed_levels(simulated.frame, answer.detections) if answer.mask is None else answer.mask
        judged_pixels = np.s_[::STEP_PX, ::STEP_PX]
        objects = simulated.truth.objects
        return count_pixels(
            levels,
            simulated.images.instances[judged_pixels],
            simulated.images.depth_m[judged_pixels],
            moving=[true_object.id for true_object in objects if true_object.speed_mps >= MOVING_MPS],
            excused=[
                true_object.id
                for true_object in objects
                if true_object.turning or OBJECT_REST_MPS <= true_object.speed_mps < MOVING_MPS
            ],
        )

    def _measure_endpoints(self, simulated: SimulatedFrame, fragments: Fragments | None) -> None:
        if not self._sequence.static or fragments is None:
            return
        if self._previous is not None:
            previous, known = self._previous
            motion = simulated.camera.inverse() @ previous.camera
            self._endpoint = self._endpoint + endpoint_errors(
                known, fragments, previous.images.depth_m, motion, simulated.frame.intrinsics
            )
        self._previous = (simulated, fragments)

    def _snapshot(self, index: int, records: dict[str, MethodRecord], frame_score: FrameScore) -> Snapshot:
        if index in self._shown:
            frame, fragments = self._shown[index]
            colour, depth_m = frame.colour, frame.depth.astype(np.float32) * np.float32(frame.depth_scale_m)
        else:
            colour, fragments = np.asarray(cv2.imdecode(self._jpegs[index], cv2.IMREAD_COLOR), np.uint8), None
            depth_m = np.empty((0, 0), np.float32)
        return Snapshot(
            sequence=self._sequence.name,
            index=index,
            colour=colour,
            depth_m=depth_m,
            truth=self._truths[index],
            detections=records[OURS].answers[index].detections,
            fragments=fragments,
            score=frame_score,
        )


def _fragments(timed_methods: dict[str, TimedMethod]) -> Fragments | None:
    timed_method = timed_methods.get(OURS)
    if isinstance(timed_method, CameraMethod) and isinstance(timed_method.method, Treadwatch):
        return timed_method.method.fragments
    return None


def _spaced(indices: list[int]) -> list[int]:
    """The first few that are at least ten frames apart; neighbouring frames show the same error."""
    chosen: list[int] = []
    for index in indices:
        if len(chosen) < FAILURES_PER_SEQUENCE and all(abs(index - other) >= 10 for other in chosen):
            chosen.append(index)
    return sorted(chosen)
