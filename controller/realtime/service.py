"""The service manager (systemd) and the signals that stop a drive.

systemd hears when the drive is ready and when it stops. In between, the control loop feeds its watchdog.
The protocol is that of sd_notify(3): datagrams to the socket named in NOTIFY_SOCKET.
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

# A number as systemd writes it. str.isdigit() also accepts what int() refuses: superscripts, or 5000 digits.
_UINT64 = re.compile("[0-9]{1,20}")

_STOPPING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
# While a drive closes, only this many signals end the process: one or two impatient ones lose no files.
_MOST_PATIENT = 3


class ServiceManager:
    """Notifies systemd, if systemd has started this process; does nothing otherwise.

    A notice that cannot be delivered must not stop a robot. It is counted in lost_notices, and systemd
    notices a missing watchdog by itself.
    """

    def __init__(self, environment: Mapping[str, str], pid: int) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._interval_ns = _watchdog_interval_ns(environment, pid)
        self._next_ns = 0
        self._told_stopping = False
        self.lost_notices = 0

    def ready(self, status: str) -> None:
        """Tell that the loop runs and the devices answer; Type=notify waits for this."""
        self._send(f"READY=1\nSTATUS={status}")

    def stopping(self, status: str) -> None:
        """Tell, once, that the stop has begun or the drive is over. The watchdog then waits no longer."""
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

    While a drive closes (files, perception, summary), signals have no effect: the drive has ended, and
    closing takes seconds. Only the _MOST_PATIENT-th of them ends the process at once, in case a disk or a
    terminal hangs.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self._closing = False
        self._while_closing = 0

    def __bool__(self) -> bool:
        return self.reason is not None

    def listen(self) -> Self:
        """Handle the signals from now on until the process has ended; SIGHUP not under nohup."""
        for number in _STOPPING:
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self.handle)
        atexit.register(_ignore_once_over, self)
        return self

    def closing(self) -> None:
        """Note that the drive has ended, so that nothing is left to be stopped."""
        self._closing = True

    def handle(self, number: int, _frame: FrameType | None) -> None:
        """The signal handler. It only notes the request; the loop stops the robot."""
        self.reason = signal.Signals(number).name
        self._while_closing += self._closing
        if self._while_closing >= _MOST_PATIENT:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(signal.Signals(number))


def _ignore_once_over(request: StopRequest) -> None:
    """Ignore the signals while the interpreter ends and removes Python's handlers: the exit code is set."""
    for number in _STOPPING:
        if signal.getsignal(number) == request.handle:
            signal.signal(number, signal.SIG_IGN)


@contextmanager
def handlers_kept() -> Iterator[None]:
    """Restore the handlers of the stopping signals after the block."""
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
