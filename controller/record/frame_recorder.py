"""Writes frames to disk in the background, while the next ones are processed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Self

from controller.terminal.outlet import say
from hal.cameras.tum_writer import TumWriter
from hal.errors import DeviceRefused
from hal.types import GyroSamples, Pose, RgbdFrame

# Maximum number of frames that wait to be written: two thirds of a second, longer than the occasional pauses
# of a disk; about 30 MB.
_MAX_WAITING = 20


class FrameRecorder:
    """Compresses and writes frames in its own thread: OpenCV compresses without the interpreter's lock.

    may_drop: if writing does not keep up, frames are dropped and counted; otherwise write() waits.
    """

    def __init__(self, writer: TumWriter, folder: Path, may_drop: bool) -> None:
        self._writer, self._folder, self._may_drop = writer, folder, may_drop
        self._waiting: deque[Future[None]] = deque()
        self._thread: ThreadPoolExecutor | None = None
        self._last_ns: int | None = None
        self._failed = False
        self.dropped = 0

    def __enter__(self) -> Self:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="frame-recorder")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the frames that are waiting. Raises DeviceRefused if that fails; if another error ends the
        drive, the failure is only printed."""
        assert self._thread is not None
        self._thread.shutdown(wait=True)
        if self.dropped:
            reason = "they came faster than they could be written"
            say(f"treadwatch: {self._folder}: {self.dropped} frames were left out: {reason}", to_stderr=True)
        try:
            self._collect(0)
        except DeviceRefused as refused:
            if error is None:
                raise
            if not isinstance(error, DeviceRefused):
                say(f"treadwatch: {refused}", to_stderr=True)

    def write(self, frame: RgbdFrame, odometry: Pose | None) -> None:
        """Queue one frame, unless it is not later than the last one. Raises DeviceRefused if an earlier frame
        could not be written."""
        assert self._thread is not None
        if self._last_ns is not None and frame.captured_ns <= self._last_ns:
            return
        self._last_ns = frame.captured_ns
        self._collect(len(self._waiting) if self._may_drop else _MAX_WAITING - 1)
        if len(self._waiting) >= _MAX_WAITING:
            self.dropped += 1
            if frame.gyro is not None:
                # A few lines, in place of megabytes: without them, the next frames would have no gyro either.
                self._waiting.append(self._thread.submit(self._write_gyro, frame.gyro))
            return
        self._waiting.append(self._thread.submit(self._write, frame, odometry))

    def _write_gyro(self, samples: GyroSamples) -> None:
        self._unless_failed(lambda: self._writer.write_gyro(samples))

    def _write(self, frame: RgbdFrame, odometry: Pose | None) -> None:
        self._unless_failed(lambda: self._writer.write(frame, odometry))

    def _unless_failed(self, write: Callable[[], None]) -> None:
        if self._failed:  # a recording ends, rather than have a gap
            return
        try:
            write()
        except ValueError as error:
            self._failed = True
            raise DeviceRefused(f"{self._folder}: the recording ends here: {error}") from error
        except Exception:
            self._failed = True
            raise

    def _collect(self, max_waiting: int) -> None:
        """Wait until at most max_waiting frames are waiting. Raises DeviceRefused if one could not be
        written."""
        while self._waiting and (self._waiting[0].done() or len(self._waiting) > max_waiting):
            self._waiting.popleft().result()
