"""Reserves disk space for a file that another library writes without reporting whether it succeeds."""

from __future__ import annotations

import ctypes
import errno
import os
import resource
from pathlib import Path
from types import TracebackType
from typing import Self

# Reserved beyond the end of the file. A muxer keeps up to 5 MB (WebM) in memory before it writes them, and an
# index of all pictures for the end of the file, without which the file cannot be read.
_AHEAD_BYTES = 8_000_000
_BYTES_A_PICTURE = 40
_STEP_BYTES = 1_000_000

_KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


class DiskReservation:
    """Reserves the blocks that the file will need, beyond its end, while the file is open in the block.

    If the file system cannot reserve blocks (NFS, vfat), its free space is checked instead.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._fd = -1
        self._reserved = 0
        self._pictures = 0

    def __enter__(self) -> Self:
        """Raises OSError."""
        self._fd = os.open(self._path, os.O_WRONLY)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release what was not needed. The file must be complete."""
        try:
            os.ftruncate(self._fd, os.fstat(self._fd).st_size)
        finally:
            os.close(self._fd)

    def reserve_next(self) -> None:
        """Reserve space for the next picture. Raises OSError if there is none for it and for the end of the
        file."""
        self._pictures += 1
        needed = os.fstat(self._fd).st_size + _AHEAD_BYTES + self._pictures * _BYTES_A_PICTURE
        limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
        if limit != resource.RLIM_INFINITY and limit < needed:
            # Blocks beyond that limit can be reserved, but not written.
            raise OSError(errno.EFBIG, f"{os.strerror(errno.EFBIG)} for `ulimit -f`, {limit} bytes")
        while self._reserved < needed:
            code = fallocate(self._fd, self._reserved, _STEP_BYTES)
            if code in _NO_ROOM:
                raise OSError(code, os.strerror(code))
            if code:
                self._check_free_space(needed)
                return
            self._reserved += _STEP_BYTES

    def _check_free_space(self, needed: int) -> None:
        disk = os.fstatvfs(self._fd)
        if disk.f_bavail * disk.f_frsize < needed - os.fstat(self._fd).st_size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def fallocate(fd: int, offset: int, length: int) -> int:
    """fallocate(2) that keeps the file's size: 0, or an error number."""
    call = ctypes.CDLL(None, use_errno=True).fallocate
    call.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    return 0 if call(fd, _KEEP_SIZE, offset, length) == 0 else ctypes.get_errno()
