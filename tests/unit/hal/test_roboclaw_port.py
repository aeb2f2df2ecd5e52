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
        for now_ms in (2, 4):
            link.deliver(noise + b"\x00\xfc" + crc(24, b"\x00\xfc"))
            answer = port.poll(now_ms * MS)
        assert answer == Answer(packets.MAIN_BATTERY_REQUEST, None, 2 * MS)

    def test_a_wrong_checksum_is_no_answer(self) -> None:
        link, port = asked(packets.MAIN_BATTERY_REQUEST)
        for now_ms in (2, 4):
            link.deliver(b"\x00\xfd" + crc(24, b"\x00\xfc"))
            answer = port.poll(now_ms * MS)
        assert answer == Answer(packets.MAIN_BATTERY_REQUEST, None, 2 * MS)

    def test_a_garbled_answer_is_asked_for_again_at_once_and_once(self) -> None:
        link, port = asked(packets.MAIN_BATTERY_REQUEST)
        link.deliver(b"\x00\xfd" + crc(24, b"\x00\xfc"))
        assert port.poll(20 * MS) is None
        assert bytes(link.sent) == b"\x80\x18" * 2
        link.deliver(b"\x00\xfb" + crc(24, b"\x00\xfb"))
        assert port.poll(40 * MS) == Answer(packets.MAIN_BATTERY_REQUEST, b"\x00\xfb", 20 * MS)
        port.start(packets.CURRENTS_REQUEST, 40 * MS)
        for now_ms in (60, 80):
            link.deliver(bytes(6))
            answer = port.poll(now_ms * MS)
        assert answer == Answer(packets.CURRENTS_REQUEST, None, 60 * MS)
        assert bytes(link.sent[4:]) == b"\x80\x31" * 2
        assert not port.idle(89 * MS), "now the line is left quiet"

    @pytest.mark.parametrize("data", [b"", b"\x00", b"\x00\xfc\x12"])
    def test_a_missing_answer_is_not_asked_for_again(self, data: bytes) -> None:
        """If it came late, it would be taken for the second answer, and its data for newer than they are."""
        link, port = asked(packets.MAIN_BATTERY_REQUEST)
        link.deliver(data)
        assert port.poll(20 * MS) is None
        assert port.poll(40 * MS) == Answer(packets.MAIN_BATTERY_REQUEST, None, 0)
        assert bytes(link.sent) == b"\x80\x18"

    def test_a_garbled_acknowledgement_ends_its_request(self) -> None:
        link, port = asked(packets.speeds(1, 1))
        link.deliver(b"\xfe")
        assert port.poll(20 * MS) == Answer(packets.speeds(1, 1), None, 0)
        assert len(link.written) == 1, "the next motion command is newer"

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

    def test_how_late_an_answer_comes_is_told_until_one_is_in_time(self) -> None:
        link, port = asked(packets.MAIN_BATTERY_REQUEST)
        battery = b"\x00\xfc" + crc(24, b"\x00\xfc")
        port.poll(40 * MS)
        assert port.late_answer == "", "nothing came"
        link.deliver(battery)
        port.poll(60 * MS)
        late = "the last answer came 60 ms after its request, too late: the limit is 30 ms"
        assert port.late_answer == late
        port.start(packets.MAIN_BATTERY_REQUEST, 80 * MS)
        link.deliver(battery)
        assert port.poll(100 * MS) is not None
        assert port.late_answer == ""

    def test_a_late_answer_that_comes_in_the_place_of_the_next_is_no_reason_to_ask_again(self) -> None:
        link, port = asked(packets.ENCODERS_REQUEST)
        port.poll(40 * MS)
        port.start(packets.MAIN_BATTERY_REQUEST, 60 * MS)
        data = struct.pack(">II", 1, 2)
        link.deliver(data + crc(78, data))
        assert port.poll(80 * MS) == Answer(packets.MAIN_BATTERY_REQUEST, None, 60 * MS)
        assert bytes(link.sent) == b"\x80\x4e\x80\x18"
        assert port.late_answer.startswith("the last answer came 80 ms after its request")

    def test_no_answer_is_late_for_a_request_before_one_that_was_answered(self) -> None:
        link, port = asked(packets.speeds(1, 1))
        port.poll(40 * MS)
        port.start(packets.MAIN_BATTERY_REQUEST, 60 * MS)
        link.deliver(b"\x00\xfc" + crc(24, b"\x00\xfc"))
        assert port.poll(80 * MS) is not None
        link.deliver(b"\xff")
        port.poll(5000 * MS)
        assert port.late_answer == ""

    def test_noise_is_no_late_answer(self) -> None:
        link, port = asked(packets.ENCODERS_REQUEST)
        port.poll(40 * MS)
        link.deliver(bytes(10))
        port.poll(60 * MS)
        assert port.late_answer == ""

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
