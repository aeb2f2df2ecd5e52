"""Writes pictures into a video file. The suffix of the file determines container and codec."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2

from controller.errors import UserError
from controller.video.disk_reservation import DiskReservation
from controller.video.style import Image

# Codecs that OpenCV's wheel really encodes (it has no H.264 encoder). Browsers play VP8 in WebM, which takes
# about ten times as long as MPEG-4. VP9 is available, too, but takes half a second per picture.
CODECS = {
    ".mp4": "mp4v",
    ".m4v": "mp4v",
    ".mov": "mp4v",
    ".mkv": "mp4v",
    ".webm": "VP80",
    ".avi": "MJPG",
}


_STDERR_FD = 2


class VideoError(UserError):
    """The video cannot be written there, or not in this form."""


class VideoWriter:
    """A video file, as a context manager. The first picture creates the file; all others must have its size.

    Raises VideoError: at once if the suffix is unknown or the file cannot be written, so that a long run does
    not fail at its end; from write() if no encoder opens, if a picture has another size than the first, or if
    the disk is full. OpenCV does not report a full disk, so space is reserved before each picture. What was
    written before can be played.
    """

    def __init__(self, path: Path, fps: float) -> None:
        if not fps > 0.0:
            raise VideoError(f"{path}: {fps:g} pictures a second make no video; give a rate above 0")
        self._codec = _codec_for(path)
        _check_writable(path)
        # Absolute, because FFmpeg takes a relative name such as "pipe:1.mp4" for a protocol.
        self._path = path.absolute()
        self._fps = fps
        self._size: tuple[int, int] | None = None
        self._writer: cv2.VideoWriter | None = None
        self._reservation: DiskReservation | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except VideoError:
            # The error that ended the block is more important than this one.
            if error is None:
                raise

    def write(self, picture: Image) -> None:
        """Append one picture, (H, W, 3) uint8 BGR."""
        height, width = picture.shape[:2]
        if self._writer is None:
            self._writer = self._open((width, height))
            self._size = (width, height)
            with self._reporting_errors():
                self._reservation = DiskReservation(self._path).__enter__()
        if (width, height) != self._size:
            raise VideoError(
                f"{self._path}: a picture of {width}x{height} after others of another size; "
                "write one video for each size"
            )
        assert self._reservation is not None, "opened with the writer"
        with self._reporting_errors():
            self._reservation.reserve_next()
        self._writer.write(picture)

    def close(self) -> None:
        """Finish the file. Idempotent. If there was no picture, there is no file.

        Raises VideoError if what was written is no video.
        """
        writer, self._writer = self._writer, None
        disk_reservation, self._reservation = self._reservation, None
        if writer is None:
            return
        with _native_stderr_silenced():
            writer.release()
        if disk_reservation is not None:
            with self._reporting_errors():
                disk_reservation.__exit__(None, None, None)
            if not _readable(self._path):
                raise self._write_error("its end could not be written")

    @contextmanager
    def _reporting_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._write_error(str(error.strerror)) from error

    def _write_error(self, reason: str) -> VideoError:
        return VideoError(
            f"{self._path}: nothing more can be written ({reason}); make room or name another file"
        )

    def _open(self, size: tuple[int, int]) -> cv2.VideoWriter:
        fourcc = cv2.VideoWriter.fourcc(*self._codec)
        with _native_stderr_silenced():
            writer = cv2.VideoWriter(str(self._path), cv2.CAP_FFMPEG, fourcc, self._fps, size)
        if not writer.isOpened():
            raise VideoError(
                f"{self._path}: OpenCV opens no {self._codec} encoder for {size[0]}x{size[1]} at "
                f"{self._fps:g} pictures a second; try another suffix: {', '.join(CODECS)}"
            )
        return writer


def _codec_for(path: Path) -> str:
    codec = CODECS.get(path.suffix.lower())
    if codec is None:
        found = f"{path.suffix!r} is no kind of video" if path.suffix else "which kind of video is not said"
        raise VideoError(f"{path}: {found}; end its name with one of {', '.join(CODECS)}")
    return codec


def _check_writable(path: Path) -> None:
    """Check by trying, because permissions do not show a read-only disk. An existing file is not changed."""
    existed = os.path.exists(path)
    try:
        path.open("ab").close()
        if not existed:
            path.unlink()
    except OSError as error:
        raise VideoError(
            f"{path}: the video cannot be written there ({error.strerror}); name a file in a folder that "
            "exists and that you may write to"
        ) from error


def _readable(path: Path) -> bool:
    with _native_stderr_silenced():
        video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        opened = video.isOpened()
        video.release()
    return opened


@contextmanager
def _native_stderr_silenced() -> Iterator[None]:
    """Silence standard error: FFmpeg prints messages for developers there, and no setting stops all of
    them."""
    sys.stderr.flush()
    try:
        saved_fd = os.dup(_STDERR_FD)
    except OSError:  # standard error is closed, as in some services: nothing to silence
        yield
        return
    null_fd = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null_fd, _STDERR_FD)
        yield
    finally:
        os.dup2(saved_fd, _STDERR_FD)
        os.close(saved_fd)
        os.close(null_fd)
