import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.realtime.service import ServiceManager, StopRequest, stop_on_signals


@pytest.fixture
def manager_socket(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "notify"))
        receiver.settimeout(1.0)
        yield receiver


def address_of(receiver: socket.socket) -> str:
    return str(receiver.getsockname())


def test_ready_and_stopping_reach_the_manager(manager_socket: socket.socket) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": address_of(manager_socket)}, pid=7)
    service.ready("driving")
    assert manager_socket.recv(200) == b"READY=1\nSTATUS=driving"
    service.stopping("SIGTERM")
    assert manager_socket.recv(200) == b"STOPPING=1\nSTATUS=SIGTERM"


def test_the_watchdog_is_fed_at_half_its_interval(manager_socket: socket.socket) -> None:
    environment = {
        "NOTIFY_SOCKET": address_of(manager_socket),
        "WATCHDOG_USEC": "1000000",
        "WATCHDOG_PID": "7",
    }
    service = ServiceManager(environment, pid=7)
    for now_ms in range(0, 1500, 20):
        service.feed_watchdog(now_ms * 1_000_000)
    manager_socket.setblocking(False)
    assert [manager_socket.recv(200) for _ in range(3)] == [b"WATCHDOG=1"] * 3
    with pytest.raises(BlockingIOError):
        manager_socket.recv(200)


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "8"},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "\N{SUPERSCRIPT TWO}"},
        {"WATCHDOG_USEC": "1" * 5000},
    ],
)
def test_no_watchdog_that_is_not_meant_for_us(
    manager_socket: socket.socket, environment: dict[str, str]
) -> None:
    service = ServiceManager(environment | {"NOTIFY_SOCKET": address_of(manager_socket)}, pid=7)
    service.feed_watchdog(10**12)
    manager_socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        manager_socket.recv(200)


def test_without_a_manager_nothing_is_sent_and_nothing_is_lost() -> None:
    service = ServiceManager({}, pid=7)
    service.ready("driving")
    assert service.lost_notices == 0


def test_an_abstract_socket_address_is_understood() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind("\0treadwatch-test-notify")
        receiver.settimeout(1.0)
        ServiceManager({"NOTIFY_SOCKET": "@treadwatch-test-notify"}, pid=7).ready("here")
        assert receiver.recv(200).startswith(b"READY=1")


def test_a_manager_that_is_gone_is_counted_not_raised(tmp_path: Path) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "nobody")}, pid=7)
    service.ready("driving")
    assert service.lost_notices == 1


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_becomes_a_wish_and_the_old_handler_comes_back(number: signal.Signals) -> None:
    # Under nohup, SIGHUP would be ignored.
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with stop_on_signals() as request:
            assert not request
            os.kill(os.getpid(), number)
            assert request
            assert request.reason == number.name
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)


def test_under_nohup_a_terminal_may_go() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_on_signals() as request:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not request
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("closes", [True, False])
def test_only_the_third_signal_while_a_drive_closes_ends_it_hard(closes: bool) -> None:
    """As long as the robot moves none does."""
    script = (
        "import os, signal, sys\n"
        "from controller.realtime.service import StopRequest\n"
        "stop = StopRequest().listen()\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "if sys.argv[1] == 'True': stop.closing()\n"
        "for left in range(3):\n"
        "    print(left, flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "print('summary')\n"
    )
    done = subprocess.run([sys.executable, "-c", script, str(closes)], capture_output=True, text=True)
    assert done.stdout.split() == (["0", "1", "2"] if closes else ["0", "1", "2", "summary"])
    assert done.returncode == (-signal.SIGTERM if closes else 0)


def test_the_exit_code_is_safe_until_the_process_has_gone() -> None:
    """The interpreter takes handlers of Python away while it ends."""
    script = (
        "import atexit, os, signal\n"
        "from controller.realtime.service import StopRequest\n"
        "class Last:\n"
        "    def __del__(self, kill=os.kill, pid=os.getpid(), number=signal.SIGTERM): kill(pid, number)\n"
        "signal.last = Last()\n"
        "StopRequest().listen()\n"
        "raise SystemExit(2)\n"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 2


def test_a_drive_leaves_its_handlers_in_place() -> None:
    stop = StopRequest().listen()
    os.kill(os.getpid(), signal.SIGTERM)
    assert stop.reason == "SIGTERM"
    assert signal.getsignal(signal.SIGINT) == stop.handle
