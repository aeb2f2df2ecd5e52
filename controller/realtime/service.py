"""What a service owes its manager: readiness, a watchdog that the control loop itself feeds, a clean end.

The notify protocol is the one of sd_notify(3): datagrams to the socket named in NOTIFY_SOCKET.
"""

from __future__ import annotations

import atexit
import re
import signal
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Self

from hal.clocks import NS_PER_S

# What systemd writes. str.isdigit() is also true of what int() does not take: superscripts, or 5000 digits.
_UINT64 = re.compile("[0-9]{1,20}")

_STOPPING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
# The first Ctrl-C while a drive closes, and the second of somebody who is impatient, lose no files.
_MOST_PATIENT = 3


class ServiceManager:
    """Speaks to systemd if it started us, to nobody otherwise.

    A notice that cannot be delivered must not stop a robot: it is counted in ``lost_notices``, and
    systemd will notice the missing watchdog by itself.
    """

    def __init__(self, environment: Mapping[str, str], pid: int) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._interval_ns = _watchdog_interval_ns(environment, pid)
        self._next_ns = 0
        self._told_stopping = False
        self.lost_notices = 0

    def ready(self, status: str) -> None:
        """The loop runs and the devices answer (Type=notify waits for this)."""
        self._send(f"READY=1\nSTATUS={status}")

    def stopping(self, status: str) -> None:
        """The stop has begun, or the drive is over; told once. From now on no watchdog waits to be fed."""
        if not self._told_stopping:
            self._told_stopping = True
            self._send(f"STOPPING=1\nSTATUS={status}")

    def feed_watchdog(self, now_ns: int) -> None:
        """Call once per healthy control step; sends at half the interval that systemd allows."""
        if self._interval_ns is not None and now_ns >= self._next_ns:
            self._next_ns = now_ns + self._interval_ns // 2
            self._send("WATCHDOG=1")

    def _send(self, message: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as notify:
                notify.sendto(message.encode(), self._address)
        except OSError:
            self.lost_notices += 1


def _watchdog_interval_ns(environment: Mapping[str, str], pid: int) -> int | None:
    """WATCHDOG_USEC, if it is meant for this process (sd_watchdog_enabled(3))."""
    meant_for = environment.get("WATCHDOG_PID", "")
    if meant_for and meant_for != str(pid):
        return None
    microseconds = environment.get("WATCHDOG_USEC", "")
    if _UINT64.fullmatch(microseconds) is None or int(microseconds) == 0:
        return None
    return int(microseconds) * (NS_PER_S // 1_000_000)


class StopRequest:
    """Set by SIGTERM, SIGINT or SIGHUP; read by the runner once per control step.

    While a drive closes (its files, perception, the summary), signals change nothing: the drive has ended,
    and closing takes seconds at most. Only the _MOST_PATIENT-th of them ends the process at once, for whoever
    waits for a disk or a terminal that hangs.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self._closing = False
        self._while_closing = 0

    def __bool__(self) -> bool:
        return self.reason is not None

    def listen(self) -> Self:
        """From now on until the process ends, its last moments included; not to SIGHUP under nohup."""
        for number in _STOPPING:
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self.handle)
        atexit.register(_ignore_once_over, self)
        return self

    def closing(self) -> None:
        """The drive has ended: nothing is left to be stopped."""
        self._closing = True

    def handle(self, number: int, _frame: FrameType | None) -> None:
        """A signal handler: it only notes the wish, the loop does the stopping."""
        self.reason = signal.Signals(number).name
        self._while_closing += self._closing
        if self._while_closing >= _MOST_PATIENT:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(signal.Signals(number))


def _ignore_once_over(request: StopRequest) -> None:
    """The interpreter takes Python's handlers away while it ends: the exit code is decided by then."""
    for number in _STOPPING:
        if signal.getsignal(number) == request.handle:
            signal.signal(number, signal.SIG_IGN)


@contextmanager
def handlers_kept() -> Iterator[None]:
    """The handlers of the stopping signals are the same after the block as before."""
    before = {number: signal.getsignal(number) for number in _STOPPING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """Turn SIGTERM, SIGINT and SIGHUP into a StopRequest while the body runs; SIGHUP not under nohup."""
    with handlers_kept():
        yield StopRequest().listen()
