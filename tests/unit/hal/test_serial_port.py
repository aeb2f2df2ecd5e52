from __future__ import annotations

import grp
import os
import termios
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import serial

from config.chassis import SerialLinkConfig
from hal.api import SerialLink
from hal.errors import DeviceNotFound, DeviceRefused, LinkLost
from hal.links.pseudo_terminal import PseudoTerminal
from hal.links.serial_port import SerialPortLink, _describe_ports
from tests.support.wires import open_serial_link


def config(url: str, baud: int = 115_200) -> SerialLinkConfig:
    return SerialLinkConfig(url=url, baud=baud)


def fill(link: SerialLink) -> None:
    """More than any buffer between two programs holds."""
    for _ in range(64):
        link.write(bytes(4096))


def test_a_url_alone_selects_a_loop() -> None:
    with open_serial_link(config("loop://")) as link:
        link.write(b"\x80\x5a")
        assert link.read() == b"\x80\x5a"
        assert link.read() == b""


@pytest.mark.parametrize(
    ("url", "reason", "advice"),
    [
        ("/dev/ttyNotThere", "No such file", "that the adapter is plugged in"),
        ("/tmp/no-emulator-runs", "No such file", "for example an emulator, is running"),
        ("nothing://here", "not known", "check the url"),
        ("socket://127.0.0.1:1", "refused", "is running"),
    ],
)
def test_a_port_that_is_not_there_is_one_clear_line(url: str, reason: str, advice: str) -> None:
    with pytest.raises(DeviceNotFound) as caught:
        open_serial_link(config(url))
    message = str(caught.value)
    assert message.startswith(f"serial port {url}: cannot be opened (")
    assert reason in message
    assert advice in message
    assert message.count(url) == 1
    assert "\n" not in message
    assert caught.value.__cause__ is not None


def test_a_file_that_is_no_port_is_refused(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.write_bytes(b"")
    with pytest.raises(DeviceRefused, match=r"is not a serial port .*; check url and baud"):
        open_serial_link(config(str(plain)))


def test_a_folder_in_place_of_a_port_is_named_once(tmp_path: Path) -> None:
    with pytest.raises(DeviceRefused, match=r"baud \(Is a directory\); check url and baud") as caught:
        open_serial_link(config(str(tmp_path)))
    assert str(caught.value).count(str(tmp_path)) == 1


def test_a_port_in_use_is_refused() -> None:
    with (
        PseudoTerminal() as terminal,
        open_serial_link(config(terminal.path)),
        pytest.raises(DeviceRefused, match="in use by another program"),
    ):
        open_serial_link(config(terminal.path))


def test_no_permission_is_refused_with_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **options: object) -> None:
        raise serial.SerialException(13, "could not open port: Permission denied")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceRefused, match=r"`sudo usermod -aG dialout \$USER`, then log in again"):
        open_serial_link(config("/dev/ttyNotThere"))
    with PseudoTerminal() as terminal:
        owners = grp.getgrgid(os.stat(terminal.path).st_gid).gr_name
        group = "dialout" if owners == "root" else owners
        with pytest.raises(DeviceRefused, match=f"SupplementaryGroups={group}"):
            open_serial_link(config(terminal.path))


def test_the_ports_that_are_there_are_named(tmp_path: Path) -> None:
    assert _describe_ports(tmp_path) == "no USB serial port is here"
    (tmp_path / "ttyUSB0").touch()
    (tmp_path / "ttyACM3").touch()
    assert _describe_ports(tmp_path) == f"here are: {tmp_path}/ttyACM3, {tmp_path}/ttyUSB0"
    (tmp_path / "serial" / "by-id").mkdir(parents=True)
    (tmp_path / "serial" / "by-id" / "usb-FTDI").touch()
    assert _describe_ports(tmp_path) == f"here are: {tmp_path}/serial/by-id/usb-FTDI", "these names stay"


