"""Observations: one JSON line per frame, for people and programs (the format is in docs/design.md)."""

from __future__ import annotations

import errno
import json
import math
import os
from contextlib import suppress
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from controller.decision.decision import Decision
from controller.errors import UserError
from hal.clocks import NS_PER_S
from hal.types import FloatArray
from vision.scene import Obstacle, Scene

# `--observations -`.
STANDARD_OUTPUT = Path("-")
_STDOUT_FD = 1


def observation(scene: Scene, decision: Decision | None, timing_ms: dict[str, float]) -> dict[str, Any]:
    """What was seen and decided at one frame, as plain JSON values; unknown numbers become null.

    timing_ms: empty if time is simulated, because durations are not measured then.
    """
    return {
        "stamp": round(scene.captured_ns / NS_PER_S, 6),
        "frame": scene.sequence,
        "obstacles": [_obstacle(obstacle) for obstacle in scene.obstacles],
        "decision": None if decision is None else _decision(decision),
        "camera": {"condition": scene.health.condition.value, "reason": scene.health.reason},
        "timing_ms": {stage: round(duration, 3) for stage, duration in timing_ms.items()},
    }


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    return {
        "id": obstacle.id,
        "bbox": [_number(edge, 1) for edge in obstacle.bbox_px],
        "position": _vector(obstacle.position_m),
        "velocity": _vector(obstacle.velocity_mps),
        "moving": obstacle.moving,
        "score": _number(obstacle.score, 3),
        "fragments": obstacle.fragments,
    }


def _decision(decision: Decision) -> dict[str, Any]:
    return {
        "action": decision.action.value,
        "target_speed_mps": _number(decision.target_speed_mps, 4),
        "reason": decision.reason.sentence,
        "rule": decision.reason.rule,
        "obstacle": decision.reason.obstacle_id,
    }


def _vector(values: FloatArray) -> list[float | None]:
    return [_number(float(value), 4) for value in values]


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


class ObservationFile:
    """Writes JSON lines to a file. A context manager.

    An existing file is emptied only before the first line is written, so that nothing is lost if there is
    none. Each line is written at once, as a whole: whatever ends the program, or a full disk, cuts none off.

    path: the file, or STANDARD_OUTPUT.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._streams = path == STANDARD_OUTPUT
        self._name = "standard output" if self._streams else str(path)
        self._file: FileIO | None = None
        self._has_written = False
        self._length = 0

    def __enter__(self) -> Self:
        """Open or create the file. Raises UserError if that fails."""
        try:
            # A separate file object, so that data left over after the reader has gone is not written by
            # sys.stdout.
            where = os.dup(_STDOUT_FD) if self._streams else self._path
            self._file = open(where, "ab", buffering=0)
        except OSError as error:
            raise UserError(
                f"{self._name}: observations cannot be written there ({error.strerror}); "
                "name a file in a folder that exists and that you may write to"
            ) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is None:
            return
        try:
            self._file.close()
        except OSError as failure:
            # The error that ended the block is more important than this one.
            if error is None:
                raise self._failed(failure) from failure

    def write(self, scene: Scene, decision: Decision | None, timing_ms: dict[str, float]) -> None:
        """Append one line. Raises UserError, for example if the disk is full."""
        assert self._file is not None, "ObservationFile is used inside its with block"
        line = json.dumps(observation(scene, decision, timing_ms), separators=(", ", ": "), allow_nan=False)
        data = f"{line}\n".encode()
        try:
            if not (self._has_written or self._streams) and self._path.is_file():
                self._file.truncate(0)
            self._has_written = True
            _write_whole(self._file, data)
        except OSError as error:
            if not self._streams and self._path.is_file():
                with suppress(OSError):
                    self._file.truncate(self._length)
            raise self._failed(error) from error
        self._length += len(data)

    def _failed(self, error: OSError) -> UserError:
        if isinstance(error, BrokenPipeError):
            return UserError(f"{self._name}: the reader of the observations has gone; write them to a file")
        return UserError(
            f"{self._name}: nothing more can be written ({error.strerror}); make room or name another file"
        )


def _write_whole(file: FileIO, data: bytes) -> None:
    """Raises OSError; a part of the data may have been written then."""
    while data:  # a disk that is nearly full takes a part
        written = file.write(data)
        if written is None:  # a pipe that somebody has made non-blocking
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        data = data[written:]
