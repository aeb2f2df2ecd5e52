"""Messages between the two processes of the real-time runner; neither ever blocks on the other.

A pair of SOCK_SEQPACKET sockets: a message arrives whole or not at all. So a peer that freezes or dies while
it sends cannot make the reader wait for the rest.
"""

from __future__ import annotations

import pickle
import socket
from contextlib import suppress

BUFFER_BYTES = 1 << 20  # of the socket, and so the greatest message


class PeerGone(Exception):
    """Raised by receive and send when the other process has closed its end or died."""


class Channel:
    """One end. Carries any picklable object; that is safe because both processes are this program's."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._end.setblocking(False)

    def send(self, message: object) -> bool:
        """Send; False if the buffer is full because the peer does not read. Raises PeerGone."""
        try:
            self._end.send(pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except OSError as error:
            raise PeerGone(f"the other process is gone ({error.strerror})") from error
        return True

    def receive(self) -> object | None:
        """The oldest message that has arrived; None if there is none. Raises PeerGone."""
        try:
            data = self._end.recv(BUFFER_BYTES)
        except BlockingIOError:
            return None
        except OSError as error:
            raise PeerGone(f"the other process is gone ({error.strerror})") from error
        if not data:
            raise PeerGone("the other process has closed its end")
        message: object = pickle.loads(data)
        return message

    def end_sending(self) -> None:
        """The peer's next receive raises PeerGone; what it still sends arrives."""
        with suppress(OSError):
            self._end.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """Close this end; the peer's next call raises PeerGone."""
        self._end.close()


def channel_sockets() -> tuple[socket.socket, socket.socket]:
    """Two connected ends; one is passed to the other process as an argument."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (here, there):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    return here, there
