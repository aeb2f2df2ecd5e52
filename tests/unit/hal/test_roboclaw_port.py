"""One request after another on a RoboClaw's line, by the bytes, and a line that misbehaves."""

from __future__ import annotations

import struct

import pytest

from hal.chassis import roboclaw_packets as packets
from hal.chassis.roboclaw_port import Answer, RoboclawPort
from hal.links.scripted import ScriptedSerialLink
from tests.support.chassis_rig import MS

ADDRESS = 0x80


def crc(command: int, data: bytes) -> bytes:
    return packets.crc16(bytes((ADDRESS, command)) + data).to_bytes(2, "big")


def asked(request: packets.Request) -> tuple[ScriptedSerialLink, RoboclawPort]:
    """A line, and a port that sent this request on it at time 0."""
    link = ScriptedSerialLink()
    port = RoboclawPort(link, ADDRESS)
    port.start(request, 0)
    return link, port


class TestPort:
    def test_one_request_at_a_time_and_its_answer(self) -> None:
        link = ScriptedSerialLink()
        port = RoboclawPort(link, ADDRESS)
        assert port.idle(0)
        port.start(packets.MAIN_BATTERY_REQUEST, 0)
        assert not port.idle(0)
        assert bytes(link.sent) == b"\x80\x18"
        assert port.poll(1 * MS) is None
        link.deliver(b"\x00\xfc" + crc(24, b"\x00\xfc"))
        assert port.poll(2 * MS) == Answer(packets.MAIN_BATTERY_REQUEST, b"\x00\xfc", 0)
        assert port.idle(2 * MS)

    def test_short_reads_are_put_together(self) -> None:
        link, port = asked(packets.ENCODERS_REQUEST)
        data = struct.pack(">II", 1, 2)
        answers = []
        for k, byte in enumerate(data + crc(78, data)):
            link.deliver(bytes((byte,)))
            answers.append(port.poll(k * MS))
        assert answers[:-1] == [None] * 9
        assert answers[-1] == Answer(packets.ENCODERS_REQUEST, data, 0)

    def test_a_lost_answer_ends_after_its_time_and_a_silence(self) -> None:
        _, port = asked(packets.ENCODERS_REQUEST)
        assert port.poll(29 * MS) is None
        assert port.poll(30 * MS) == Answer(packets.ENCODERS_REQUEST, None, 0)
        assert not port.idle(39 * MS)
        assert port.idle(40 * MS)

    @pytest.mark.parametrize("noise", [b"\x00", b"\xff\x55\xaa"])
    def test_noise_before_an_answer_spoils_it(self, noise: bytes) -> None:
        """An answer has no start mark: guessing where it begins would accept wrong checksums."""
        link, port = asked(packets.MAIN_BATTERY_REQUEST)
        link.deliver(noise + b"\x00\xfc" + crc(24, b"\x00\xfc"))
        assert port.poll(2 * MS) == Answer(packets.MAIN_BATTERY_REQUEST, None, 0)

    def test_a_wrong_checksum_is_no_answer(self) -> None:
        link, port = asked(packets.MAIN_BATTERY_REQUEST)
        link.deliver(b"\x00\xfd" + crc(24, b"\x00\xfc"))
        assert port.poll(2 * MS) == Answer(packets.MAIN_BATTERY_REQUEST, None, 0)

    def test_an_answer_that_comes_too_late_is_not_taken_for_the_next(self) -> None:
        link, port = asked(packets.speeds(1, 1))
        port.poll(30 * MS)
        link.deliver(b"\xff")
        assert port.poll(38 * MS) is None
        assert not port.idle(40 * MS), "the line is left quiet once more"
        assert port.poll(48 * MS) is None
        assert port.idle(48 * MS)
        port.start(packets.speeds(2, 2), 48 * MS)
        assert port.poll(50 * MS) is None

    def test_an_abandoned_request_leaves_room_for_its_answer(self) -> None:
        link, port = asked(packets.speeds(1, 1))
        port.abandon(5 * MS)
        link.deliver(b"\xff")
        assert port.poll(20 * MS) is None
        assert not port.idle(34 * MS)
        assert port.idle(35 * MS)
        port.abandon(50 * MS)
        assert port.idle(50 * MS), "nothing to abandon"

    def test_the_short_status_is_whole_when_silence_follows(self) -> None:
        link, port = asked(packets.STATUS_REQUEST)
        link.deliver(b"\x00\x04" + crc(90, b"\x00\x04"))
        assert port.poll(4 * MS) is None, "it may be the beginning of the long one"
        assert port.poll(14 * MS) == Answer(packets.STATUS_REQUEST, b"\x00\x04", 0)

    def test_the_short_status_of_a_slow_line_is_taken_at_the_last_poll(self) -> None:
        """50 Hz: it came between 20 and 40 ms, and there is no third poll to hear the silence behind it."""
        link, port = asked(packets.STATUS_REQUEST)
        assert port.poll(20 * MS) is None
        link.deliver(b"\x00\x04" + crc(90, b"\x00\x04"))
        assert port.poll(40 * MS) == Answer(packets.STATUS_REQUEST, b"\x00\x04", 0)
        assert port.idle(40 * MS)

    def test_the_beginning_of_the_long_status_is_no_short_one(self) -> None:
        link, port = asked(packets.STATUS_REQUEST)
        link.deliver(bytes.fromhex("00 00 00 01 97 9D")[:4])
        assert port.poll(40 * MS) == Answer(packets.STATUS_REQUEST, None, 0)

    def test_the_long_status_is_whole_at_once(self) -> None:
        link, port = asked(packets.STATUS_REQUEST)
        link.deliver(bytes.fromhex("00 00 00 01 97 9D"))
        assert port.poll(4 * MS) == Answer(packets.STATUS_REQUEST, bytes.fromhex("00 00 00 01"), 0)