def test_opened_so_that_nothing_can_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """write_timeout=0 spins for ever when the peer stops reading; no timeout at all waits for ever."""
    given: dict[str, object] = {}
    original = serial.serial_for_url

    def note(url: str, **options: Any) -> serial.SerialBase:
        given.update(options)
        return original(url, **options)

    monkeypatch.setattr(serial, "serial_for_url", note)
    with open_serial_link(config("loop://", 38_400)):
        assert given["timeout"] == 0
        assert given["exclusive"] is True
        assert given["baudrate"] == 38_400
        write_timeout = given["write_timeout"]
        assert isinstance(write_timeout, float)
        assert 0.0 < write_timeout <= 0.05


def test_a_peer_that_stops_reading_is_a_lost_link() -> None:
    with PseudoTerminal() as terminal, open_serial_link(config(terminal.path)) as link:
        with pytest.raises(LinkLost, match="lost while writing"):
            fill(link)
        assert terminal.read()


@pytest.mark.parametrize(
    "error",
    [serial.SerialException("device reports readiness"), OSError(5, "I/O error"), termios.error(5, "I/O")],
)
def test_all_three_kinds_of_error_are_a_lost_link(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    class Broken:
        def read(self, size: int) -> bytes:
            raise error

        def write(self, data: bytes) -> int:
            raise error

        def close(self) -> None:
            raise error

    monkeypatch.setattr(serial, "serial_for_url", lambda *arguments, **options: Broken())
    link = SerialPortLink(config("/dev/ttyUSB0"))
    uses: tuple[Callable[[], object], ...] = (link.read, lambda: link.write(b"x"))
    for use in uses:
        with pytest.raises(LinkLost, match="serial port /dev/ttyUSB0: lost while") as caught:
            use()
        assert caught.value.__cause__ is error


def test_a_write_that_is_cut_short_is_a_lost_link(monkeypatch: pytest.MonkeyPatch) -> None:
    class Short:
        def write(self, data: bytes) -> int:
            return len(data) - 1

        def close(self) -> None:
            return None

    monkeypatch.setattr(serial, "serial_for_url", lambda *arguments, **options: Short())
    with pytest.raises(LinkLost, match="1 of 2 bytes accepted"):
        SerialPortLink(config("x")).write(b"ab")


def test_a_port_that_comes_back_is_opened_again(tmp_path: Path) -> None:
    """As udev does it: the same name, another device behind it."""
    name = tmp_path / "robot"
    with PseudoTerminal() as first, PseudoTerminal() as second:
        name.symlink_to(first.path)
        with open_serial_link(config(str(name))) as link:
            first.unplug()
            with pytest.raises(LinkLost):
                link.read()
            name.unlink()
            with pytest.raises(LinkLost, match="No such file"):
                link.read()
            name.symlink_to(second.path)
            assert link.read() == b""
            link.write(b"back")


@pytest.mark.parametrize(("url", "elsewhere"), [("socket://10.0.0.7:4001", True), ("/dev/ttyUSB0", False)])
def test_network_port_is_reopened_outside_the_control_loop(
    monkeypatch: pytest.MonkeyPatch, url: str, elsewhere: bool
) -> None:
    """A host that does not answer is waited for, for seconds."""
    threads: list[threading.Thread] = []
    opened = threading.Event()

    def note(*arguments: object, **options: object) -> None:
        threads.append(threading.current_thread())
        opened.set()
        raise serial.SerialException("timed out")

    monkeypatch.setattr(serial, "serial_for_url", note)
    with pytest.raises(LinkLost):
        SerialPortLink(config(url)).read()
    assert opened.wait(5.0)
    assert (threads[0] is not threading.current_thread()) is elsewhere


def test_a_closed_link_says_so_and_closing_twice_is_fine() -> None:
    link = open_serial_link(config("loop://"))
    link.__exit__(None, None, None)
    link.__exit__(None, None, None)
    with pytest.raises(LinkLost, match="closed"):
        link.read()


def test_pseudo_terminal_errors_are_lost_links() -> None:
    terminal = PseudoTerminal()
    assert os.path.exists(terminal.path)
    with pytest.raises(LinkLost, match=r"no program reads|cannot write"):
        fill(terminal)
    terminal.unplug()
    terminal.unplug()
    with pytest.raises(LinkLost, match="unplugged"):
        terminal.write(b"x")
    with pytest.raises(LinkLost, match="unplugged"):
        terminal.read()
