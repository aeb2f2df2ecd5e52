import os
import socket
from pathlib import Path

import pytest

from hal.errors import DeviceNotFound, DeviceRefused
from hal.links.datagrams import UdpSocket, UnixSocket


def test_udp_there_and_back() -> None:
    with UdpSocket("127.0.0.1", 0) as link, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        assert link.receive() is None
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(5.0)
        peer.sendto(b"one", ("127.0.0.1", link.port))
        peer.sendto(b"two", ("127.0.0.1", link.port))
        arrived = link.receive()
        assert arrived is not None
        assert arrived == (b"one", peer.getsockname())
        second = link.receive()
        assert second is not None
        assert second[0] == b"two"
        assert link.receive() is None
        assert link.send(b"answer", peer.getsockname())
        assert peer.recv(100) == b"answer"


def test_a_peer_that_has_gone_disturbs_nobody() -> None:
    with UdpSocket("127.0.0.1", 0) as link:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
            peer.bind(("127.0.0.1", 0))
            gone = peer.getsockname()
        for _ in range(3):
            link.send(b"anybody?", gone)
            assert link.receive() is None


def test_a_port_that_is_taken_and_an_address_that_is_not_ours() -> None:
    with (
        UdpSocket("127.0.0.1", 0) as link,
        pytest.raises(DeviceRefused, match="cannot listen there"),
        UdpSocket("127.0.0.1", link.port),
    ):
        pass
    with pytest.raises(DeviceRefused, match="an address of this machine"), UdpSocket("192.0.2.1", 7447):
        pass
    for host in ("not an address", "a..b", "x" * 64 + ".local"):
        with pytest.raises(DeviceNotFound, match="no such address"), UdpSocket(host, 7447):
            pass


def test_unix_there_and_back_and_the_path_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "governor.sock"
    with UnixSocket(path) as link, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as peer:
        assert path.stat().st_mode & 0o777 == 0o600
        peer.bind(str(tmp_path / "client.sock"))
        peer.settimeout(5.0)
        peer.sendto(b"one", str(path))
        assert link.receive() == (b"one", str(tmp_path / "client.sock"))
        assert link.send(b"answer", str(tmp_path / "client.sock"))
        assert peer.recv(100) == b"answer"
        assert not link.send(b"nobody there", str(tmp_path / "nobody.sock"))
    assert not path.exists()


def test_a_sender_without_address(tmp_path: Path) -> None:
    path = tmp_path / "governor.sock"
    with UnixSocket(path) as link, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as peer:
        peer.sendto(b"one", str(path))
        assert link.receive() == (b"one", None)


def test_a_peer_that_does_not_read_makes_nobody_wait(tmp_path: Path) -> None:
    with (
        UnixSocket(tmp_path / "governor.sock") as link,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as peer,
    ):
        peer.bind(str(tmp_path / "client.sock"))
        sent = [link.send(b"x" * 200, str(tmp_path / "client.sock")) for _ in range(10_000)]
    assert sent[0]
    assert not sent[-1]


def test_the_group_may_send_where_the_yaml_says_so(tmp_path: Path) -> None:
    path = tmp_path / "governor.sock"
    before = os.umask(0o077)
    try:
        with UnixSocket(path, group_may_send=True):
            assert path.stat().st_mode & 0o777 == 0o660
        assert os.umask(0o077) == 0o077
    finally:
        os.umask(before)


def test_a_socket_that_was_left_behind_is_cleared_away_but_nothing_else_is(tmp_path: Path) -> None:
    path = tmp_path / "governor.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as killed:
        killed.bind(str(path))
    with UnixSocket(path):
        with pytest.raises(DeviceRefused, match="another governor listens there"), UnixSocket(path):
            pass
        assert path.exists(), "the one that was refused has not taken it away"
    path.write_text("precious")
    with pytest.raises(DeviceRefused, match="is no socket"), UnixSocket(path):
        pass
    assert path.read_text() == "precious"
    with pytest.raises(DeviceRefused, match="cannot listen there"), UnixSocket(tmp_path / "no" / "folder"):
        pass


def test_a_path_that_another_program_took_meanwhile_stays(tmp_path: Path) -> None:
    path = tmp_path / "governor.sock"
    with UnixSocket(path), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        path.rename(tmp_path / "away.sock")
        other.bind(str(path))
    assert path.exists()
