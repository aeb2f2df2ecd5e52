import pytest

from controller.realtime.channel import Channel, PeerGone, channel_sockets


def pair() -> tuple[Channel, Channel]:
    here, there = channel_sockets()
    return Channel(here), Channel(there)


def test_messages_arrive_whole_and_in_order() -> None:
    here, there = pair()
    assert here.send({"a": 1})
    assert here.send(["b" * 50_000])
    assert there.receive() == {"a": 1}
    assert there.receive() == ["b" * 50_000]
    assert there.receive() is None
    here.close()
    there.close()


def test_a_peer_that_does_not_read_never_blocks_the_sender() -> None:
    here, there = pair()
    sent = 0
    while here.send(b"x" * 10_000):
        sent += 1
    assert sent > 5
    assert there.receive() == b"x" * 10_000
    here.close()
    there.close()


def test_a_closed_peer_is_told_apart_from_silence() -> None:
    here, there = pair()
    there.close()
    with pytest.raises(PeerGone):
        here.receive()
    with pytest.raises(PeerGone):
        here.send(1)
    here.close()
