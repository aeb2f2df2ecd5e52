"""Runs our detector on recordings. It gives counts, times and pictures.

There is no truth about what moves in a recording, so there is no recall. If the user says that nothing but
the camera moves (--static), everything that is called moving is false.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from config.app import ReplayConfig
from config.camera import OdometryChoice
from controller.build import open_replay
from controller.errors import UserError
from controller.evaluation.methods.ours import detection_of
from controller.evaluation.run_sequence import Snapshot
from controller.evaluation.scores.scoring import WRONG_FRAMES, FrameScore
from controller.evaluation.scores.totals import ratio
from controller.evaluation.types import FrameTruth
from controller.perceive import Look
from controller.replay.build import build_replay_perceiver
from hal.cameras.recording import frames_of
from hal.clocks import NS_PER_S
from vision.scene import CameraCondition

MAX_PICTURES = 6
_MIN_PICTURE_SPACING = 5  # least distance of two pictures


@dataclass(frozen=True, slots=True, eq=False)
class RecordingRecord:
    """The result for one recording.

    name: see distinct_names.
    odometry: "file", "none" or "groundtruth", whichever was used.
    static: nothing but the camera moves, as the user says.
    frames, skipped: number of frames used, and of unusable ones.
    seconds: duration of the recording.
    objects: number of track ids.
    moving_objects: ids that were called moving in three frames or more.
    frames_with_moving: number of frames with something called moving.
    ms: per frame, detect and track together.
    conditions, ego_sources: number of frames by camera condition and by source of the ego-motion.
    pictures: the frame with most obstacles, then frames in which something was called moving.
    """

    folder: Path
    name: str
    odometry: str
    static: bool
    frames: int
    skipped: int
    seconds: float
    objects: int
    moving_objects: tuple[int, ...]
    frames_with_moving: int
    ms: tuple[float, ...]
    conditions: dict[str, int]
    ego_sources: dict[str, int]
    pictures: tuple[Snapshot, ...]

    @property
    def false_per_minute(self) -> float:
        """False moving objects per minute; NaN if it is not known what moves, or the recording is empty."""
        return ratio(len(self.moving_objects), self.seconds / 60.0) if self.static else math.nan


@dataclass
class _Tally:
    """Counts over the frames of one recording."""

    track_ids: set[int] = field(default_factory=set)
    moving: Counter[int] = field(default_factory=Counter)
    frames_with_moving: int = 0
    stamps_ns: list[int] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)
    conditions: Counter[CameraCondition] = field(default_factory=Counter)
    ego_sources: Counter[str] = field(default_factory=Counter)
    fullest: Snapshot | None = None
    moving_pictures: list[Snapshot] = field(default_factory=list)

    @property
    def pictures(self) -> tuple[Snapshot, ...]:
        """The frame with most obstacles, then those with something called moving, each once."""
        if self.fullest is None:
            return ()
        others = [one for one in self.moving_pictures if one.index != self.fullest.index]
        return (self.fullest, *others[: MAX_PICTURES - 1])

    def add(self, name: str, look: Look) -> None:
        """Count one frame."""
        moving = [obstacle.id for obstacle in look.scene.obstacles if obstacle.moving]
        self.track_ids.update(obstacle.id for obstacle in look.scene.obstacles)
        self.moving.update(moving)
        self.frames_with_moving += bool(moving)
        self.stamps_ns.append(look.scene.captured_ns)
        self.ms.append(sum(look.timing_ms.values()))
        self.conditions[look.scene.health.condition] += 1
        self.ego_sources[look.scene.ego_motion.source] += 1
        index = len(self.stamps_ns) - 1
        if self.fullest is None or len(look.scene.obstacles) > len(self.fullest.detections):
            self.fullest = _snapshot(name, index, look)
        pictures = self.moving_pictures
        is_due = not pictures or index - pictures[-1].index >= _MIN_PICTURE_SPACING
        if moving and is_due and len(pictures) < MAX_PICTURES:
            pictures.append(_snapshot(name, index, look))

    @property
    def seconds(self) -> float:
        """From the start of the first frame to the end of the last one."""
        if len(self.stamps_ns) < 2:
            return 0.0
        span_s = (max(self.stamps_ns) - min(self.stamps_ns)) / NS_PER_S
        return span_s * len(self.stamps_ns) / (len(self.stamps_ns) - 1)


def distinct_names(folders: Sequence[Path]) -> list[str]:
    """A name for each recording: the last parts of its path, as many as make it unique.

    Raises UserError for a recording that is given twice.
    """
    paths = [folder.resolve() for folder in folders]
    for given, path in zip(folders, paths, strict=True):
        if paths.count(path) > 1:
            raise UserError(f"{given}: is given twice; once is enough")
    names = []
    for path in paths:
        count = 1
        while sum(other.parts[-count:] == path.parts[-count:] for other in paths) > 1:
            count += 1
        names.append("/".join(path.parts[-count:]))
    return names


def evaluate_recording(
    folder: Path,
    odometry: OdometryChoice,
    static: bool,
    config: ReplayConfig,
    on_frame: Callable[[], None] = lambda: None,
    name: str | None = None,
) -> RecordingRecord:
    """Run detect and track on every usable frame. Raises HalError.

    on_frame: called after each frame.
    name: the folder's if None.
    """
    name = folder.name if name is None else name
    source, poses = open_replay(folder, odometry)
    perceiver = build_replay_perceiver(config, source.mount, poses, time.perf_counter_ns)
    tally = _Tally()
    with source:
        for frame in frames_of(source):
            tally.add(name, perceiver.look(frame))
            on_frame()
    return RecordingRecord(
        folder=folder,
        name=name,
        odometry="none" if poses is None else ("file" if odometry == "auto" else odometry),
        static=static,
        frames=len(tally.stamps_ns),
        skipped=len(source.skipped),
        seconds=tally.seconds,
        objects=len(tally.track_ids),
        moving_objects=tuple(
            sorted(identity for identity, count in tally.moving.items() if count >= WRONG_FRAMES)
        ),
        frames_with_moving=tally.frames_with_moving,
        ms=tuple(tally.ms),
        conditions={condition.value: count for condition, count in tally.conditions.items()},
        ego_sources=dict(tally.ego_sources),
        pictures=tally.pictures,
    )


def _snapshot(name: str, index: int, look: Look) -> Snapshot:
    stamp_s = look.scene.captured_ns / NS_PER_S
    return Snapshot(
        sequence=name,
        index=index,
        colour=look.frame.colour,
        depth_m=look.frame.depth.astype(np.float32) * np.float32(look.frame.depth_scale_m),
        truth=FrameTruth(stamp_s, ()),
        detections=tuple(detection_of(obstacle) for obstacle in look.scene.obstacles),
        fragments=look.fragments,
        score=FrameScore((), (), (), (), ()),
    )
