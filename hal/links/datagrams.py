"""Messages of other programs, over UDP or a Unix datagram socket, without ever waiting."""

from __future__ import annotations

import errno
import os
import socket
import stat
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from hal.errors import DeviceNotFound, DeviceRefused, LinkLost
from hal.types import Sender

# The kernel cuts longer datagrams at this length; the parser refuses messages of this length.
_READ_BYTES = 4096
_RECEIVE_BUFFER_BYTES = 16_384
# Errors that the kernel reports on the next call after a peer went away; the socket itself is fine.
_PEER_GONE_ERRORS = frozenset(
    {errno.ECONNREFUSED, errno.ENOENT, errno.ECONNRESET, errno.EHOSTUNREACH, errno.ENETUNREACH}
)


class DatagramSocket(ABC):
    """hal.api.DatagramLink over one bound socket. The subclass decides what the socket is bound to."""

    def __init__(self) -> None:
        self._socket: socket.socket | None = None

    def __enter__(self) -> Self:
        """Bind. Raises DeviceNotFound, DeviceRefused."""
        self._socket = self._bind()
        self._socket.setblocking(False)
        # A short queue: commands that waited for long should not be obeyed.
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def receive(self) -> tuple[bytes, Sender | None] | None:
        """See hal.api.DatagramLink."""
        assert self._socket is not None, "used before it was opened"
        try:
            data, sender = self._socket.recvfrom(_READ_BYTES)
        except BlockingIOError:
            return None
        except OSError as error:
            if error.errno in _PEER_GONE_ERRORS:
                return None
            raise LinkLost(f"command socket: reading failed ({error.strerror}); start again") from error
        return data, sender or None

    def send(self, data: bytes, receiver: Sender) -> bool:
        """See hal.api.DatagramLink."""
        assert self._socket is not None, "used before it was opened"
        try:
            self._socket.sendto(data, receiver)
        except OSError:
            return False
        return True

    @abstractmethod
    def _bind(self) -> socket.socket:
        """A new, bound socket. Raises DeviceNotFound, DeviceRefused."""


class UdpSocket(DatagramSocket):
    """A UDP socket bound to host:port. Port 0 takes any free port, which the property port gives."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__()
        self._host, self._port = host, port

    @property
    def port(self) -> int:
        """The port that the socket is bound to."""
        assert self._socket is not None, "used before it was opened"
        return int(self._socket.getsockname()[1])

    def _bind(self) -> socket.socket:
        try:
            found = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:  # the latter from names that no resolver would take
            reason = getattr(error, "strerror", None) or "not a host name"
            raise DeviceNotFound(
                f"udp {self._host}: no such address ({reason}); give an address of this machine"
            ) from error
        family, kind, protocol, _, address = found[0]
        bound = socket.socket(family, kind, protocol)
        try:
            bound.bind(address)
        except OSError as error:
            bound.close()
            raise DeviceRefused(
                f"udp {self._host}:{self._port}: cannot listen there ({error.strerror}); is another governor "
                "running, is it an address of this machine?"
            ) from error
        return bound


class UnixSocket(DatagramSocket):
    """A Unix socket bound to a path, which is removed at the end. group_may_send: processes of
    the group may send, too."""

    def __init__(self, path: Path, group_may_send: bool = False) -> None:
        super().__init__()
        self._path = path
        self._mode = 0o660 if group_may_send else 0o600
        self._bound_inode: int | None = None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        super().__exit__(kind, error, trace)
        # Remove only our own socket: another program may have taken the name in the meantime.
        with suppress(OSError):
            if self._path.lstat().st_ino == self._bound_inode:
                self._path.unlink()

    def _bind(self) -> socket.socket:
        self._remove_stale_socket()
        bound = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        # The permissions must hold from the first moment, so they cannot be set after bind.
        old_umask = os.umask(0o777 & ~self._mode)
        try:
            bound.bind(str(self._path))
        except OSError as error:
            bound.close()
            raise DeviceRefused(
                f"{self._path}: cannot listen there ({error.strerror}); can its folder be written?"
            ) from error
        finally:
            os.umask(old_umask)
        self._bound_inode = self._path.lstat().st_ino
        return bound

    def _remove_stale_socket(self) -> None:
        """Remove a socket that a killed program left behind, and nothing else. Raises DeviceRefused."""
        try:
            mode = self._path.lstat().st_mode
        except OSError:
            return
        if not stat.S_ISSOCK(mode):
            raise DeviceRefused(f"{self._path}: is there already and is no socket; choose another path")
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect(str(self._path))
            except ConnectionRefusedError:
                self._path.unlink()
            except OSError as error:
                raise DeviceRefused(f"{self._path}: is in the way ({error.strerror}); remove it") from error
            else:
                raise DeviceRefused(
                    f"{self._path}: another governor listens there; stop it or take another path"
                )
