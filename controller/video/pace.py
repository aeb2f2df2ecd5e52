"""A video that plays in real time: each picture is shown until the time of the next one."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

from controller.video.style import Image
from controller.video.writer import VideoError, VideoWriter
from hal.clocks import NS_PER_S

# A longer gap between two pictures is shown this long: a recording may pause for hours.
MAX_STILL_S = 5.0
# Maximum number of pictures that wait to be encoded, 2.8 MB each, and of pictures that they stand for. VP8
# takes 25 ms for a repeated picture and 140 ms for a new one, and a drive that has ended waits for a few
# seconds only.
_MAX_WAITING, _MAX_WAITING_DUE = 8, 20


class Pace:
    """Counts how many pictures of a constant frame rate each picture stands for."""

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._max_due = max(1, round(MAX_STILL_S * fps))
        self._first_ns = self._last_ns = 0
        self._written = 0

    def due(self, stamp_ns: int) -> int:
        """How many pictures to add, of which the last is the new one and the others repeat the one before.

        0: the new one comes too early to be shown. A picture that is early by one is added nevertheless, so
        that jitter neither drops nor repeats pictures. A clock that goes back starts anew.
        """
        if not self._written or stamp_ns < self._last_ns:
            self._begin_at(stamp_ns)
        self._last_ns = stamp_ns
        elapsed = round((stamp_ns - self._first_ns) * self._fps / NS_PER_S)
        due = elapsed + 1 - self._written
        if due > self._max_due:
            due = self._max_due
            self._begin_at(stamp_ns, due - 1)
        due = 1 if due == 0 else max(due, 0)
        self._written += due
        return due

    def _begin_at(self, stamp_ns: int, repeats: int = 0) -> None:
        """Let the picture of this time follow those that are written, after some repeats of the last one."""
        self._first_ns = stamp_ns - round((self._written + repeats) * NS_PER_S / self._fps)


class PacedVideo:
    """Encodes pictures in its own thread, each as often as its time needs. OpenCV encodes without the
    interpreter's lock.

    may_drop: if encoding does not keep up, a picture is left out, and the one before it is shown for longer,
    up to MAX_STILL_S; otherwise write() waits.
    """

    def __init__(self, video: VideoWriter, fps: float, may_drop: bool) -> None:
        self._video, self._pace, self._may_drop = video, Pace(fps), may_drop
        self._waiting: deque[tuple[Future[None], int]] = deque()
        self._thread: ThreadPoolExecutor | None = None
        self._last: Image | None = None
        self._failed = self._hurries = False

    def __enter__(self) -> Self:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="video")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Encode the pictures that are waiting, and finish the file. Raises VideoError if that fails, unless
        another error ends the block: that one is more important.

        A drive in real time does not wait for repeated pictures then: its last seconds may be shorter.
        """
        assert self._thread is not None
        self._hurries = self._may_drop
        self._thread.shutdown(wait=True)
        try:
            with self._video:
                self._collect(0)
        except VideoError:
            if error is None:
                raise

    def write(self, picture: Image, stamp_ns: int) -> None:
        """Queue one picture, (H, W, 3) uint8 BGR, of this time. Raises VideoError if an earlier one could not
        be written."""
        assert self._thread is not None
        self._collect(len(self._waiting) if self._may_drop else _MAX_WAITING - 1)
        busy = sum(due for _, due in self._waiting) >= _MAX_WAITING_DUE
        if self._may_drop and (busy or len(self._waiting) >= _MAX_WAITING):
            return
        due = self._pace.due(stamp_ns)
        if due:
            self._waiting.append((self._thread.submit(self._encode, picture, due), due))

    def _encode(self, picture: Image, due: int) -> None:
        if self._failed:  # the video ends, rather than have a gap
            return
        try:
            if self._last is not None:
                for _ in range(due - 1):
                    if not self._hurries:
                        self._video.write(self._last)
            self._video.write(picture)
        except VideoError:
            self._failed = True
            raise
        self._last = picture

    def _collect(self, max_waiting: int) -> None:
        """Wait until at most max_waiting pictures are waiting. Raises VideoError if one could not be
        written."""
        while self._waiting and (self._waiting[0][0].done() or len(self._waiting) > max_waiting):
            self._waiting.popleft()[0].result()
